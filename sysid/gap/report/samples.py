"""Samples of one channel of one run: measured, simulated before and after, with the command in force."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEEL_SPEEDS, WHEELS, wheels_to_body
from mecanum_env.units import FloatArray
from sysid.compare.measured import COMMAND_STEP_RPM
from sysid.logs import Run


@dataclass(frozen=True, eq=False)
class HeldCommand:
    """A command that is held from each change to the next, and is 0 before the first."""

    change_s: FloatArray
    """Times of the changes [s], shape (k,), increasing."""
    level_rpm: FloatArray
    """Level after each change [rpm], shape (k, m)."""

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the command [rpm] in force at some times, shape (n, m)."""
        now: FloatArray = self._levels()[np.searchsorted(self.change_s, time_s, side="right")]
        return now

    def since_change_s(self, time_s: FloatArray) -> FloatArray:
        """Return how long the command has been held at some times [s], (n,); infinite before any change."""
        changes = self.change_s[self._changed()]
        index = np.searchsorted(changes, time_s, side="right")
        return np.where(index > 0, time_s - np.concatenate([[0.0], changes])[index], np.inf)

    def before_change(self, time_s: FloatArray) -> FloatArray:
        """Return the level [rpm] before the last change, 0 if there was none, shape (n, m)."""
        changed = np.flatnonzero(self._changed())
        index = np.searchsorted(self.change_s[changed], time_s, side="right")
        # `_levels` begins with the level before the first change, so its row k was in force before change k.
        before: FloatArray = self._levels()[np.concatenate([[0], changed])[index]]
        return before

    def earlier(self, time_s: FloatArray, window_s: float) -> FloatArray:
        """Return the command `window_s` ago, or before the last change if it has returned since, (n, m)."""
        now, then = self.at(time_s), self.at(time_s - window_s)
        equal = np.max(np.abs(then - now), axis=1) <= COMMAND_STEP_RPM
        returned = equal & (self.since_change_s(time_s) < window_s)
        return np.where(returned[:, None], self.before_change(time_s), then)

    def _levels(self) -> FloatArray:
        return np.vstack([np.zeros((1, self.level_rpm.shape[1])), self.level_rpm])

    def _changed(self) -> npt.NDArray[np.bool_]:
        step: FloatArray = np.max(np.abs(np.diff(self._levels(), axis=0)), axis=1)
        return step > COMMAND_STEP_RPM


@dataclass(frozen=True, eq=False)
class Samples:
    """One channel of one run; arrays have shape (n,) and the channel's unit unless stated otherwise."""

    channel: str
    """Column of the log."""
    time_s: FloatArray
    """From the start of the run [s]."""
    measured: FloatArray
    """NaN if missing."""
    before: FloatArray
    """Prediction of the given model."""
    after: FloatArray
    """Prediction of the improved model."""
    wheels: HeldCommand
    """Wheel commands as sent: one column on the bench, four (fl, fr, rl, rr) on the robot."""
    battery_v: FloatArray | None = None
    """Supply voltage [V], if it was logged."""
    yaw_rad: FloatArray | None = None
    """Heading in the world [rad], if it was logged."""
    weight: FloatArray | None = None
    """Number of samples that each value is the mean of; None: 1 each."""
    run: str = ""
    """Name of the run."""
    repeat: int = 0
    """Number of the repeat of its command sequence, from 0."""

    def __post_init__(self) -> None:
        shape = self.time_s.shape
        for name in ("measured", "before", "after", "battery_v", "yaw_rad", "weight"):
            values = getattr(self, name)
            if values is not None and values.shape != shape:
                raise InputError(f"{self.channel}: {name} has shape {values.shape}, must be {shape}")
        if self.wheels.level_rpm.shape[1] not in (1, 4):
            raise InputError(
                f"{self.channel}: a command for {self.wheels.level_rpm.shape[1]} wheels, must be 1 or 4"
            )

    @property
    def command(self) -> HeldCommand:
        """Command that the channel follows [rpm]: its wheel's (1 column), or forward, left and turn (3)."""
        levels = self.wheels.level_rpm
        if levels.shape[1] == 1:
            return self.wheels
        wheel = wheel_of(self.channel)
        if wheel is None:
            return HeldCommand(self.wheels.change_s, wheels_to_body(levels))
        i = WHEELS.index(wheel)
        return HeldCommand(self.wheels.change_s, levels[:, i : i + 1])

    def errors(self) -> tuple[FloatArray, FloatArray]:
        """Return measured minus predicted before and after, each of shape (n,); angles within half a turn."""
        before, after = self.measured - self.before, self.measured - self.after
        if self.channel == "yaw_rad":
            before, after = (np.remainder(error + np.pi, 2.0 * np.pi) - np.pi for error in (before, after))
        return before, after


def samples_of(
    run: Run, before: Mapping[str, FloatArray], after: Mapping[str, FloatArray], repeat: int = 0
) -> tuple[Samples, ...]:
    """Return the measured channels of a run, which is one `repeat` of its command sequence, counted from 0.

    `before` and `after` are channel -> prediction of the given and the improved model, each of shape (n,).
    """
    wheels = HeldCommand(*run.command_changes())
    return tuple(
        Samples(
            channel=name,
            time_s=run.time_s,
            measured=run.channel(name),
            before=predicted,
            after=after[name],
            wheels=wheels,
            battery_v=run.channels.get("battery_v"),
            yaw_rad=run.channels.get("yaw_rad"),
            run=run.file,
            repeat=repeat,
        )
        for name, predicted in before.items()
    )


def wheel_of(channel: str) -> str | None:
    """Return which of fl, fr, rl, rr a `channel` measures; None for the body and the bench."""
    return WHEELS[WHEEL_SPEEDS.index(channel)] if channel in WHEEL_SPEEDS else None
