"""How much runs differ that begin with the same commands: what no function of the command explains.

A drive that carries a robot meets other loads in other runs, and a bench log does not say which. Runs whose
commands are the same up to some time are compared in that time by the mean of their settled samples. They
need not be repeats: their stamps and lengths may differ.
"""

from __future__ import annotations

import math
from typing import Final, TypeAlias

import numpy as np
from scipy.stats import f as f_distribution

from mecanum_env.units import FloatArray
from sysid.compare.observations import Block, Observations
from sysid.compare.samples import COMMAND_STEP_RPM
from sysid.logs import Run

_SETTLED_S: Final = 0.5
"""Time after a change of command from which a level is compared [s]."""
_SAME_S: Final = 0.1
"""Difference of the times of a change up to which two runs are given the same command [s]."""
_FEWEST_SAMPLES: Final = 10  # of a level
_FEWEST: Final = 6  # degrees of freedom from which levels are said to differ
_LEVEL: Final = 1e-3
"""Probability of such differences by noise alone below which they count."""

_History: TypeAlias = tuple[tuple[int, int], ...]
"""Times and sizes of the commands so far, rounded."""


def level_scatter(observations: Observations, channel: str, sigma: float) -> tuple[float, float]:
    """Return by how much runs of the same commands differ, and for how long they are held.

    The first is a standard deviation in the channel's unit, 0 if white noise of `sigma` may be all of it; the
    second the mean time from the settled motion to the next change [s].
    """
    alike: dict[_History, list[tuple[float, float, float]]] = {}
    for block in observations.blocks:
        if block.channel == channel and block.repeats == 1:
            run = observations.situations[block.situation].runs[0]
            for key, level in _levels(run, block):
                alike.setdefault(key, []).append(level)
    squares = noise = freedom = 0.0
    held = []
    for levels in alike.values():
        if len(levels) < 2:
            continue
        values, variances, durations = np.array(levels).T
        squares += float(np.sum((values - values.mean()) ** 2))
        noise += float(np.mean(variances)) * sigma**2 * (len(levels) - 1)
        freedom += len(levels) - 1
        held.append(float(np.mean(durations)))
    if freedom < _FEWEST or f_distribution.sf(squares / noise, freedom, 1e6) > _LEVEL:
        return 0.0, 0.0
    return math.sqrt((squares - noise) / freedom), float(np.mean(held))


def _levels(run: Run, block: Block) -> list[tuple[_History, tuple[float, float, float]]]:
    """Return for each level the commands so far, and its mean, variance in that of a sample, and time."""
    times, commands = run.command_changes()
    ends: FloatArray = np.append(times[1:], np.inf)
    found = []
    for number, (start, end) in enumerate(zip(times.tolist(), ends.tolist(), strict=True)):
        rows = (block.time_s >= start + _SETTLED_S) & (block.time_s < end)
        if int(np.sum(rows)) < _FEWEST_SAMPLES:
            continue
        key = tuple(
            (round(float(t) / _SAME_S), round(float(c) / COMMAND_STEP_RPM))
            for t, c in zip(times[: number + 1], commands[: number + 1, 0], strict=True)
        )
        weight = block.weight[rows]
        mean = float(np.average(block.value[rows], weights=weight))
        found.append((key, (mean, 1.0 / float(weight.sum()), float(np.ptp(block.time_s[rows])))))
    return found
