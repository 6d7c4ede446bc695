"""Command sequences: what is sent to the robot, and when.

A command is held from the time at which it appears until the next one (zero-order hold). The robot latches
what it holds every `command_period_s`; that is done by the wheel plugin, not here.

Command sequences by name, for a first look at a model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS, command_to_wheels, round_command
from mecanum_env.units import FloatArray

_TIME_TOLERANCE_S = 1e-9  # a stamp this close to a sampling time counts as having arrived


@dataclass(frozen=True)
class BodyCommands:
    """Commands of the whole robot: arrays of one shape (n,).

    Raises:
        InputError: shapes differ, a value is not finite, or the times do not increase.
    """

    time_s: FloatArray
    v_rpm: FloatArray
    theta_deg: FloatArray
    vc_rpm: FloatArray

    def __post_init__(self) -> None:
        _check_times(self.time_s, (self.v_rpm, self.theta_deg, self.vc_rpm))

    @staticmethod
    def from_rows(rows: Sequence[tuple[float, float, float, float]]) -> BodyCommands:
        """Build from rows (time [s], V [rpm], theta [deg], VC [rpm])."""
        table = np.array(rows, float).reshape(-1, 4)
        return BodyCommands(table[:, 0], table[:, 1], table[:, 2], table[:, 3])

    @staticmethod
    def constant(v_rpm: float = 0.0, theta_deg: float = 0.0, vc_rpm: float = 0.0) -> BodyCommands:
        """Return one command (V [rpm], theta [deg], VC [rpm]) that holds from time 0 on."""
        return BodyCommands.from_rows([(0.0, v_rpm, theta_deg, vc_rpm)])

    def at(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return (V, theta, VC) held at each time [s], shape (..., 3); zero before the first command."""
        return hold(self.time_s, np.stack([self.v_rpm, self.theta_deg, self.vc_rpm], axis=-1), time_s)

    def wheels_at(self, time_s: npt.ArrayLike, quantum_rpm: float) -> FloatArray:
        """Return the wheel commands [rpm], shape (..., 4), that the held command asks for at each time [s].

        V and VC are first rounded to `quantum_rpm`, theta to 1 degree, as the robot does.
        """
        v, theta, vc = np.moveaxis(self.at(time_s), -1, 0)
        return command_to_wheels(*round_command(v, theta, vc, quantum_rpm))


@dataclass(frozen=True)
class WheelCommands:
    """Commands to the four wheels, for platforms that take them: time (n,) [s], wheels (n, 4) [rpm].

    Raises:
        InputError: shapes differ, a value is not finite, or the times do not increase.
    """

    time_s: FloatArray
    wheels_rpm: FloatArray

    def __post_init__(self) -> None:
        if self.wheels_rpm.ndim != 2 or self.wheels_rpm.shape[1] != len(WHEELS):
            raise InputError(f"wheel commands have shape {self.wheels_rpm.shape}, must be (n, 4)")
        _check_times(self.time_s, tuple(self.wheels_rpm.T))

    def at(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return the wheel commands [rpm] held at each time [s], shape (..., 4); zero before the first."""
        return hold(self.time_s, self.wheels_rpm, time_s)

    def wheels_at(self, time_s: npt.ArrayLike, quantum_rpm: float) -> FloatArray:
        """Return the held wheel commands at each time [s], rounded to `quantum_rpm` (0: not rounded)."""
        held = self.at(time_s)
        return held if quantum_rpm == 0.0 else np.rint(held / quantum_rpm) * quantum_rpm


Commands = BodyCommands | WheelCommands


def hold(stamp_s: FloatArray, value: FloatArray, time_s: npt.ArrayLike, before: float = 0.0) -> FloatArray:
    """Zero-order hold of values (n,) or (n, m) that appear at increasing stamps (n,) [s].

    Args:
        stamp_s: when each value appears.
        value: what is held from then on; n may be 0.
        time_s: where to read it, shape (...).
        before: the value before the first stamp.

    Returns:
        The value held at each time, shape (...) or (..., m).
    """
    index = np.searchsorted(stamp_s, np.asarray(time_s, float) + _TIME_TOLERANCE_S, side="right")
    known: FloatArray = np.concatenate([np.full((1, *value.shape[1:]), before), value])
    return known[index]


def _check_times(time_s: FloatArray, columns: Sequence[FloatArray]) -> None:
    if len(time_s) == 0:
        raise InputError("a command sequence needs at least one command")
    if any(column.shape != time_s.shape for column in columns):
        raise InputError("a command sequence needs as many values as times")
    if not all(np.all(np.isfinite(column)) for column in (time_s, *columns)):
        raise InputError("a command sequence must be finite numbers throughout")
    if np.any(np.diff(time_s) <= 0.0):
        at = int(np.argmax(np.diff(time_s) <= 0.0)) + 1
        raise InputError(f"command {at + 1} comes at {time_s[at]:g} s, not after {time_s[at - 1]:g} s")


_LAST_PAUSE_S = 0.8  # time for the robot to stop in the picture

SCRIPTS: Final[dict[str, tuple[tuple[float, float, float, float], ...]]] = {
    # (duration s, V rpm, theta deg, VC rpm)
    "forward": ((2.0, 80, 0, 0),),
    "sideways": ((2.0, 80, 90, 0),),
    "diagonal": ((2.0, 80, 45, 0),),
    "rotate": ((3.0, 0, 0, 40),),
    # In and out of striking distance, around the opponent, and a turn: what the robot is for.
    "tour": (
        (1.2, 90, 0, 0),
        (0.5, 0, 0, 0),
        (1.2, 90, 90, 0),
        (0.5, 0, 0, 0),
        (1.2, 90, -135, 0),
        (0.5, 0, 0, 0),
        (1.5, 0, 0, 60),
        (1.2, 60, -90, 40),
        (0.8, 100, 180, 0),
    ),
}
"""Name -> commands, one after the other."""


def scripted(name: str) -> tuple[BodyCommands, float]:
    """Return the commands of a script and the duration [s] of the drive, a final stop included.

    Args:
        name: a key of `SCRIPTS`.

    Raises:
        InputError: there is no such script.
    """
    if name not in SCRIPTS:
        raise InputError(
            f"no drive called {name!r}{did_you_mean(name, SCRIPTS)}; known: {', '.join(SCRIPTS)}"
        )
    rows, now = [], 0.0
    for duration, v, theta, vc in SCRIPTS[name]:
        rows.append((round(now, 9), v, theta, vc))
        now += duration
    rows.append((round(now, 9), 0.0, 0.0, 0.0))
    return BodyCommands.from_rows(rows), now + _LAST_PAUSE_S
