"""Variable projection: D, E and F are solved for, which leaves a search in three pole coordinates.

G. H. Golub and V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate", SIAM J. Numer. Anal. 10 (1973); L. Kaufman, BIT 15 (1975) for the Jacobian used.

It also gives first guesses of transport delay and saturation: the best law is found for every candidate
value.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.law.stability import free_coordinates, stable_abc, stable_abc_jacobian
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Options
from sysid.fit.estimators.problem import LawProblem, Traces

_MOST_EVALUATIONS: Final = 100
_BENIGN: Final = free_coordinates([0.8, 0.0, 0.0])
"""Start of the searches for first guesses: a first-order lag."""
_F_LIMIT: Final = 12.0
"""Cost reduction by one parameter, in residual variances, that makes it significant: about 3.5 sigma."""


def project(problem: LawProblem, traces: Traces, abc: FloatArray) -> tuple[FloatArray, int]:
    """Search from `abc`; return A-F of unit gain, shape (6,), and the number of evaluations used.

    The projected cost still has a few local minima (poles stuck near the unit circle). A second search
    escapes them: it starts from the best single pole of those reached, with the other two at zero.
    """
    projection = Projection(problem, traces)
    reached, used = _search_poles(projection, free_coordinates(abc))
    poles = np.roots([1.0, *(-stable_abc(reached))])
    singles = [free_coordinates([p, 0.0, 0.0]) for p in np.sign(poles.real) * np.abs(poles)]
    again, more = _search_poles(projection, min(singles, key=projection.cost))
    best = min(reached, again, key=projection.cost)
    return projection.at(best)[0], used + more + len(singles)


def _search_poles(projection: Projection, t: FloatArray) -> tuple[FloatArray, int]:
    """Return the pole coordinates, shape (3,), of a local minimum near `t`, and the evaluations used."""
    found = least_squares(
        lambda t: projection.at(t)[1],
        t,
        projection.jacobian,
        ftol=1e-6,
        xtol=1e-6,
        gtol=1e-12,
        max_nfev=_MOST_EVALUATIONS,
    )
    return found.x, int(found.nfev)


class Projection:
    """The problem with D, E and F solved for, as a function of the three pole coordinates only."""

    def __init__(self, problem: LawProblem, traces: Traces) -> None:
        self._problem, self._traces = problem, traces
        self._target = (problem.speed_rpm - problem.initial_rpm[problem.row]) * problem.weight
        self._last: tuple[bytes, tuple[FloatArray, FloatArray, FloatArray]] | None = None

    def at(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return A-F, the weighted residual and an orthonormal basis of the linear columns."""
        key = t.tobytes()
        if self._last is None or self._last[0] != key:
            self._last = (key, self._solve(t))
        return self._last[1]

    def cost(self, t: FloatArray) -> float:
        """Return the weighted sum of squares of the residuals."""
        return float(np.sum(self.at(t)[1] ** 2))

    def jacobian(self, t: FloatArray) -> FloatArray:
        """Return d(residual)/dt, shape (M, 3), in Kaufman's form: the part outside the linear columns."""
        coefficients, _, basis = self.at(t)
        full = self._problem.predict_with_jacobian(coefficients, self._traces)[1]
        by_t = ((full[:, :3] - full[:, [4]]) @ stable_abc_jacobian(t)) * self._problem.weight[:, None]
        return np.asarray(by_t - basis @ (basis.T @ by_t))

    def _solve(self, t: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a, b, c = stable_abc(t)
        columns = self._problem.linear_columns([a, b, c], self._traces) * self._problem.weight[:, None]
        offset = self._target - (1.0 - a - b - c) * columns[:, 1]
        basis, values, right = np.linalg.svd(columns[:, [0, 2]] - columns[:, [1]], full_matrices=False)
        keep = values > 1e-10 * max(float(values[0]), 1e-300)
        basis = basis[:, keep]
        inner = basis.T @ offset
        d, f = right[keep].T @ (inner / values[keep])
        return np.array([a, b, c, d, 1.0 - (a + b + c + d + f), f]), basis @ inner - offset, basis


def drive_start(problem: LawProblem, options: Options) -> tuple[float, float]:
    """Return a first guess of (delay_s, saturation_rpm); 0 and infinity if not requested or not seen."""
    limit = _saturation_start(problem) if options.fit_saturation else np.inf
    delay = _delay_start(problem, options.max_delay_s, limit) if options.fit_delay else 0.0
    return delay, limit


def gain_start(problem: LawProblem, command: np.ndarray) -> float:
    """Return a first guess of the DC gain: the regression of speed on commands held for 20 ticks."""
    if problem.length <= 20:
        return 1.0
    held = np.zeros(command.shape, bool)
    steady = np.lib.stride_tricks.sliding_window_view(command, 21, axis=1)
    held[:, 20:] = np.ptp(steady, axis=2) == 0.0
    tick = np.clip(problem.tick - 1, 0, problem.length - 1)
    use = held[problem.row, tick]
    x, y, w = command[problem.row, tick][use], problem.speed_rpm[use], problem.weight[use] ** 2
    power = float(np.sum(w * x * x))
    gain = float(np.sum(w * x * y)) / power if power > 0.0 else 1.0
    return gain if abs(gain) > 1e-3 else 1.0


def _cost(problem: LawProblem, delay_s: float, limit: float) -> float:
    projection = Projection(problem, problem.traces(delay_s, limit))
    return projection.cost(_search_poles(projection, _BENIGN)[0])


def _delay_start(problem: LawProblem, longest_s: float, limit: float) -> float:
    period = problem.sample_period_s

    @cache
    def cost(tick: int) -> float:
        return _cost(problem, tick * period, limit)

    # D, E and F can represent two ticks of delay, so a minimum is visible from three ticks away.
    last = int(longest_s / period + 1e-9)
    coarse = min(range(0, last + 1, 3), key=cost)
    return period * min(range(max(coarse - 2, 0), min(coarse + 2, last) + 1), key=cost)


def _saturation_start(problem: LawProblem) -> float:
    """Scan limits around the highest speeds; infinite unless one explains the data better than none."""
    fastest = float(np.quantile(np.abs(problem.speed_rpm), 0.99))
    largest = problem.largest_command
    limits = [x for x in fastest * np.linspace(0.6, 1.05, 10) if 0.0 < x < largest]
    if not limits:
        return np.inf
    costs = [_cost(problem, 0.0, x) for x in limits]
    best = int(np.argmin(costs))
    # Relative to the residual variance, so that the threshold does not depend on sigma.
    variance = (costs[best] + 2.0 * problem.within_cost) / len(problem.group)
    gained = _cost(problem, 0.0, np.inf) - costs[best]
    return float(limits[best]) if gained > _F_LIMIT * variance else np.inf
