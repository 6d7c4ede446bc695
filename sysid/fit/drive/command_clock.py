"""The clock on which commands were given, from a log that shows each of them in the first row after it.

A row says that its command was given after the row before. If a program sends commands every P seconds, each
of these intervals holds a multiple of P, and for a wrong P some do not. The longest P that all intervals
allow is the clock, unless chance explains it, as where rows are about as far apart as commands.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.logs import Run

_EARLY_S: Final = 1e-6
"""By how much stamps may be early [s]: they are rounded."""
_SAME_S: Final = 1e-7
"""Least time [s] from a row to a command that the row does not show."""
_LONGEST_S: Final = 0.105
"""Longest period that is tried [s]: longer ones are those of a plan, not of a link."""
SHORTEST: Final = 1.1
"""Shortest period that is tried, in rows: a shorter one is in every interval."""
_CHANCE: Final = 0.005
"""Probability that some period as round as the one found agrees by chance, above which none is taken."""
_FINE: Final = 0.4
"""Step between the periods that are tried: the last interval's multiple moves by this share of a row."""
_CONTRARY: Final = 0.01
"""Share of the changes that may contradict a period: rounded stamps and late rows do."""
_MOST_PERIODS: Final = 20_000
_ROUND_S: Final = (5e-3, 1e-3, 1e-4, 1e-5, 1e-6)
"""Numbers [s] of which a period may be a multiple; the first possible one is taken."""


def command_clock_s(runs: Sequence[Run]) -> float | None:
    """Return the period [s] of the clock that starts with each run and on which all commands changed.

    None if there is none, or if it is not longer than the time between rows.
    """
    early, late = _intervals(runs)
    if early.size == 0:
        return None
    row = float(np.median(late - early))
    # The first changes tell which periods are possible at all, all of them which one it is.
    order = np.argsort(late)
    early, late = early[order], late[order]
    share = _FINE * row / max(float(late[-1]), row)
    count = math.log(_LONGEST_S / (SHORTEST * row)) / share if SHORTEST * row < _LONGEST_S else 0.0
    if not 1.0 <= count <= _MOST_PERIODS:
        return None
    possible = SHORTEST * row * np.exp(share * np.arange(math.ceil(count)))
    contrary = np.zeros(possible.size)
    for low, high in zip(early, late, strict=True):
        contrary += ~_holds_multiple(possible, low - share * high, high + share * high)
    possible = possible[contrary <= _CONTRARY * early.size]
    for period in possible[::-1]:
        ends = _narrowed(float(period), early, late)
        if ends is None:
            continue
        # Rounded stamps may have moved the ends.
        found, step = _roundest(ends[0] - _EARLY_S, ends[1] + _EARLY_S)
        holds = [bool(_holds_multiple(np.array(found), *at)) for at in zip(early, late, strict=True)]
        agrees = np.mean(holds) >= 1.0 - _CONTRARY
        if agrees and _by_chance(found, early, late) * min(count, _LONGEST_S / step) < _CHANCE:
            return found
    return None


def _intervals(runs: Sequence[Run]) -> tuple[FloatArray, FloatArray]:
    """Return the times [s] between which commands changed, without those that say the same, each (m,)."""
    found: dict[tuple[int, int], tuple[float, float]] = {}
    for run in runs:
        rows = run.command_rows()[1:]
        after, by = run.given_between()
        for low, high in zip(after[rows], by[rows], strict=True):
            found[round(low * 1e4), round(high * 1e4)] = (float(low) + _SAME_S, float(high) + _EARLY_S)
    ends = np.array(list(found.values()), float).reshape(-1, 2)
    return ends[:, 0], ends[:, 1]


def _holds_multiple(period_s: FloatArray, low: float, high: float) -> npt.NDArray[np.bool_]:
    return np.floor(high / period_s) * period_s > low


def _narrowed(period_s: float, early: FloatArray, late: FloatArray) -> tuple[float, float] | None:
    """Return the ends of the periods near one of which the intervals hold a multiple; None for none."""
    least, most, left = 0.0, math.inf, _CONTRARY * early.size
    for low, high in zip(early, late, strict=True):
        number = max(1, round(0.5 * (low + high) / min(max(period_s, least), most)))
        if high / number <= least or low / number >= most:
            left -= 1.0
            if left < 0.0:
                return None
            continue
        least, most = max(least, low / number), min(most, high / number)
    return least, most


def _roundest(least: float, most: float) -> tuple[float, float]:
    """Return the roundest number between two, and what it is a multiple of."""
    for step in _ROUND_S:
        number = round(0.5 * (least + most) / step)
        if least < number * step < most:
            # Through text, as 5 * 0.001 is not 0.005.
            return float(f"{number * step:.6f}"), step
    return 0.5 * (least + most), _ROUND_S[-1]


def _by_chance(period_s: float, early: FloatArray, late: FloatArray) -> float:
    """Return the probability that commands at any times change in intervals with a multiple of a period."""
    # Repeats of a sequence change at the same times, so changes at the same multiple count once.
    numbers = np.round(0.5 * (early + late) / period_s)
    widths = [float(np.median((late - early)[numbers == n])) for n in np.unique(numbers)]
    return float(np.prod(np.minimum(1.0, np.array(widths) / period_s)))
