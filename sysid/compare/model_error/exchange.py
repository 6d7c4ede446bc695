"""Runs before and after, exchanged: what chance does to a comparison in which nothing changed.

If nothing changed between two sets of logs that drive the same commands, chance alone decided which run of a
command sequence came before and which after. Exchanging them, sequence by sequence, therefore draws from what
chance does, with the noise as it is: steps of an encoder that many samples share, commands that come late now
and then, repeats that happen to agree (a permutation test: Fisher, The Design of Experiments, 1935). What
really changed is in these draws, too, but seldom in its full size: of very many labellings only one is the
true one.

Where run k of a sequence stands in the place of a new one, the residual of a block of values is

    sum over k of a(k) (d(k) + [k is new] r),

with a(k) = 1 / m for the m runs that the block averages, -1 / n for the n runs that stand for those of the
fit, and 0 for others; d(k) is what a run differs by from the mean of its own logs, r the true residual. Where
stamps differ, d(k) is that of samples for new runs, and between samples for those of the fit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.compare.measured import Block, Observations, as_compared
from sysid.compare.model_error.beside import Residuals, series_of
from sysid.compare.model_error.series import Series, mean_of
from sysid.compare.model_error.whitening import Whitener

_ALIKE: Final = 4.0
"""Ratio of the mean squared difference from repeats, of the oddest new run and the oddest of the fit, up to
which what happened in the new runs may have happened in those of the fit. Assumed: twice the size."""


@dataclass(frozen=True, eq=False)
class Place:
    """A block of new logs, and what each run of its command sequence would be in it."""

    group: str
    of_fit: int
    """Number n of runs of the fit, which come first among the K runs of the sequence."""
    taken: tuple[int, ...]
    """Those of the K runs that the block averages."""
    own_samples: FloatArray
    """What each run differs by from the mean of its own logs in its nearest own samples, shape (K, m)."""
    between: FloatArray
    """The same between its samples, where noise is smaller."""

    @property
    def runs(self) -> int:
        """Number K of runs of the sequence."""
        return len(self.between)


@dataclass(frozen=True, eq=False)
class NewBlock:
    """A block of new logs with the runs of the fit that it is beside."""

    block: Block
    residuals: FloatArray
    """What the model errs by in each run that the block averages, shape (runs, m)."""
    of_fit: tuple[Series, ...]
    """The same in the runs of the fit, on the clock of the block."""
    files: tuple[str, ...]
    """Names of the runs of the fit."""
    later_s: float
    """By how much later the first run of the fit was sent the commands [s]."""

    def series(self, later_s: float) -> list[Series]:
        """Return its runs on the clock of a block that the runs of the fit are later than by `later_s`."""
        time_s, weight = self.block.time_s + self.later_s - later_s, self.block.weight / self.block.repeats
        return [Series(time_s, residual, weight) for residual in self.residuals]


def new_block(
    observations: Observations,
    block: Block,
    predicted: FloatArray,
    beside: Sequence[tuple[Residuals, float]],
) -> NewBlock:
    """Return a block of new logs with what the model errs by in each of its runs.

    `predicted` is of the block, (m,); `beside` holds the runs of the fit and how much later each is [s].
    """
    situation = observations.situations[block.situation]
    values = []
    for run in situation.runs:
        value = block.of(as_compared(run.time_s, run.channels))
        values.append(np.where(np.isfinite(value), value, block.value) - predicted)
    of_fit = tuple(series_of(block.channel, beside))
    return NewBlock(block, np.array(values), of_fit, tuple(one.run.file for one, _ in beside), beside[0][1])


def places_of(observations: Observations, blocks: Sequence[NewBlock]) -> tuple[Place, ...]:
    """Return the place of each block of new logs among those of its command sequence.

    There are none where blocks of one sequence are beside different runs of the fit: commands that are nearly
    the same, which cannot be exchanged.
    """
    groups = [observations.situations[one.block.situation].group for one in blocks]
    found = []
    for group, one in zip(groups, blocks, strict=True):
        channel, fitted = one.block.channel, len(one.of_fit)
        alike = [b for g, b in zip(groups, blocks, strict=True) if g == group and b.block.channel == channel]
        if any(other.files != one.files or len(other.of_fit) != fitted for other in alike):
            return ()
        before = sum(len(other.residuals) for other in alike[: alike.index(one)])
        new = [series for other in alike for series in other.series(one.later_s)]
        taken = range(before, before + len(one.residuals))
        weight = one.block.weight / one.block.repeats
        both = [_deviations(runs, one.block.time_s, weight) for runs in (one.of_fit, new)]
        of_fit, of_new = both[0], both[1] - both[1][:, taken].mean(axis=1, keepdims=True)
        own, between = np.concatenate([of_fit, of_new], axis=1)
        found.append(Place(group, fitted, tuple(fitted + k for k in taken), own, between))
    return tuple(found)


def _deviations(runs: Sequence[Series], at: FloatArray, weight: FloatArray) -> FloatArray:
    """Return what each run differs by from the mean of all at some times (m,), shape (2, runs, m).

    The first are those of its nearest own samples, the others between samples. Noise is that of values with
    some `weight` (m,).
    """
    own, between = [], []
    for one in runs:
        near, size = one.nearest(at), np.sqrt(np.interp(at, one.time_s, one.weight) / weight)
        own.append(size * (one.residual[near] - mean_of(runs, one.time_s[near])[0]))
        between.append(size * (np.interp(at, one.time_s, one.residual) - mean_of(runs, at)[0]))
    return np.array([own, between])


class Exchange:
    """All places, whitened: residuals and their projections after exchanges.

    Args:
        whitener: of the new logs.
        places: of their blocks.
        marginal: takes columns (N, p) to those beside what is unknown.
    """

    def __init__(
        self, whitener: Whitener, places: Sequence[Place], marginal: Callable[[FloatArray], FloatArray]
    ) -> None:
        self._places, self._rows = tuple(places), whitener.slices
        zeros = [np.zeros((block.value.size, 0)) for block in whitener.observations.blocks]
        columns = []
        for index, place in enumerate(self._places):
            parts = [np.zeros((len(zero), 2 * place.runs)) for zero in zeros]
            parts[index] = np.concatenate([place.own_samples, place.between]).T
            columns.append(whitener.whiten(parts))
        self._columns: FloatArray = marginal(np.concatenate(columns, axis=1))
        self.labellings = math.prod(
            math.comb(place.runs, place.of_fit)
            for place in {place.group: place for place in self._places}.values()
        )
        """In how many ways the runs can be exchanged."""

    @property
    def alike(self) -> bool:
        """Whether no new run differs from its repeats by much more than runs of the fit do."""
        squares = np.sum(self._columns**2, axis=0)
        new = np.concatenate([np.tile(np.arange(place.runs) >= place.of_fit, 2) for place in self._places])
        return bool(np.max(squares[new], initial=0.0) <= _ALIKE * np.max(squares[~new], initial=0.0))

    def drawn(
        self, rng: np.random.Generator, draws: int, residual: FloatArray, columns: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return projections of draws on columns (N, p), (draws, p), and costs of draws, (draws,).

        `residual` (N,) is the true one.
        """
        shares, of_new = self._draw(rng, draws)
        own = np.zeros((residual.size, len(self._places)))
        for index, rows in enumerate(self._rows):
            own[rows, index] = residual[rows]
        basis = np.concatenate([self._columns, own], axis=1)
        weights = np.concatenate([shares, of_new], axis=1)
        cost = np.einsum("di,ij,dj->d", weights, basis.T @ basis, weights, optimize=True)
        return weights @ (basis.T @ columns), cost

    def _draw(self, rng: np.random.Generator, draws: int) -> tuple[FloatArray, FloatArray]:
        """Return a(k) of all places, (draws, sum of 2 K), and its sums over new runs, (draws, places).

        The a(k) of samples of a place are before those between its samples.
        """
        orders: dict[str, npt.NDArray[np.intp]] = {}
        shares, of_new = [], []
        each = np.arange(draws)[:, None]
        for place in self._places:
            if place.group not in orders:
                orders[place.group] = rng.permuted(np.tile(np.arange(place.runs), (draws, 1)), axis=1)
            order, share = orders[place.group], np.zeros((2, draws, place.runs))
            share[0, each, order[:, list(place.taken)]] = 1.0 / len(place.taken)
            share[1, each, order[:, : place.of_fit]] = -1.0 / place.of_fit
            shares += [share[0], share[1]]
            of_new.append(share[:, :, place.of_fit :].sum(axis=(0, 2)))
        return np.concatenate(shares, axis=1), np.stack(of_new, axis=1)
