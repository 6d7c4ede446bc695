"""The noise of single samples, from what repeats differ by beside a model's prediction of each.

Repeats whose commands were sent at other times differ by more than noise. A prediction knows these times, so
that the residuals of repeats differ by what it cannot know.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.compare.measured import Block
from sysid.compare.noise.correlated import find_correlated
from sysid.compare.noise.estimate import Noise
from sysid.compare.noise.timing import Response, find_timing, is_settled, slope_of


@dataclass(frozen=True, eq=False)
class Deviations:
    """What the residual of each repeat differs by from the others, in one block."""

    block: Block
    values: FloatArray
    """Shape (repeats, m): each scaled to the variance of a single sample."""
    of_runs: FloatArray
    """Standard deviation of these, relative to that of one run, for what moves all samples of a run together,
    shape (repeats, m)."""
    holds: npt.NDArray[np.intp]
    """Number of the command that was held at each value of the block, (m,)."""


def noise_beside_model(noise: Noise, found: Sequence[Deviations]) -> Noise:
    """Return some `noise` with what is known of it beside a model, in the channels of the blocks `found`."""
    sigma, timing, correlated = dict(noise.sigma), dict(noise.timing), dict(noise.correlated)
    names = {one.block.channel for one in found}
    for name in names:
        own = [one for one in found if one.block.channel == name]
        squares = sum(float(np.sum(one.values**2)) for one in own) / sum(one.values.size for one in own)
        correlated.pop(name, None)
        # Of a wheel that repeats itself exactly, nothing is known but what was.
        if squares <= 0.0:
            continue
        sigma[name] = math.sqrt(squares)
        late = find_timing([r for one in own for r in _responses(one)], sigma[name])
        parts = [one.values for one in own]
        if late is not None:
            timing[name] = late
            parts = [np.where(is_settled(_slope(one), late, sigma[name]), one.values, 0.0) for one in own]
        steps = np.concatenate([np.diff(one.block.time_s) for one in own])
        lasting = find_correlated(parts, float(np.median(steps)))
        if lasting is not None:
            correlated[name] = lasting
    uneven = {name: changing for name, changing in noise.uneven.items() if name not in names}
    return replace(noise, sigma=sigma, uneven=uneven, timing=timing, correlated=correlated)


def _responses(one: Deviations) -> Iterator[Response]:
    """Yield the deviations of each repeat in each hold."""
    slope, share = _slope(one), (len(one.values) - 1) / len(one.values)
    for hold in np.unique(one.holds):
        rows = one.holds == hold
        for values, of_run in zip(one.values, one.of_runs, strict=True):
            yield Response(values[rows], slope[rows] * of_run[rows], share)


def _slope(one: Deviations) -> FloatArray:
    return slope_of(one.block.value, one.block.time_s)
