"""The main result of a certificate: the warning that a controller needs to succeed nine times out of ten.

The probability of success as a function of the warning time is estimated by local-linear logistic regression
(J. Fan, N. E. Heckman and M. P. Wand, "Local polynomial kernel regression for generalized linear models and
quasi-likelihood functions", JASA 90, 1995): at each warning time a logistic curve is fitted to the episodes
around it. If the truth is logistic the estimate is unbiased. Unlike a logistic curve or isotonic regression
it may fall again: a controller that moves too early is hit by a late strike. Intervals are from the bootstrap
over episodes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from training.evaluate.metrics import CONFIDENCE, Share, share

TARGET: Final = 0.9
"""Required probability of success."""
RANGE_S: Final = (0.2, 0.9)
"""Range of the warning times that are played [s]: from half of the shortest to one and a half times the
longest published of kendo's fast attacks (0.44 to 0.58 s)."""
_BANDWIDTH_S: Final = 0.05
"""Standard deviation of the Gaussian kernel [s]."""
_GRID_S: Final = 0.01
_BINS: Final = 7
_RESAMPLES: Final = 400
_PRIOR: Final = np.array([5.0, 4.0])
"""Standard deviations of normal priors of the logit and of its change over one bandwidth. They keep the fit
finite if all episodes around succeed, and are far wider than what binary data can distinguish."""
_LONGEST_STEP: Final = 2.0
"""Largest Newton step of either coefficient."""


@dataclass(frozen=True)
class Bin:
    """Counted successes of the episodes in an interval of warning times."""

    from_s: float
    to_s: float
    success: Share


@dataclass(frozen=True)
class WarningCurve:
    """Success against warning time."""

    target: float
    """Required probability of success."""
    needed_s: float | None
    """Shortest warning at which the curve reaches the target [s]; None: not within the range."""
    low_s: float | None
    """Lower end of its interval [s]; None: beyond the range."""
    high_s: float | None
    """Upper end [s]; None: beyond the range."""
    holds_to_s: float | None
    """Warning beyond which the curve falls below the target again [s]; None: it does not."""
    range_s: tuple[float, float]
    """Shortest and longest warning played [s]."""
    episodes: int
    warning_s: tuple[float, ...]
    """Grid of the curve [s]."""
    success: tuple[float, ...]
    """Probability of success at each point of the grid."""
    low: tuple[float, ...]
    """Lower end of its pointwise interval."""
    high: tuple[float, ...]
    """Upper end of its pointwise interval."""
    bins: tuple[Bin, ...]


def warning_curve(
    warning_s: npt.ArrayLike,
    success: npt.ArrayLike,
    *,
    target: float = TARGET,
    seed: int = 0,
    resamples: int = _RESAMPLES,
) -> WarningCurve:
    """Return success against warning time, with the warning needed to reach the target.

    Args:
        warning_s: warning time of each episode [s], shape (n,).
        success: whether each episode is a success, shape (n,).
        target: required probability of success.
        seed: of the bootstrap.
        resamples: number of bootstrap resamples.

    Raises:
        InputError: there are no episodes, or the target is not between 0 and 1.
    """
    times, won = np.asarray(warning_s, float), np.asarray(success, float)
    if times.size == 0 or not 0.0 < target < 1.0:
        raise InputError(
            f"episodes = {times.size}, target = {target}: must be at least 1, and between 0 and 1"
        )
    count = round((RANGE_S[1] - RANGE_S[0]) / _GRID_S) + 1
    grid = np.linspace(*RANGE_S, count)
    fit = _fitted(grid, times, won, np.ones(times.size), np.zeros((count, 2)), steps=30)
    curve = _probability(fit)
    rng = np.random.default_rng(seed)
    curves, needed = np.empty((resamples, count)), np.empty(resamples)
    for i in range(resamples):
        weights = np.bincount(rng.integers(0, times.size, times.size), minlength=times.size).astype(float)
        curves[i] = _probability(_fitted(grid, times, won, weights, fit, steps=6))
        needed[i] = _crossing(grid, curves[i], target)
    tail = 50.0 * (1.0 - CONFIDENCE)
    ends = [tail, 100.0 - tail]
    low, high = np.percentile(curves, ends, axis=0)
    # Without interpolation: some of the values may be infinite.
    first, last = np.percentile(needed, ends, method="nearest")
    found = _crossing(grid, curve, target)
    below = np.flatnonzero((curve < target) & (grid > found))
    return WarningCurve(
        target=target,
        needed_s=_finite(found),
        low_s=_finite(first),
        high_s=_finite(last),
        holds_to_s=float(grid[below[0] - 1]) if below.size else None,
        range_s=RANGE_S,
        episodes=int(times.size),
        warning_s=_short(grid),
        success=_short(curve),
        low=_short(low),
        high=_short(high),
        bins=_bins(times, won),
    )


def _fitted(
    grid: FloatArray,
    times: FloatArray,
    won: FloatArray,
    weights: FloatArray,
    start: FloatArray,
    steps: int,
) -> FloatArray:
    """Return logit and its slope per bandwidth at each point of the grid, (g, 2), by Newton's method."""
    u = (times[None] - grid[:, None]) / _BANDWIDTH_S
    kernel, precision = weights * np.exp(-0.5 * u * u), 1.0 / _PRIOR**2
    fit = start.copy()
    for _ in range(steps):
        p = 1.0 / (1.0 + np.exp(-(fit[:, :1] + fit[:, 1:] * u)))
        misfit, spread = kernel * (won - p), kernel * p * (1.0 - p)
        slope_a = misfit.sum(axis=1) - precision[0] * fit[:, 0]
        slope_b = (misfit * u).sum(axis=1) - precision[1] * fit[:, 1]
        aa = spread.sum(axis=1) + precision[0]
        ab = (spread * u).sum(axis=1)
        bb = (spread * u * u).sum(axis=1) + precision[1]
        step = np.stack([bb * slope_a - ab * slope_b, aa * slope_b - ab * slope_a], axis=1)
        step /= (aa * bb - ab * ab)[:, None]
        fit += np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
    return fit


def _probability(fit: FloatArray) -> FloatArray:
    return np.asarray(1.0 / (1.0 + np.exp(-fit[:, 0])), float)


def _crossing(grid: FloatArray, curve: FloatArray, target: float) -> float:
    """Return the first point at which a curve reaches the target; infinity if it does not."""
    above = np.flatnonzero(curve >= target)
    if above.size == 0:
        return np.inf
    i = int(above[0])
    return float(np.interp(target, curve[i - 1 : i + 1], grid[i - 1 : i + 1]) if i else grid[0])


def _bins(times: FloatArray, won: FloatArray) -> tuple[Bin, ...]:
    edges = np.linspace(*RANGE_S, _BINS + 1)
    which = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, _BINS - 1)
    return tuple(
        Bin(float(edges[i]), float(edges[i + 1]), share(int(won[which == i].sum()), int(np.sum(which == i))))
        for i in np.unique(which)
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _short(values: FloatArray) -> tuple[float, ...]:
    # Five digits are enough for a plotted curve.
    return tuple(round(float(value), 5) for value in values)
