"""One channel of one run as measured and as simulated, with what was commanded: what regions are cut from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS, wheels_to_body
from mecanum_env.units import FloatArray
from sysid.logs import Run

COMMAND_STEP_RPM: Final = 1.0
"""Commands that differ by no more than this count as one level: the robot's own quantum."""


@dataclass(frozen=True, eq=False)
class HeldCommand:
    """A command that holds from each change to the next, and is 0 before the first."""

    change_s: FloatArray
    """When it changes [s], shape (k,), increasing."""
    level_rpm: FloatArray
    """To what [rpm], shape (k, m)."""

    def at(self, time_s: FloatArray) -> FloatArray:
        """Return the command in force at some times, shape (n, m)."""
        now: FloatArray = self._levels()[np.searchsorted(self.change_s, time_s, side="right")]
        return now

    def since_change_s(self, time_s: FloatArray) -> FloatArray:
        """Return how long the command has been held at some times [s], infinite before any change, (n,)."""
        changes = self.change_s[self._changed()]
        index = np.searchsorted(changes, time_s, side="right")
        return np.where(index > 0, time_s - np.concatenate([[0.0], changes])[index], np.inf)

    def before_change(self, time_s: FloatArray) -> FloatArray:
        """Return the level before the last change, 0 where there was none, shape (n, m)."""
        changed = np.flatnonzero(self._changed())
        index = np.searchsorted(self.change_s[changed], time_s, side="right")
        # `_levels` is one row ahead, so its row k is what was in force before change k.
        before: FloatArray = self._levels()[np.concatenate([[0], changed])[index]]
        return before

    def earlier(self, time_s: FloatArray, window_s: float) -> FloatArray:
        """Return the command `window_s` ago, or before the last change if it has come back since, (n, m)."""
        now, then = self.at(time_s), self.at(time_s - window_s)
        back = np.max(np.abs(then - now), axis=1) <= COMMAND_STEP_RPM
        returned = back & (self.since_change_s(time_s) < window_s)
        return np.where(returned[:, None], self.before_change(time_s), then)

    def _levels(self) -> FloatArray:
        return np.vstack([np.zeros((1, self.level_rpm.shape[1])), self.level_rpm])

    def _changed(self) -> npt.NDArray[np.bool_]:
        changed: npt.NDArray[np.bool_] = (
            np.max(np.abs(np.diff(self._levels(), axis=0)), axis=1) > COMMAND_STEP_RPM
        )
        return changed


@dataclass(frozen=True, eq=False)
class Samples:
    """One channel of one run; arrays of samples have shape (n,)."""

    channel: str
    """Column of the log."""
    time_s: FloatArray
    """From the start of the run [s]."""
    measured: FloatArray
    """In the channel's unit; NaN where missing."""
    before: FloatArray
    """As the model that was given predicts it."""
    after: FloatArray
    """As the improved model predicts it; equal to `before` where nothing was added."""
    wheels: HeldCommand
    """Wheel commands as sent: one column on the bench, four (fl, fr, rl, rr) on the robot."""
    battery_v: FloatArray | None = None
    """Supply voltage [V], where it was logged."""
    yaw_rad: FloatArray | None = None
    """Heading in the world [rad], where it was logged."""
    weight: FloatArray | None = None
    """Samples of the log that each value is the mean of; 1 each where None."""
    run: str = ""
    """Name of the run."""
    group: str = ""
    """Repeats of one command sequence share it."""
    repeat: int = 0
    """Which repeat of its command sequence this run is, from 0."""

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
        """Command that the channel follows: its wheel's (1 column), or the body's (3).

        The body's is forward, left, counter-clockwise in wheel rpm.
        """
        levels = self.wheels.level_rpm
        if levels.shape[1] == 1:
            return self.wheels
        wheel = wheel_of(self.channel)
        if wheel is None:
            return HeldCommand(self.wheels.change_s, wheels_to_body(levels))
        i = WHEELS.index(wheel)
        return HeldCommand(self.wheels.change_s, levels[:, i : i + 1])

    def errors(self) -> tuple[FloatArray, FloatArray]:
        """Return measured minus simulated before and after, each of shape (n,); angles within half a turn."""
        before, after = self.measured - self.before, self.measured - self.after
        if self.channel != "yaw_rad":
            return before, after
        return _half_turn(before), _half_turn(after)


def samples_of(
    run: Run, before: Mapping[str, FloatArray], after: Mapping[str, FloatArray], repeat: int = 0
) -> tuple[Samples, ...]:
    """Return the channels of a run beside their simulations, sample by sample.

    Args:
        run: as read.
        before: channel -> prediction of the model that was given, at the run's own stamps, shape (n,).
        after: the same of the improved model.
        repeat: which repeat of its command sequence the run is, from 0.
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
            group=run.group,
            repeat=repeat,
        )
        for name, predicted in before.items()
    )


def wheel_of(channel: str) -> str | None:
    """Return which of fl, fr, rl, rr a `channel` measures; None for the body and for the bench."""
    return next((wheel for wheel in WHEELS if channel == f"speed_{wheel}_rpm"), None)


def _half_turn(angle_rad: FloatArray) -> FloatArray:
    wrapped: FloatArray = np.remainder(angle_rad + np.pi, 2.0 * np.pi) - np.pi
    return wrapped
