"""How many poles the data ask for: lower-order laws, and when one of them does as well.

Where a second-order law explains the data as well as a third-order one, the third pole may lie anywhere as
long as a zero cancels it. The least-squares third-order law then follows the noise: it may ring at a
frequency that the samples never show. The lower order is the honest answer, and its coefficients have honest
intervals.
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
"""What an order estimates; the others are 0. With unit gain E follows from the rest."""

_FEW: Final = 30
"""Degrees of freedom below which the noise given is trusted over a smaller one seen."""
_START_POLES: Final = (0.5, 0.9)


@dataclass(frozen=True, eq=False)
class LowerOrder:
    """The best law of an order below three."""

    order: int
    coefficients: FloatArray
    """A-F, shape (6,), stable; of unit gain if asked for."""
    cost: float
    """As in `Estimate`: half the weighted square sum, repeats included."""


def lower_order(
    problem: LawProblem, traces: Traces, order: int, *, unit_gain: bool, gain: float = 1.0
) -> LowerOrder:
    """Fit a first- or second-order law (`order`) by output error.

    The DC gain is 1 with `unit_gain`, else free and starting at `gain`.
    """

    def law(x: FloatArray) -> FloatArray:
        abc = stable_abc([*x[:order], *([0.0] * (3 - order))])
        abc[order:] = 0.0  # not -0.0
        d = float(x[order])
        e = 1.0 - (float(np.sum(abc)) + d) if unit_gain else float(x[order + 1])
        return np.array([*abc, d, e, 0.0])

    def residual(x: FloatArray) -> FloatArray:
        return np.asarray((problem.predict(law(x), traces) - problem.speed_rpm) * problem.weight)

    best: LowerOrder | None = None
    for pole in _START_POLES:
        half = 0.5 * gain * (1.0 - pole)
        start = [*free_coordinates([pole, 0.0, 0.0])[:order], *([half] if unit_gain else [half, half])]
        found = least_squares(residual, start, ftol=1e-10, xtol=1e-10, max_nfev=100)
        cost = float(found.cost) + problem.within_cost
        if best is None or cost < best.cost:
            best = LowerOrder(order, law(found.x), cost)
    assert best is not None
    return best


def noise_variance(cost: float, samples: float, parameters: int) -> float:
    """Return the residual variance over the given one; at least 1 where few `samples` make it unsure.

    `cost` is half the weighted square sum; each of the `parameters` takes a degree of freedom.
    """
    freedom = samples - parameters
    if freedom <= 0:
        return math.inf
    variance = 2.0 * cost / freedom
    return max(variance, 1.0) if freedom < _FEW else max(variance, 1e-300)


def noise_gain(samples: int) -> float:
    """Return how much noise alone lets one more pole and zero lower the square sum over the noise variance.

    A pole-zero pair that may lie anywhere picks the largest of about N = `samples` independent noise terms,
    each of two degrees of freedom: 2 log N (an extreme value, as for a periodogram's peak); 6 more make it a
    5 % event.
    """
    return 2.0 * math.log(samples) + 6.0


def correlated_share(residual: FloatArray) -> float:
    """Return by how much the residuals' autocorrelation overstates their number, >= 1, for samples in order.

    1 + 2 (rho_1 + rho_2 + ...) up to the first negative one (Geyer's initial positive sequence): 1 for noise,
    large where the law misses something slow, and a test that counted every sample would find it anywhere.
    """
    power = float(residual @ residual)
    total, longest = 1.0, min(200, len(residual) // 4)
    for lag in range(1, longest + 1):
        rho = float(residual[lag:] @ residual[:-lag]) / power if power > 0.0 else 0.0
        # Half the lags of white residuals are positive by chance; only what is beyond it counts.
        if rho * math.sqrt(len(residual)) < 2.0:
            break
        total += 2.0 * rho
    return total
