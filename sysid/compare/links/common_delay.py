"""The common delay of a link and its spread, from how likely each delay of each change is.

The delay of change i is d(i) = m + s e(i), with the link's common delay m, its spread s and e(i) of Student's
t, which allows for a change that is very late. m and s maximise the likelihood of the logs with the delays
integrated out (empirical Bayes; Robbins, Proc. 3rd Berkeley Symp. 1:157, 1956), and each delay is then the
mean of its posterior.

Throughout, `likelihood` has the logarithm of the likelihood of each change (rows) at each delay of `GRID_S`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

import numpy as np

from mecanum_env.statistics import VERY_STRONG
from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, STEP_S, Change
from sysid.compare.measured import COMMAND_STEP_RPM

TAIL: Final = 4.0
"""Degrees of freedom of Student's t as which delays and errors are counted: a few outliers decide nothing.
Assumed."""
FEWEST: Final = 6
"""Changes that show a spread, at least."""
EVIDENCE: Final = VERY_STRONG
"""Twice the logarithm of a likelihood ratio, beyond the price of the parameters, that counts."""
_SPREADS_S: Final = (0.0, *np.geomspace(0.001, 0.2, 24).tolist())


@dataclass(frozen=True)
class CommonDelay:
    """What the delays of a link have in common."""

    mean_s: float
    """Common delay [s]."""
    spread_s: float
    """Scale of the delays' Student's t around it [s]."""

    @classmethod
    def of(cls, likelihood: FloatArray) -> CommonDelay:
        """Return the common delay and the spread of greatest `likelihood`."""
        if not len(likelihood):
            return cls(0.0, 0.0)
        tried = zip(_marginal(likelihood, _SPREADS_S), _SPREADS_S, strict=True)
        best, spread = max(tried, key=lambda pair: float(pair[0].max()))
        return cls(float(GRID_S[int(np.argmax(best))]), spread)

    def log_likelihood(self, likelihood: FloatArray) -> float:
        """Return the logarithm of the likelihood of all changes, given that of each at each delay."""
        total = _marginal(likelihood, [self.spread_s])[0]
        return float(total[round(self.mean_s / STEP_S)])

    def weights(self, likelihood: FloatArray) -> FloatArray:
        """Return the probability of each delay of the grid (columns) for each change, by its `likelihood`."""
        with np.errstate(divide="ignore"):
            weight = likelihood + np.log(_prior(self.spread_s)[round(self.mean_s / STEP_S)])
        weight = np.exp(weight - weight.max(axis=1, keepdims=True))
        return np.asarray(weight / weight.sum(axis=1, keepdims=True))

    def posterior_s(self, likelihood: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the mean and the standard deviation of each change's delay [s], given its `likelihood`."""
        weight = self.weights(likelihood)
        mean = weight @ GRID_S
        return mean, np.sqrt(np.maximum(weight @ GRID_S**2 - mean**2, 0.0))


def evidence(likelihood: FloatArray) -> float:
    """Return twice the log `likelihood` ratio of a spread to none, less the price of a parameter."""
    if len(likelihood) < FEWEST:
        return 0.0
    without, *with_spread = (float(total.max()) for total in _marginal(likelihood, _SPREADS_S))
    return 2.0 * (max(with_spread) - without) - math.log(len(likelihood))


@lru_cache(maxsize=64)
def student_weights(scale_s: float) -> FloatArray:
    """Return the probability of each delay of the grid (columns) for each common delay (rows).

    Delays are of Student's t with this scale [s], so that one change that is very late does not make the
    spread of all.
    """
    square = ((GRID_S[:, None] - GRID_S[None, :]) / max(scale_s, 0.5 * STEP_S)) ** 2
    weight = (1.0 + square / TAIL) ** (-0.5 * (TAIL + 1.0))
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))


def _prior(spread_s: float) -> FloatArray:
    return np.eye(GRID_S.size) if spread_s == 0.0 else student_weights(spread_s)


def _marginal(likelihood: FloatArray, spreads_s: Sequence[float]) -> list[FloatArray]:
    """Return the logarithm of the likelihood of all changes for each common delay, for each spread."""
    top = likelihood.max(axis=1, keepdims=True)
    scaled = np.exp(likelihood - top)
    together = (scaled @ _prior(spread).T for spread in spreads_s)
    return [np.asarray((np.log(np.maximum(one, 1e-300)) + top).sum(axis=0)) for one in together]


def without_trend(likelihood: FloatArray, changes: Sequence[Change]) -> FloatArray:
    """Return the `likelihood` without what delays owe to size, direction and end of their `changes`.

    Such delays are no jitter: a limit, friction or play delays large or small changes more.
    """
    if len(changes) < FEWEST:
        return likelihood
    common = CommonDelay.of(likelihood)
    mean, error = common.posterior_s(likelihood)
    before = np.array([change.before_rpm for change in changes])
    after = np.array([change.after_rpm for change in changes])
    size = np.abs(after - before)
    kinds = np.column_stack(
        [
            np.ones(size.size),
            size / max(float(size.max()), 1e-9),
            np.abs(after) < np.abs(before),
            np.abs(before) <= COMMAND_STEP_RPM,
            before * after < 0.0,
            after > before,
        ]
    ).astype(float)
    weight = 1.0 / np.maximum(np.hypot(error, common.spread_s), STEP_S)
    slopes = np.linalg.lstsq(kinds * weight[:, None], mean * weight, rcond=None)[0]
    trend = kinds @ slopes
    trend -= np.average(trend, weights=weight**2)
    return np.array(
        [np.interp(GRID_S + off, GRID_S, row) for off, row in zip(trend, likelihood, strict=True)]
    )
