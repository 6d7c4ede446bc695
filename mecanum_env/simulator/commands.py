"""Command sequences: what is sent to the robot and when, given as arrays, by name or in a file.

A command is held from the time at which it appears until the next one (zero-order hold). The robot latches
the held command every `command_period_s`; the wheel plugin does that, not this module.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import BODY_COMMAND, WHEEL_COMMAND, WHEELS, command_to_wheels, round_command
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.tables import SUFFIXES, Table, check_stamps, has_table_suffix, read_table
from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class BodyCommands:
    """Commands of the whole robot: times and the three commands, each of shape (n,).

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
        """Return the commands of rows (time [s], V [rpm], theta [deg], VC [rpm])."""
        return BodyCommands(*np.array(rows, float).reshape(-1, 4).T)

    @staticmethod
    def constant(v_rpm: float = 0.0, theta_deg: float = 0.0, vc_rpm: float = 0.0) -> BodyCommands:
        """Return one command (V [rpm], theta [deg], VC [rpm]) that holds from time 0 on."""
        return BodyCommands.from_rows([(0.0, v_rpm, theta_deg, vc_rpm)])

    def at(self, time_s: npt.ArrayLike) -> FloatArray:
        """Return (V, theta, VC) held at each time [s], shape (..., 3); zero before the first command."""
        return hold(self.time_s, np.stack([self.v_rpm, self.theta_deg, self.vc_rpm], axis=-1), time_s)

    def wheels_at(self, time_s: npt.ArrayLike, quantum_rpm: float) -> FloatArray:
        """Return the wheel commands [rpm], shape (..., 4), that the held command asks for at each time [s].

        V and VC are first rounded to `quantum_rpm` and theta to 1 degree, as the robot does.
        """
        v, theta, vc = np.moveaxis(self.at(time_s), -1, 0)
        return command_to_wheels(*round_command(v, theta, vc, quantum_rpm))


@dataclass(frozen=True, eq=False)
class WheelCommands:
    """Commands of the four wheels, for platforms that take them: times (n,) [s], wheel speeds (n, 4) [rpm].

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
    """Return the value held at each time of shape (...) [s], shape (...) or (..., m).

    The values (n,) or (n, m) appear at increasing stamps (n,) [s] and are held until the next; n may be 0,
    and the value `before` the first stamp is given.
    """
    # A stamp within 1 ns of a sampling time counts as having arrived.
    index = np.searchsorted(stamp_s, np.asarray(time_s, float) + 1e-9, side="right")
    return np.concatenate([np.full((1, *value.shape[1:]), before), value])[index]


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


SCRIPTS: Final[dict[str, tuple[tuple[float, float, float, float], ...]]] = {
    "forward": ((2.0, 80, 0, 0),),
    "sideways": ((2.0, 80, 90, 0),),
    "diagonal": ((2.0, 80, 45, 0),),
    "rotate": ((3.0, 0, 0, 40),),
    # Into striking distance and out of it, around the opponent, and a turn: what the robot is for.
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
"""Name of a drive -> its commands in order: duration [s], V [rpm], theta [deg], VC [rpm]."""


def scripted(name: str) -> tuple[BodyCommands, float]:
    """Return the commands of a drive named in `SCRIPTS` and its duration [s], 0.8 s for a stop included.

    Raises:
        InputError: there is no such drive.
    """
    if name not in SCRIPTS:
        raise InputError(
            f"no drive called {name!r}{did_you_mean(name, SCRIPTS)}; known: {', '.join(SCRIPTS)}"
        )
    rows, now = [], 0.0
    for duration, v, theta, vc in (*SCRIPTS[name], (0.8, 0.0, 0.0, 0.0)):
        rows.append((round(now, 9), v, theta, vc))
        now += duration
    return BodyCommands.from_rows(rows), now


def read_commands(path: str | os.PathLike[str]) -> Commands:
    """Read commands from a CSV (.csv, .csv.gz) or Parquet file.

    The columns are `time_s` [s] and either `command_v_rpm`, `command_theta_deg`, `command_vc_rpm` or
    `command_{fl,fr,rl,rr}_rpm`. The measured columns of a robot log are ignored, so a log can be driven
    again. The first row is time 0. A command holds until the next; an empty cell repeats the one before, and
    is 0 before the first.

    Raises:
        InputError: no such file, an unknown or missing column, a stamp that is missing or not later than the
            one before, text where a number belongs; the message names file, line and value.
    """
    path = Path(path)
    if not os.path.isfile(path):
        raise InputError(f"{path}: no such file; commands are a file that ends in {', '.join(SUFFIXES)}")
    if not has_table_suffix(path):
        raise InputError(f"{path}: not a table of commands; its name must end in {', '.join(SUFFIXES)}")
    table = read_table(path)
    columns = _command_columns(table)
    time = _stamps(table)
    held = np.stack([_fill_forward(table.column(name)) for name in columns], axis=-1)
    return BodyCommands(time, *held.T) if columns == BODY_COMMAND else WheelCommands(time, held)


def _command_columns(table: Table) -> tuple[str, ...]:
    known = ("time_s", *BODY_COMMAND, *WHEEL_COMMAND)
    for name in table.names:
        if name not in (*known, *CHANNELS, "battery_v"):
            raise InputError(
                f"{table.header}: unknown column {name!r}{did_you_mean(name, known)}; "
                f"known: {', '.join(known)}"
            )
    sets = [s for s in (BODY_COMMAND, WHEEL_COMMAND) if any(name in table.names for name in s)]
    if len(sets) != 1:
        raise InputError(
            f"{table.header}: {'both command sets' if sets else 'no command column'}; must have "
            f"{', '.join(BODY_COMMAND)} or {', '.join(WHEEL_COMMAND)}"
        )
    missing = [name for name in ("time_s", *sets[0]) if name not in table.names]
    if missing:
        raise InputError(
            f"{table.header}: column {', '.join(missing)} is missing; the file has {', '.join(table.names)}"
        )
    return sets[0]


def _stamps(table: Table) -> FloatArray:
    """Return the stamps [s] since the first one."""
    time = table.column("time_s")
    check_stamps(table, time)
    return np.asarray(time - time[0])


def _fill_forward(values: FloatArray) -> FloatArray:
    """Repeat the last number over missing ones; 0 before the first."""
    last = np.maximum.accumulate(np.where(np.isnan(values), -1, np.arange(len(values))))
    return np.where(last < 0, 0.0, values[np.maximum(last, 0)])
