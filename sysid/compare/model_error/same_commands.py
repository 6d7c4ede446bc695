"""Runs of other logs that were sent the commands of a run, so that a model errs by the same in both.

Commands are the same if each change is from and to the same levels at the same time. A wheel on the bench may
also be led by hand, or by a program whose clock is read a little differently each time: its commands are then
as good as the same if they are so for nearly all of the time, since the model is sent those of each run and
answers the small differences itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.measured import COMMAND_STEP_RPM, changes_from_rest, start_of
from sysid.logs import Run

_CLOCK_S: Final = 0.03
"""By how much the times of two changes of command may differ [s] beyond one and a half rows. Assumed: loops
on common computers send a command so late now and then."""
_NEARLY: Final = 0.1
"""Largest mean difference of two commands that are as good as the same, relative to their mean size. Assumed:
a model errs alike in commands that are so close, whether or not they were meant to be the same."""
_GRID_S: Final = 0.005
"""Step of the times at which commands are compared [s]."""


def with_same_commands(run: Run, of_fit: Sequence[Run], period_s: float) -> dict[Run, float]:
    """Return the runs of the fit that were sent the commands of a run, each with its shift [s].

    By so much later it was sent them, by its stamps; it is a multiple of the command period `period_s`, since
    the clock of the robot would else have another phase in a prediction.
    """
    shifts = {other: _shift_s(run, other, period_s) for other in of_fit}
    return {other: shift for other, shift in shifts.items() if shift is not None}


def _shift_s(run: Run, other: Run, period_s: float) -> float | None:
    """Return how much later another run was sent the same commands [s]; None if it was not."""
    if start_of(run).moving != start_of(other).moving:
        return None
    (times, levels), (others, other_levels) = changes_from_rest(run), changes_from_rest(other)
    interval_s = max(run.median_interval_s, other.median_interval_s)
    near = _CLOCK_S + 1.5 * interval_s
    if len(levels) == len(other_levels) >= 2 and np.max(np.abs(levels - other_levels)) <= COMMAND_STEP_RPM:
        apart = others[1:] - times[1:]
        shift = float(np.median(apart))
        lasts = other.time_s[-1] - shift >= run.time_s[-1] - near
        off_clock = abs(shift - period_s * round(shift / period_s))
        if lasts and off_clock <= interval_s and np.max(np.abs(apart - shift)) <= near:
            return shift
    if run.level != "bench" or other.time_s[-1] < run.time_s[-1] - near:
        return None
    return 0.0 if _difference((times, levels), (others, other_levels), run) <= _NEARLY else None


def _difference(
    ours: tuple[FloatArray, FloatArray], theirs: tuple[FloatArray, FloatArray], run: Run
) -> float:
    """Return the mean difference of two commands during a run, relative to the mean size of its own.

    Each is given by the times and levels of its changes.
    """
    grid = np.arange(run.time_s[0], run.time_s[-1], _GRID_S)
    held = [levels[np.searchsorted(times[1:], grid, side="right")] for times, levels in (ours, theirs)]
    size = float(np.mean(np.abs(held[0])))
    return float(np.mean(np.abs(held[0] - held[1]))) / size if size > 0.0 else np.inf
