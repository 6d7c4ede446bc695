"""When commands were given, told by all repeats of a sequence together.

A logger that writes rows at its own pace shows a command in the first row after it was given. Where a row
falls on the instant at which the command was given, a little jitter of the stamps decides whether that row
shows it or the next one, so that two repeats seem to be sent the same command a row apart. If a sequence was
given at the same times in all of its repeats, each change happened after the last of the rows before it and
by the first of the rows that show it.

Other programs write a row when they send a command, and their repeats do differ. The measured speeds tell the
two apart: where a repeat shows a command later than the others by d, it also moves later by d if it was sent
it later, so that its speed differs from their mean by -d times the slope.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.logs.runs import Dataset, Run

_APART: Final = 0.25
"""Least difference of the times at which repeats show a command, in intervals of rows, that is worth it.
Assumed: less shifts no sample by much."""
_LONGEST_S: Final = 1.0
"""Time after a change of command in which the speeds of repeats are compared [s]. Assumed: longer than most
wheels take to follow."""


@dataclass(frozen=True, eq=False)
class _Sequence:
    """Repeats that may have been given their commands at the same times, with the c changes of these."""

    runs: tuple[Run, ...]
    after_s: FloatArray
    """Time after which each change happened, (c,)."""
    by_s: FloatArray
    """Time by which it did, (c,)."""

    def with_run(self, run: Run) -> _Sequence | None:
        """Return the sequence with a further run of its levels; None if their times exclude each other."""
        after, by = _between(run)
        after, by = np.maximum(after, self.after_s), np.minimum(by, self.by_s)
        return _Sequence((*self.runs, run), after, by) if np.all(after < by) else None

    def timed(self, run: Run) -> Run:
        """Return one of its runs with the times of all."""
        rows, given = run.command_rows()[1:], np.array(run.given_between())
        given[0, rows], given[1, rows] = self.after_s, self.by_s
        return replace(run, given=given)

    @property
    def apart(self) -> float:
        """Largest difference of the times at which the runs show a change, in intervals of rows."""
        shown = np.array([_between(run)[1] for run in self.runs])
        interval_s = min(run.median_interval_s for run in self.runs)
        return float(np.max(np.ptp(shown, axis=0), initial=0.0)) / interval_s


def with_common_times(dataset: Dataset, *others: Dataset) -> tuple[Dataset, ...]:
    """Return bench logs and others of the same wheel, their runs with the times of common commands.

    Runs of equal commands are repeats, whatever their groups are called. All logs stay as they are where the
    measured speeds say that each repeat was sent its commands when its rows show them, or where it makes no
    difference.
    """
    given = (dataset, *others)
    if any(one.level != "bench" for one in given):
        return given
    alike: dict[bytes, list[_Sequence]] = {}
    for run in (run for one in given for run in one.runs if run.finite("speed_rpm").any()):
        sequences = alike.setdefault(_levels(run).tobytes(), [])
        for index, known in enumerate(sequences):
            if (larger := known.with_run(run)) is not None:
                sequences[index] = larger
                break
        else:
            sequences.append(_Sequence((run,), *_between(run)))
    every = [sequence for sequences in alike.values() for sequence in sequences]
    doubtful = [sequence for sequence in every if sequence.apart > _APART]
    if not doubtful or not _are_common(doubtful):
        return given
    timed = {id(run): sequence.timed(run) for sequence in every for run in sequence.runs}
    return tuple(replace(one, runs=tuple(timed.get(id(run), run) for run in one.runs)) for one in given)


def _levels(run: Run) -> FloatArray:
    levels: FloatArray = run.command.wheels_rpm[run.command_rows(), 0]
    return levels


def _between(run: Run) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] after which and by which each change of command happened, (c,) each."""
    rows = run.command_rows()[1:]
    after, by = run.given_between()
    return after[rows], by[rows]


def _are_common(sequences: Sequence[_Sequence]) -> bool:
    """Return whether the speeds of repeats differ less than if each was sent commands when it shows them."""
    alike = apart = 0.0
    for sequence in sequences:
        shown = np.array([_between(run)[1] for run in sequence.runs])
        clock = sequence.runs[0].time_s
        speeds = np.array([_speed(run, clock) for run in sequence.runs])
        differ, slope = speeds - speeds.mean(axis=0), np.gradient(speeds.mean(axis=0), clock)
        later = shown - shown.mean(axis=0)
        ends = [*sequence.by_s[1:], float(clock[-1])]
        for number, (start, end) in enumerate(zip(sequence.by_s, ends, strict=True)):
            rows = (clock >= start) & (clock < min(end, start + _LONGEST_S))
            alike += float(np.sum(differ[:, rows] ** 2))
            apart += float(np.sum((differ[:, rows] + np.outer(later[:, number], slope[rows])) ** 2))
    return alike < apart


def _speed(run: Run, at_s: FloatArray) -> FloatArray:
    """Return the measured speed of a run at some times [s], between its samples."""
    known = run.finite("speed_rpm")
    return np.interp(at_s, run.time_s[known], run.channel("speed_rpm")[known])
