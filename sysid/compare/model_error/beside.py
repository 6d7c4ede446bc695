"""New runs beside those runs of the logs of a fit that were sent the same commands."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import helmert

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from sysid.compare.measured import Block, Observations, observe
from sysid.compare.model_error.series import Series, mean_of
from sysid.compare.noise import Deviations, holds_of
from sysid.logs import Dataset, Run


@dataclass(frozen=True, eq=False)
class Residuals:
    """What the model errs by in one run of the logs of the fit."""

    run: Run
    blocks: dict[str, tuple[Block, FloatArray]]
    """Channel -> block and residual, (m,)."""


def residuals_of(
    dataset: Dataset, observations: Observations, predicted: Sequence[FloatArray]
) -> Iterator[Residuals]:
    """Yield the residual of each run, of which the `predicted` blocks are given for the mean of repeats."""
    known = {
        (block.situation, block.channel): (block.time_s, part)
        for block, part in zip(observations.blocks, predicted, strict=True)
    }
    for index, situation in enumerate(observations.situations):
        for run in situation.runs:
            try:
                blocks = observe(replace(dataset, runs=(run,))).blocks
            except InputError:
                # Its repeats have measured samples, but it has none.
                continue
            yield Residuals(
                run,
                {b.channel: (b, b.value - np.interp(b.time_s, *known[index, b.channel])) for b in blocks},
            )


def series_of(channel: str, beside: Sequence[tuple[Residuals, float]]) -> list[Series]:
    """Return the residuals of a channel on the clock of a run that each is so much later than [s]."""
    return [
        Series(block.time_s - shift, residual, block.weight)
        for block, residual, shift in (
            (*one.blocks[channel], shift) for one, shift in beside if channel in one.blocks
        )
    ]


@dataclass(frozen=True, eq=False)
class Beside:
    """A block of new logs beside the runs of the fit with the same commands."""

    block: Block
    """With the weights of the difference."""
    error: FloatArray
    """Mean residual of the runs of the fit, (m,)."""
    deviations: FloatArray
    """What each of them differs by from the others, with the variance of a single sample, shape (repeats, m);
    without rows if there is but one."""
    of_runs: FloatArray
    """Standard deviation of these, relative to that of one run, for what moves all samples of a run together,
    shape (repeats, m)."""

    @classmethod
    def of(cls, block: Block, beside: Sequence[tuple[Residuals, float]], alike: int) -> Beside | None:
        """Return a `block` of a new run beside some residuals; None if none of them has its channel.

        Each residual is so much later [s]. So many runs (`alike`) are compared with the same residuals, whose
        error then counts once in all.
        """
        found = series_of(block.channel, beside)
        if not found:
            return None
        error, weight = mean_of(found, block.time_s)
        # The noise is that of the logs of the fit, where it may have been found to grow with the speed.
        single = np.mean([np.interp(block.time_s, one.time_s, one.weight) for one in found], axis=0)
        variance = 1.0 / np.minimum(block.weight, block.repeats * single) + alike / weight
        compared = replace(block, weight=1.0 / variance, reference_repeats=len(found) / alike)
        deviations, of_runs = [], []
        for one in found if len(found) > 1 else ():
            # Its own samples, as those of a new run are: between samples noise is smaller.
            near = one.nearest(block.time_s)
            others, weight = mean_of([other for other in found if other is not one], one.time_s[near])
            apart = 1.0 / one.weight[near] + 1.0 / weight
            deviations.append((one.residual[near] - others) / np.sqrt(apart))
            of_runs.append(np.sqrt((1.0 + 1.0 / (len(found) - 1)) / apart))
        shape = len(deviations), block.value.size
        return cls(compared, error, np.reshape(deviations, shape), np.reshape(of_runs, shape))

    def noted(self, observations: Observations) -> Deviations:
        """Return the deviations with the hold of each value; the block is one of the `observations`."""
        return Deviations(self.block, self.deviations, self.of_runs, holds_of(observations, self.block))

    def contrast(self, number: int) -> FloatArray:
        """Return one of the independent contrasts of r repeats, r - 1 of them, (m,), with the same variance.

        The deviations of repeats have the sum 0, so that each tells a part of what the others do. ``number``
        counts contrasts from 0; beyond the last one there are zeros.
        """
        repeats = len(self.deviations)
        if number >= repeats - 1:
            return np.zeros(self.block.value.size)
        weights = helmert(repeats)[number] * np.sqrt(1.0 - 1.0 / repeats)
        return np.asarray(weights @ self.deviations / np.sqrt(self.block.weight))

    def scatter(self, repeat: int) -> FloatArray:
        """Return the deviations of a repeat with the variance of the difference of both logs, (m,)."""
        return np.asarray(self.deviations[repeat % len(self.deviations)] / np.sqrt(self.block.weight))


def scatters_of(pairs: Sequence[Beside]) -> list[tuple[FloatArray, ...]]:
    """Return what repeats differ by, (m,) for each block, once for each repeat; none without repeats."""
    counts = [len(pair.deviations) for pair in pairs]
    if not all(counts):
        return []
    return [tuple(pair.scatter(k) for pair in pairs) for k in range(max(counts))]


def contrasts_of(pairs: Sequence[Beside]) -> list[tuple[FloatArray, ...]]:
    """Return independent contrasts of repeats, (m,) for each block; zeros where a block has fewer repeats."""
    most = max((len(pair.deviations) for pair in pairs), default=0)
    return [tuple(pair.contrast(number) for pair in pairs) for number in range(most - 1)]
