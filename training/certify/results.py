"""The metrics of a controller on one plant against one opponent, in tracking, and in time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from training.certify.plants import Group
from training.evaluate import Mean, Share


@dataclass(frozen=True)
class VariantResult:
    """Metrics of the dodge on one plant."""

    name: str
    group: Group
    summary: str
    physics: str
    success: Share
    by_technique: Mapping[str, Share]
    """Technique of the opponent -> success."""
    failures: Mapping[str, int]
    """Reason of failure -> number of episodes."""
    change: Mean | None
    """Success minus that on the nominal plant, seed by seed; None on the nominal plant itself."""
    settling_s: Mean | None
    """Time until the robot is at maai and facing, over the episodes in which it gets there [s]."""
    overshoot: Mean | None
    saturated_share: Mean
    speed_error_m_s: Mean
    """RMS of the commanded minus the actual velocity [m/s]."""
    duration_s: Mean
    total_reward: Mean
    bound: Share | None = None
    """Success of the oracle on the same plant, against the same opponent; None: not played."""
    opponent: Mapping[str, Any] | None = None
    """The opponent, or the distribution, as `opponent_to_dict` gives it; None: that of the difficulty."""

    @property
    def share_of_bound(self) -> float | None:
        """Success relative to the bound; None without one, or where the bound is 0."""
        if self.bound is None or self.bound.successes == 0:
            return None
        return self.success.value / self.bound.value


@dataclass(frozen=True)
class TrackingResult:
    """Metrics of the tracking task on the nominal plant."""

    success: Share
    distance_error_m: Mean | None
    """RMS of distance - maai of an episode [m]; None if no episode lasted until tracking counts."""
    bearing_error_rad: Mean | None
    """RMS of the bearing of an episode [rad]."""


@dataclass(frozen=True)
class Timing:
    """Processor time per command, on the machine that wrote the certificate."""

    p50_s: float
    p99_s: float
    longest_s: float
    commands: int
    """Number of timed commands."""


def worst_of(results: Sequence[VariantResult]) -> VariantResult:
    """Return the result with the smallest success, the first one of several."""
    return min(results, key=lambda one: one.success.value)
