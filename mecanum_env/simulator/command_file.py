"""Reading commands from a file: the command columns of a robot log."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import WHEELS
from mecanum_env.simulator.commands import BodyCommands, Commands, WheelCommands
from mecanum_env.simulator.trajectory import CHANNELS
from mecanum_env.tables import SUFFIXES, Table, has_table_suffix, read_table
from mecanum_env.units import FloatArray

TIME: Final = "time_s"
BODY_COLUMNS: Final = ("command_v_rpm", "command_theta_deg", "command_vc_rpm")
WHEEL_COLUMNS: Final = tuple(f"command_{wheel}_rpm" for wheel in WHEELS)
_MEASURED: Final = (*CHANNELS, "battery_v")


def read_commands(path: str | os.PathLike[str]) -> Commands:
    """Read commands from a CSV (.csv, .csv.gz) or Parquet file.

    The columns are `time_s` [s] and either `command_v_rpm`, `command_theta_deg`, `command_vc_rpm` or
    `command_{fl,fr,rl,rr}_rpm`; those that a robot log measures are passed over, so a log can be driven
    again. The first row is time 0. A command holds until the next; an empty cell repeats the one before, and
    is 0 before the first.

    Raises:
        InputError: no such file, an unknown or missing column, a stamp that is missing or not later than the
            one before, text where a number belongs; the message names file, line and value.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such file; commands are a file that ends in {', '.join(SUFFIXES)}")
    if not has_table_suffix(path):
        raise InputError(f"{path}: not a table of commands; its name must end in {', '.join(SUFFIXES)}")
    table = read_table(path)
    columns = _command_columns(table)
    time = _stamps(table)
    held = np.stack([_held(table.column(name)) for name in columns], axis=-1)
    if columns == BODY_COLUMNS:
        return BodyCommands(time, *held.T)
    return WheelCommands(time, held)


def _command_columns(table: Table) -> tuple[str, ...]:
    known = (TIME, *BODY_COLUMNS, *WHEEL_COLUMNS)
    for name in table.names:
        if name not in (*known, *_MEASURED):
            raise InputError(
                f"{table.header}: unknown column {name!r}{did_you_mean(name, known)}; "
                f"known: {', '.join(known)}"
            )
    sets = [s for s in (BODY_COLUMNS, WHEEL_COLUMNS) if any(name in table.names for name in s)]
    if len(sets) != 1:
        raise InputError(
            f"{table.header}: {'both command sets' if sets else 'no command column'}; must have "
            f"{', '.join(BODY_COLUMNS)} or {', '.join(WHEEL_COLUMNS)}"
        )
    lacking = [name for name in (TIME, *sets[0]) if name not in table.names]
    if lacking:
        raise InputError(
            f"{table.header}: column {', '.join(lacking)} is missing; the file has {', '.join(table.names)}"
        )
    return sets[0]


def _stamps(table: Table) -> FloatArray:
    """Return the stamps [s] from the first one on."""
    time = table.column(TIME)
    missing = np.flatnonzero(np.isnan(time))
    if missing.size:
        raise InputError(f"{table.where(int(missing[0]))}: time_s is missing; every row needs a stamp [s]")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise InputError(
            f"{table.where(row)}: time_s = {time[row]:g} after {time[row - 1]:g}, must be larger than the "
            "stamp before"
        )
    since_first: FloatArray = time - time[0]
    return since_first


def _held(values: FloatArray) -> FloatArray:
    """Repeat the last number over missing ones; 0 before the first."""
    there = ~np.isnan(values)
    last = np.maximum.accumulate(np.where(there, np.arange(len(values)), -1))
    return np.where(last < 0, 0.0, values[np.maximum(last, 0)])
