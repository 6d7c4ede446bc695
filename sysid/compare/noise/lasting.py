"""Noise that lasts as long as a command is held: the same command does not give the same speed each time.

Neighbouring samples cannot tell it, and where no command sequence was repeated nothing else measures it. A
study would then take every difference between two holds for something that an effect must explain. It shows
in what the best fit leaves: if the early and the late part of a hold are off alike, hold by hold, the mean of
the products of the two is the variance of an offset of each hold. Noise that is shorter than a hold has no
part in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import WHEEL_SPEEDS
from mecanum_env.units import FloatArray
from sysid.compare.measured import Block, Observations
from sysid.compare.noise.estimate import Noise
from sysid.logs.checks import SETTLED_S

_FEWEST_HOLDS: Final = 6
"""Holds from which an offset that differs between them is estimated. Assumed."""
_FEWEST_VALUES: Final = 3  # in the early and in the late part of a hold
_SIGMAS: Final = 2.33
"""Standard errors by which the mean product must exceed 0: chance does so in 1 of 100 cases."""


def holds_of(observations: Observations, block: Block) -> npt.NDArray[np.intp]:
    """Return for each value of a block the number of the command that was held then, shape (m,)."""
    times = observations.situations[block.situation].runs[0].command_changes()[0]
    return np.searchsorted(times, block.time_s, side="right")


def with_lasting(
    noise: Noise, observations: Observations, before: Sequence[FloatArray], after: Sequence[FloatArray]
) -> Noise:
    """Return the noise with the offsets of holds that residuals show, where no repeats tell of it.

    The residuals `before` anything was added to the model and `after`, with the best set of effects, are one
    array (m,) for each block, in the channel's unit. The smaller offset counts, each beside a smooth function
    of the command.
    """
    found = dict(noise.lasting)
    for name, source in noise.source.items():
        if source == "repeats":
            continue
        sizes = [_offset(_holds(observations, name, parts)) for parts in (before, after)]
        if min(sizes) > 0.0:
            found[name] = min(sizes)
    return replace(noise, lasting=found)


def _offset(holds: FloatArray) -> float:
    """Return the standard deviation of an offset of each of the `holds` of `_holds`; 0 if there is none."""
    command, halves = holds[:, 0], holds[:, 1:]
    top = float(np.max(np.abs(command), initial=1e-9))
    smooth = np.stack(
        [np.sign(command), command / top, command * np.abs(command) / top**2, np.abs(command) / top]
    )
    freedom = len(holds) - len(smooth)
    if freedom < _FEWEST_HOLDS:
        return 0.0
    rest = halves - smooth.T @ np.linalg.lstsq(smooth.T, halves, rcond=None)[0]
    products = rest[:, 0] * rest[:, 1]
    mean, error = float(np.mean(products)), float(np.std(products)) / math.sqrt(products.size)
    return math.sqrt(mean * products.size / freedom) if mean > _SIGMAS * error else 0.0


def _holds(observations: Observations, channel: str, parts: Sequence[FloatArray]) -> FloatArray:
    """Return each hold's command and its mean residuals early and late in its settled part, (h, 3)."""
    found = []
    for block, part in zip(observations.blocks, parts, strict=True):
        if block.channel != channel:
            continue
        times, commands = observations.situations[block.situation].runs[0].command_changes()
        holds = holds_of(observations, block)
        wheel = WHEEL_SPEEDS.index(channel) if channel in WHEEL_SPEEDS else 0
        for hold in np.unique(holds):
            own = max(0, int(hold) - 1)
            rows = np.flatnonzero((holds == hold) & (block.time_s >= times[own] + SETTLED_S))
            if rows.size < 2 * _FEWEST_VALUES or np.ptp(block.value[rows]) == 0.0:
                # A wheel at rest says nothing about one that turns.
                continue
            early, late = np.array_split(rows, 2)
            found.append((commands[own, wheel], _mean(part, block, early), _mean(part, block, late)))
    return np.array(found).reshape(-1, 3)


def _mean(part: FloatArray, block: Block, rows: npt.NDArray[np.intp]) -> float:
    return float(np.average(part[rows], weights=block.weight[rows]))
