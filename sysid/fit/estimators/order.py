"""How many poles the data support: laws of lower order, and when one of them explains the data as well.

If a second-order law explains the data as well as a third-order one, the third pole may lie anywhere as long
as a zero cancels it. The least-squares third-order law then fits the noise: it may ring at a frequency that
the samples never show. The law of lower order is preferred, and the intervals of its coefficients are
realistic.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.law.stability import free_coordinates, stable_abc
from mecanum_env.units import FloatArray
from sysid.fit.estimators.problem import LawProblem, Traces

FREE_BY_ORDER: Final = {1: ("A", "D", "E"), 2: ("A", "B", "D", "E"), 3: ("A", "B", "C", "D", "E", "F")}
"""Coefficients that a law of each order has; the others are 0. With unit gain, E follows from the rest."""

_FEW: Final = 30  # degrees of freedom below which the stated noise is preferred to a smaller residual
_START_POLES: Final = (0.5, 0.9)


@dataclass(frozen=True, eq=False)
class FittedOrder:
    """The best law of one order."""

    order: int
    coefficients: FloatArray
    """A-F, shape (6,), stable; of unit gain if requested."""
    cost: float
    """As in `Estimate`: half the weighted sum of squares, including that of repeats about their mean."""


def lower_order(
    problem: LawProblem, traces: Traces, order: int, *, unit_gain: bool, gain: float = 1.0
) -> FittedOrder:
    """Fit a first- or second-order law (`order`) by output error.

    The DC gain is 1 with `unit_gain`; otherwise it is free and starts at `gain`.
    """

    def law(x: FloatArray) -> FloatArray:
        abc = stable_abc([*x[:order], *([0.0] * (3 - order))])
        abc[order:] = 0.0  # not -0.0
        d = float(x[order])
        e = 1.0 - (float(np.sum(abc)) + d) if unit_gain else float(x[order + 1])
        return np.array([*abc, d, e, 0.0])

    found = []
    for pole in _START_POLES:
        half = 0.5 * gain * (1.0 - pole)
        start = [*free_coordinates([pole, 0.0, 0.0])[:order], *([half] if unit_gain else [half, half])]
        reached = least_squares(
            lambda x: problem.residual(law(x), traces), start, ftol=1e-10, xtol=1e-10, max_nfev=100
        )
        found.append(FittedOrder(order, law(reached.x), float(reached.cost) + problem.within_cost))
    return min(found, key=lambda one: one.cost)


def simplest_law(problem: LawProblem, traces: Traces, third: FittedOrder, *, unit_gain: bool) -> FittedOrder:
    """Return the law of lowest order that explains the data as well as the next order does.

    `third` is the best third-order law, with DC gain 1 if `unit_gain`.
    """
    c, samples = third.coefficients, len(problem.group)
    gain = 1.0 if unit_gain else float(np.sum(c[3:]) / (1.0 - np.sum(c[:3])))
    correlated = _correlation_factor(problem.measured_rpm - problem.predict(c, traces)[problem.group])
    best = third
    for order in (2, 1):
        lower = lower_order(problem, traces, order, unit_gain=unit_gain, gain=gain)
        variance = noise_variance(best.cost, samples, 2 * best.order - unit_gain)
        if 2.0 * (lower.cost - best.cost) > noise_gain(samples) * variance * correlated:
            break
        best = lower
    return best


def noise_variance(cost: float, samples: float, parameters: int) -> float:
    """Return the residual variance relative to the stated one, at least 1 if the `samples` are few.

    `cost` is half the weighted sum of squares; each of the `parameters` takes one degree of freedom.
    """
    freedom = samples - parameters
    if freedom <= 0:
        return math.inf
    variance = 2.0 * cost / freedom
    return max(variance, 1.0) if freedom < _FEW else max(variance, 1e-300)


def noise_gain(samples: int) -> float:
    """Return how much one more pole and zero lower the sum of squares, in noise variances, by fitting noise.

    A pole-zero pair that may lie anywhere selects the largest of about N = `samples` independent noise terms
    of two degrees of freedom each: 2 log N (an extreme value, as for a periodogram's peak). The 6 on top
    makes exceeding the result a 5 % event.
    """
    return 2.0 * math.log(samples) + 6.0


def _correlation_factor(residual: FloatArray) -> float:
    """Return the number of residuals per independent one, >= 1, from their autocorrelation in time order.

    1 + 2 (rho_1 + rho_2 + ...) up to the first insignificant one (after Geyer's initial positive sequence): 1
    for white noise, and large if the law misses something slow, which would make any test of all samples
    fail.
    """
    power = float(residual @ residual)
    total, longest = 1.0, min(200, len(residual) // 4)
    for lag in range(1, longest + 1):
        rho = float(residual[lag:] @ residual[:-lag]) / power if power > 0.0 else 0.0
        # Half of the lags of white residuals are positive by chance; only larger ones count.
        if rho * math.sqrt(len(residual)) < 2.0:
            break
        total += 2.0 * rho
    return total
