"""Changes of the command in bench logs, and the delays that are looked for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.measured import COMMAND_STEP_RPM, start_of
from sysid.logs import Run

SPEED: Final = "speed_rpm"
"""The channel of bench logs that shows the changes."""
LONGEST_S: Final = 0.5
"""Longest delay that is looked for [s]."""
STEP_S: Final = 0.002
"""Step of the grid of delays [s]."""
GRID_S: Final = np.arange(0.0, LONGEST_S + 0.5 * STEP_S, STEP_S)
"""All delays that are looked for [s]."""


@dataclass(frozen=True)
class Change:
    """A change of the command in one of the runs."""

    run: int
    """Index of the run."""
    given_s: float
    """When the command was given, from the start of the run [s]."""
    before_rpm: float
    after_rpm: float
    within_s: float = 0.0
    """Time after `given_s` within which it was given [s]; 0: it was given then."""
    stamped_s: float = 0.0
    """By how much later than `given_s` the log says that it was given [s]."""


def changes_of(
    runs: Sequence[Run], clock_s: float | None, *, between_rows: bool = False
) -> tuple[Change, ...]:
    """Return the changes of the command in bench runs.

    A first command other than the wheel's speed is a change, too. Commands are given as stamped or, where the
    drive looks for them every `clock_s` [s], as by `Run.held_since`; with `between_rows` at any time since
    the row before the one that shows them (`Run.given_between`).
    """
    found = []
    for index, run in enumerate(runs):
        rows, level = run.command_rows(), start_of(run).initial_rpm
        after, by = run.given_between()
        since = by if clock_s is None else run.held_since(clock_s)
        for row in rows:
            value = float(run.command.wheels_rpm[row, 0])
            if row == 0 and level != 0.0:
                # A wheel that is running already follows its first command.
                level = value
            if abs(value - level) > COMMAND_STEP_RPM:
                stamp = float(since[row])
                if between_rows and row > 0:
                    before = float(after[row])
                    within = float(by[row]) - before
                    found.append(Change(index, before, level, value, within, stamp - before))
                else:
                    found.append(Change(index, stamp, level, value))
                level = value
    return tuple(found)


def means_over_ticks(
    at_s: FloatArray, levels_rpm: FloatArray, tick_s: float, end_s: float
) -> tuple[FloatArray, FloatArray]:
    """Return a command as a law sees it that changes within ticks: times [s] and means over ticks, (m,).

    A drive takes the mean, too, of a command that arrives within a tick. The command changes at `at_s` [s],
    (n,), and is at levels [rpm], (n + 1,), the first one from 0 on. Only the ticks of `tick_s` [s] until
    `end_s` [s] at which its mean changes are returned, and the first.
    """
    ticks = tick_s * np.arange(math.ceil(end_s / tick_s) + 2)
    ends = np.concatenate([[0.0], at_s, [max(float(ticks[-1]), float(np.max(at_s, initial=0.0))) + tick_s]])
    whole = np.concatenate([[0.0], np.cumsum(levels_rpm * np.diff(ends))])
    mean = np.round(np.diff(np.interp(ticks, ends, whole)) / tick_s, 6)
    changes = np.append(True, np.abs(np.diff(mean)) > 1e-5)
    return ticks[:-1][changes], mean[changes]
