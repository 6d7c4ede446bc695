"""Columns, runs and datasets: what a log may contain, and what it is once it has been read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal, TypeAlias, get_args

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import BODY_COMMAND, WHEEL_COMMAND, command_to_wheels
from mecanum_env.kinematics import WHEEL_SPEEDS as WHEEL_SPEEDS
from mecanum_env.units import FloatArray
from sysid.logs.findings import Finding

TIME: Final = "time_s"
BENCH_COMMAND: Final = ("command_rpm",)
COMMANDS: Final = (*BENCH_COMMAND, *BODY_COMMAND, *WHEEL_COMMAND)
SPEEDS: Final = (*BENCH_COMMAND, *WHEEL_COMMAND, "speed_rpm", *WHEEL_SPEEDS)
"""Columns that hold the speed of a wheel, commanded or measured [rpm]."""

UNITS: Final[Mapping[str, str]] = {
    "speed_rpm": "rpm",
    **dict.fromkeys(WHEEL_SPEEDS, "rpm"),
    "vx_m_s": "m/s",
    "vy_m_s": "m/s",
    "yaw_rate_rad_s": "rad/s",
    "x_m": "m",
    "y_m": "m",
    "yaw_rad": "rad",
    "battery_v": "V",
}
"""Measured columns and their units."""

ROBOT_MOTION: Final = tuple(name for name in UNITS if name not in ("speed_rpm", "battery_v"))
"""A robot log needs at least one of these columns."""

KNOWN: Final = (TIME, *COMMANDS, *UNITS)
"""All columns that a log may have."""

REST: Final[Mapping[str, float]] = {
    "speed_rpm": 1.0,
    **dict.fromkeys(WHEEL_SPEEDS, 1.0),
    "vx_m_s": 0.02,
    "vy_m_s": 0.02,
    "yaw_rate_rad_s": 0.05,
}
"""Largest speed of a channel at rest, in its own unit: sensor noise, about 1 rpm of a wheel."""

Split: TypeAlias = Literal["fit", "validation", "test"]
Level: TypeAlias = Literal["bench", "robot"]
SPLITS: Final[tuple[Split, ...]] = get_args(Split)
_ROUNDING: Final = 1e-6  # rounding error of stamps that a program has converted, in command periods
_NEAR_ROWS: Final = 0.01
"""Share of the time since the row before by which a row may come before a clock's time and count as at it.
Assumed: stamps of microseconds, and of loops that are even to a hundredth."""


@dataclass(frozen=True, eq=False)
class BenchCommand:
    """Commanded speed of a single wheel."""

    command_rpm: FloatArray
    """Shape (n,)."""

    @property
    def wheels_rpm(self) -> FloatArray:
        """Commanded wheel speed [rpm], shape (n, 1)."""
        return self.command_rpm[:, np.newaxis]

    def columns(self) -> dict[str, FloatArray]:
        """Return the log columns that hold this command."""
        return {"command_rpm": self.command_rpm}


@dataclass(frozen=True, eq=False)
class BodyCommand:
    """The three commands of the robot, each of shape (n,)."""

    v_rpm: FloatArray
    theta_deg: FloatArray
    vc_rpm: FloatArray

    @property
    def wheels_rpm(self) -> FloatArray:
        """Commanded wheel speeds [rpm] in the order fl, fr, rl, rr, shape (n, 4); not saturated."""
        return command_to_wheels(self.v_rpm, self.theta_deg, self.vc_rpm)

    def columns(self) -> dict[str, FloatArray]:
        """Return the log columns that hold this command."""
        return dict(zip(BODY_COMMAND, (self.v_rpm, self.theta_deg, self.vc_rpm), strict=True))


@dataclass(frozen=True, eq=False)
class WheelCommand:
    """Commanded speeds of the four wheels, for platforms that take those."""

    wheels_rpm: FloatArray
    """In the order fl, fr, rl, rr, shape (n, 4)."""

    def columns(self) -> dict[str, FloatArray]:
        """Return the log columns that hold this command."""
        return dict(zip(WHEEL_COMMAND, self.wheels_rpm.T, strict=True))


Command: TypeAlias = BenchCommand | BodyCommand | WheelCommand


@dataclass(frozen=True, eq=False)
class Run:
    """One recording.

    Arrays are read-only and have one entry per row of the file.
    """

    file: str
    """Name of the file inside its folder."""
    group: str
    """Runs of one group are repeats of one command sequence."""
    split: Split
    time_s: FloatArray
    """Stamps [s] from the run's first one, which is 0; shape (n,), strictly increasing, n >= 2."""
    command: Command
    """Zero-order hold: a row without a command repeats the one before, and is 0 before the first."""
    channels: Mapping[str, FloatArray]
    """Measured columns by name, in the units of `UNITS`, shape (n,); NaN where a sample is missing."""
    start_s: float = 0.0
    """First stamp of the file [s]."""
    full_v: float | None = None
    """Voltage of the supply that counts as full [V], for a piece of a run; None: that of its first sample."""
    weights: Mapping[str, FloatArray] = field(default_factory=dict)
    """How much each sample of a channel counts, shape (n,); 1 for channels without (`sysid.logs.tails`)."""
    given: FloatArray | None = None
    """Times [s] after which and by which each row's command was given, shape (2, n), where repeats tell them
    (`sysid.logs.common_times`); None: it was given after the row before, and by the row that shows it."""

    @property
    def level(self) -> Level:
        """Whether this is a log of one wheel on the bench or of the whole robot."""
        return "bench" if isinstance(self.command, BenchCommand) else "robot"

    @property
    def duration_s(self) -> float:
        """Time from the first to the last row [s]."""
        return float(self.time_s[-1])

    @property
    def median_interval_s(self) -> float:
        """Median time between rows [s]."""
        return float(np.median(np.diff(self.time_s)))

    def channel(self, name: str) -> FloatArray:
        """Return a measured column, shape (n,).

        Raises:
            InputError: this run has no such column; the message lists those it has.
        """
        if name not in self.channels:
            raise InputError(
                f"{self.file}: no column {name}{did_you_mean(name, self.channels)}; "
                f"measured here: {', '.join(self.channels)}"
            )
        return self.channels[name]

    def finite(self, name: str) -> npt.NDArray[np.bool_]:
        """Return where a measured column has a sample, shape (n,).

        Raises:
            InputError: this run has no such column.
        """
        return np.isfinite(self.channel(name))

    def command_rows(self) -> npt.NDArray[np.intp]:
        """Return the first row and every row whose wheel command differs from the row before, shape (m,)."""
        wheels = self.command.wheels_rpm
        changed = np.any(wheels[1:] != wheels[:-1], axis=1)
        return np.concatenate([[0], np.flatnonzero(changed) + 1])

    def command_changes(self) -> tuple[FloatArray, FloatArray]:
        """Return times [s], shape (m,), and wheel commands [rpm], shape (m, 1 or 4), of `command_rows`."""
        rows = self.command_rows()
        return self.given_between()[1][rows], self.command.wheels_rpm[rows]

    def given_between(self) -> tuple[FloatArray, FloatArray]:
        """Return the times [s] after which and by which each row's command was given, (n,) each."""
        if self.given is not None:
            return self.given[0], self.given[1]
        return np.concatenate([[-np.inf], self.time_s[:-1]]), self.time_s

    def held_since(self, command_period_s: float) -> FloatArray:
        """Return the earliest time at which the robot may have held each row's command [s], shape (n,).

        A log shows a command in the first row after it was given, and stamps are never quite even. The robot
        looks for a command at multiples of its period. The first row after such a time is taken to show what
        the robot found then: otherwise a command logged 20 us late would be replayed 0.1 s late. A row just
        before such a time counts as at it: where the rows themselves are the clock, it is theirs.
        """
        after, by = self.given_between()
        near = np.where(np.isfinite(after), _NEAR_ROWS * (by - after), 0.0) / command_period_s
        looked = np.floor(by / command_period_s + np.maximum(_ROUNDING, near)) * command_period_s
        return np.where(looked > after + _ROUNDING * command_period_s, looked, by)


@dataclass(frozen=True, eq=False)
class Dataset:
    """All runs of a folder in the order of their file names, and what was noticed in them."""

    name: str
    runs: tuple[Run, ...]
    findings: tuple[Finding, ...]
    sha256: str = ""
    """Digest of the files that were read, for provenance."""

    @property
    def level(self) -> Level:
        """Whether these are bench logs or robot logs; all runs of a dataset are of one kind."""
        return self.runs[0].level

    def split(self, name: Split) -> tuple[Run, ...]:
        """Return the runs of one split, possibly none."""
        return tuple(run for run in self.runs if run.split == name)

    @property
    def columns(self) -> frozenset[str]:
        """Names of the measured columns that have a sample in any run."""
        return frozenset(name for run in self.runs for name in run.channels if np.any(run.finite(name)))

    @property
    def command_falls(self) -> bool:
        """Whether the command of any wheel falls or reverses within a run."""
        return any(
            bool(np.any(np.diff(rpm, axis=0) * np.sign(rpm[:-1]) < 0.0))
            for rpm in (run.command.wheels_rpm for run in self.runs)
        )

    def groups(self) -> dict[str, tuple[Run, ...]]:
        """Return the runs by group, each a set of repeats."""
        names = dict.fromkeys(run.group for run in self.runs)
        return {name: tuple(run for run in self.runs if run.group == name) for name in names}
