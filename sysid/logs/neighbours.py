"""What a sample differs by from its neighbours while a command is held: noise, since nothing else moves."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.logs.runs import Run

_MEDIAN_OF_FOUR: Final = 0.298  # variance of the median of four normal values of variance 1
OF_MEDIAN: Final = math.sqrt(1.0 + _MEDIAN_OF_FOUR)
"""Standard deviation of a sample's difference from the median of four neighbours, in that of one sample."""

_HELD_S: Final = 0.5
"""Time after a change of command from which neighbours differ by noise only [s]."""
_BEFORE_S: Final = 0.1  # and up to this time before the next one, for stamps are not exact


@dataclass(frozen=True, eq=False)
class Differences:
    """The samples of a channel of a run beside their neighbours."""

    off: FloatArray
    """By how much each differs from the median of the two before and the two after, NaN where that is not
    noise alone, (n,), in the channel's unit."""
    level: FloatArray
    """Size of the median of five samples, (n,), 0 where there is none, in the channel's unit."""


def differences(run: Run, name: str, hidden: FloatArray | None = None) -> Differences:
    """Return by how much the samples of a channel differ from their neighbours while a command is held.

    What rounding has `hidden` (n,) is added to the samples, if it is given.
    """
    off, level = np.full(run.time_s.size, np.nan), np.zeros(run.time_s.size)
    if name not in run.channels:
        return Differences(off, level)
    finite = run.finite(name)
    rows = np.flatnonzero(finite)
    if rows.size >= 5:
        values = np.pad(run.channels[name][rows], 2, mode="edge")
        level[rows] = np.abs(np.median(np.lib.stride_tricks.sliding_window_view(values, 5), axis=1))
    for held in _held(run, finite):
        values = run.channels[name][held]
        if values.size < 5 or np.ptp(values) == 0.0:
            # A constant channel, such as that of a wheel at rest, says nothing about noise.
            continue
        values = values if hidden is None else values + hidden[held]
        off[held[2:-2]] = values[2:-2] - np.median(around(values), axis=0)
    return Differences(off, level)


def steps(run: Run, name: str) -> FloatArray:
    """Return by how much samples of a channel differ from the one before while a command is held, (m,)."""
    if name not in run.channels:
        return np.zeros(0)
    held = (run.channels[name][rows] for rows in _held(run, run.finite(name)))
    return np.concatenate([np.zeros(0), *(np.diff(values) for values in held)])


def around(values: FloatArray) -> FloatArray:
    """Return the two values before and the two after each of `values` (n,) that has them, (4, n - 4)."""
    return np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])


def _held(run: Run, finite: npt.NDArray[np.bool_]) -> Iterator[npt.NDArray[np.intp]]:
    """Yield the rows with a sample of each time in which a command is held."""
    changes = run.time_s[run.command_rows()]
    for start, end in zip(changes, [*changes[1:], math.inf], strict=True):
        inside = (run.time_s >= start + _HELD_S) & (run.time_s < end - _BEFORE_S)
        yield np.flatnonzero(finite & inside)
