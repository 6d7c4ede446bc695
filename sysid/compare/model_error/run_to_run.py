"""Effects that every run has in another size, though nothing was changed.

Each run begins at another phase of the clock, with its wheels at other angles, the body in a slightly other
pose and a friction that is never the same twice, so that repeats of a command differ along what some effects
would do: a delay, a turned sensor, a slope. Noise that is taken for white would then let such an effect pass
for new, or, if it is scaled until it no longer does, hide all others. With r a difference of repeats, white
but for that, and c_s what an effect changes in command sequence s, the sum over the sequences and over
independent differences of (c_s . r_s)^2 / |c_s|^2 has a chi-squared distribution with as many degrees of
freedom as it has terms. The effect for which that is least likely varies from run to run; its variance is
found by maximum likelihood (random effects, Laird and Ware, Biometrics 38:963, 1982), and the next one is
looked for beside it, until chance would do as much. Few effects are found in this way, each of which hides
only what differs from a real change in nothing but being different in each sequence.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.linalg import block_diag
from scipy.optimize import minimize_scalar
from scipy.special import gammaln
from scipy.stats import chi2

from mecanum_env.units import FloatArray
from sysid.compare.model_error.marginal import Marginal

_BY_CHANCE: Final = 0.01
"""Probability with which chance alone makes an effect vary, all effects together. Assumed, as the one of a
false alarm is: `sysid.gap.search.thresholds`."""
_MOST: Final = 20
"""Most effects that vary. Assumed: the scatter of a few sequences tells no more."""
_NEGLIGIBLE: Final = 0.3
"""Length of a column, in noise sigmas over all samples, below which nothing depends on it."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """What repeats of some runs differ by, beside what effects would change in them; all is whitened."""

    differences: FloatArray
    """Independent differences of repeats, (N, d); zeros in a sequence that has fewer of them."""
    columns: FloatArray
    """What effects change, (N, q)."""
    run: npt.NDArray[np.intp]
    """Number of the run, or of the mean of repeats, of each value, (N,)."""
    asked: tuple[int, ...]
    """Numbers of the runs whose differences are looked at: one of each command sequence."""
    known: FloatArray
    """Columns (N, k) of what is known to vary, one sigma of each."""

    def beside(self, other: Scatter) -> Scatter:
        """Return this and the scatter of other runs, behind it, along the same effects."""
        most = max(self.differences.shape[1], other.differences.shape[1])
        first = 1 + int(np.max(self.run))
        return Scatter(
            np.concatenate([_padded(one.differences, most) for one in (self, other)]),
            np.concatenate([self.columns, other.columns]),
            np.concatenate([self.run, first + other.run]),
            (*self.asked, *(first + number for number in other.asked)),
            block_diag(self.known, other.known),
        )


def _padded(columns: FloatArray, count: int) -> FloatArray:
    return np.pad(columns, ((0, 0), (0, count - columns.shape[1])))


def run_to_run_columns(scatter: Scatter) -> FloatArray:
    """Return what varies from run to run, one sigma of each: columns (N, p) of one run each."""
    marginal, columns, run = Marginal(scatter.known), scatter.columns, scatter.run
    left, moved = marginal.of(scatter.differences), marginal.of(columns)
    found: list[FloatArray] = []
    every = [np.flatnonzero(run == number) for number in np.unique(run)]
    rows = [np.flatnonzero(run == number) for number in scatter.asked]
    differences = np.array(
        [np.count_nonzero(np.any(scatter.differences[own] != 0.0, axis=0)) for own in rows]
    )
    for _ in range(_MOST):
        lengths = np.array([np.sum(moved[own] ** 2, axis=0) for own in rows])
        scores = np.array([moved[own].T @ left[own] for own in rows])
        shown = lengths > _NEGLIGIBLE**2
        sums = np.sum(scores**2, axis=2)
        squares = np.divide(sums, lengths, out=np.zeros(sums.shape), where=shown)
        by_chance = _log_chance(squares.sum(axis=0), np.maximum(1, differences @ shown))
        best = int(np.argmin(by_chance))
        if by_chance[best] + np.log(max(1, columns.shape[1])) > np.log(_BY_CHANCE):
            break
        sigma = _sigma(squares[:, best], lengths[:, best], differences)
        if sigma == 0.0:
            break
        for own in every:
            column = np.zeros(len(left))
            column[own] = sigma * columns[own, best]
            found.append(column)
        for own, length in zip(rows, lengths[:, best], strict=True):
            if length <= _NEGLIGIBLE**2:
                continue
            # Whitened by the covariance with this column as well.
            axis = moved[own, best] / np.sqrt(length)
            shrink = 1.0 / np.sqrt(1.0 + sigma**2 * length) - 1.0
            left[own] += shrink * np.outer(axis, axis @ left[own])
            moved[own] += shrink * np.outer(axis, axis @ moved[own])
    return np.stack(found, axis=1) if found else np.zeros((len(left), 0))


def _log_chance(square: FloatArray, freedom: FloatArray) -> FloatArray:
    """Return the logarithm of the probability that chi-squared values are at least a `square`.

    Where the probability is too small for a number, it is the first term of its expansion for large squares,
    so that of two effects beyond doubt the less likely one still counts as such.
    """
    with np.errstate(divide="ignore"):
        exact = chi2.logsf(square, freedom)
    half, shape = 0.5 * np.maximum(square, 1e-300), 0.5 * freedom
    beyond = (shape - 1.0) * np.log(half) - half - gammaln(shape)
    return np.asarray(np.where(np.isfinite(exact), exact, beyond))


def _sigma(squares: FloatArray, lengths: FloatArray, differences: npt.NDArray[np.intp]) -> float:
    """Return the standard deviation of a factor by maximum likelihood.

    In each sequence its column has a squared length (`lengths`), (s,), and the squared scores of its
    `differences`, (s,), over that length have a sum (`squares`), (s,).
    """
    used = lengths > _NEGLIGIBLE**2
    squares, lengths, differences = squares[used], lengths[used], differences[used]

    def minus_log(exponent: float) -> float:
        total = 1.0 + np.exp(2.0 * exponent) * lengths
        return float(np.sum(differences * np.log(total) + squares / total))

    size = 0.5 * np.log(np.mean(lengths))
    least = minimize_scalar(minus_log, bounds=(-size - 5.0, -size + 10.0), method="bounded")
    if least.fun >= float(np.sum(squares)):
        return 0.0
    # A variance from n values is on average larger than the most likely one.
    values = int(np.sum(differences))
    few = values / max(1, values - 2)
    return float(np.exp(least.x) * np.sqrt(few))
