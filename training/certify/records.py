"""What a certificate holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

from mecanum_env.tankendo import Rules
from training.certify.plants import Group
from training.certify.warning import WarningCurve
from training.evaluate import Mean, Share


@dataclass(frozen=True)
class Thresholds:
    """What it takes to pass; each is held against the worse end of the figure's 95 % interval."""

    success: float = 0.75
    """Least success on the nominal plant."""
    worst_success: float = 0.60
    """Least success on the worst plant."""
    warning_s: float = 0.58
    """Most warning that it may need for nine successes in ten, nominal plant [s]: the longest published."""
    tracking_m: float = Rules.band_m
    """Largest tracking error: rms of distance - maai behind an opponent that walks about [m]; by default as
    far off as still counts as at maai."""
    settling_s: float = 1.0
    """Longest mean time until at maai and facing [s]."""
    overshoot: float = 0.25
    """Largest mean overshoot of the distance, over the distance to cover."""
    saturated_share: float = 0.5
    """Largest share of commands that ask a wheel for its ceiling."""
    command_s: float = 0.1
    """Longest processor time for a command, 99 of 100 [s]; the robot takes one every 0.1 s."""


@dataclass(frozen=True)
class PlantFigures:
    """What the episodes of the dodge on one plant gave."""

    name: str
    group: Group
    summary: str
    physics: str
    success: Share
    by_technique: Mapping[str, Share]
    """What the opponent strikes with -> success."""
    failures: Mapping[str, int]
    """Why episodes failed -> how many."""
    change: Mean | None
    """Success minus that on the nominal plant, seed by seed; None on the nominal plant itself."""
    settling_s: Mean | None
    """Time until at maai and facing, of the episodes that get there [s]."""
    overshoot: Mean | None
    saturated_share: Mean
    speed_error_m_s: Mean
    """Root mean square of commanded minus actual velocity [m/s]."""
    duration_s: Mean
    total_reward: Mean


@dataclass(frozen=True)
class TrackFigures:
    """What the tracking task gave on the nominal plant."""

    success: Share
    distance_error_m: Mean | None
    """Root mean square of distance - maai, episode by episode [m]; None if none lasted until it counts."""
    bearing_error_rad: Mean | None
    """The same of the bearing [rad]."""


@dataclass(frozen=True)
class Timing:
    """Processor time for a command, on the machine that wrote the certificate."""

    p50_s: float
    p99_s: float
    longest_s: float
    commands: int
    """That were timed."""


@dataclass(frozen=True)
class Check:
    """One threshold."""

    name: str
    text: str
    """What is held against the limit, with its interval."""
    value: float | None
    """The worse end of the interval; None: not defined, which does not pass."""
    sense: Literal["at least", "at most"]
    limit: float
    unit: str
    """Of the value and the limit; empty for shares."""
    passed: bool


@dataclass(frozen=True)
class Certificate:
    """All figures of a controller; two of the same controller, model and seeds are equal."""

    controller: str
    plants: tuple[PlantFigures, ...]
    """The nominal one first."""
    warning: WarningCurve
    track: TrackFigures
    thresholds: Thresholds
    checks: tuple[Check, ...]
    """All but the one of the time for a command."""
    notes: tuple[str, ...]
    provenance: Mapping[str, str | int]
    timing: Timing = field(compare=False)
    """Of the machine, so it does not count in `==`."""
    timing_check: Check = field(compare=False)

    @property
    def nominal(self) -> PlantFigures:
        """The model itself."""
        return self.plants[0]

    @property
    def worst(self) -> PlantFigures:
        """The plant with the least success, the first of several."""
        return min(self.plants, key=lambda plant: plant.success.value)

    @property
    def passed(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in (*self.checks, self.timing_check))
