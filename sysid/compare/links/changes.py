"""Changes of the command in bench logs, and the delays that are looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.compare.measured import COMMAND_STEP_RPM, start_of
from sysid.logs import Run

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


def changes_of(runs: Sequence[Run], clock_s: float | None) -> tuple[Change, ...]:
    """Return the changes of the command in bench runs.

    A first command other than the wheel's speed is a change, too. Commands are given as stamped or, where the
    drive looks for them every `clock_s` [s], as by `Run.held_since`.
    """
    found = []
    for index, run in enumerate(runs):
        rows, level = run.command_rows(), start_of(run).initial_rpm
        since = run.time_s if clock_s is None else run.held_since(clock_s)
        for row in rows:
            value = float(run.command.wheels_rpm[row, 0])
            if row == 0 and level != 0.0:
                # A wheel that is running already follows its first command.
                level = value
            if abs(value - level) > COMMAND_STEP_RPM:
                found.append(Change(index, float(since[row]), level, value))
                level = value
    return tuple(found)
