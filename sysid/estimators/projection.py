"""Variable projection: D, E and F solved for, the search left with the three pole coordinates.

G. H. Golub and V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose
variables separate", SIAM J. Numer. Anal. 10 (1973); L. Kaufman, BIT 15 (1975) for the Jacobian used.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.units import FloatArray
from sysid.estimators.problem import Problem, Traces
from sysid.estimators.stability import free_coordinates, stable_abc, stable_abc_jacobian

_MOST_EVALUATIONS = 100


def project(problem: Problem, traces: Traces, abc: FloatArray) -> tuple[FloatArray, int]:
    """Stage 1, from `abc`: return A-F of unit gain, shape (6,), and the number of evaluations used.

    The projected cost still has a few local minima (poles stuck near the unit circle). They are left by a
    second search from the best of the poles reached, the other two at zero.
    """
    projection = Projection(problem, traces)
    reached, used = search_poles(projection, free_coordinates(abc))
    poles = np.roots([1.0, *(-stable_abc(reached))])
    singles = [free_coordinates([p, 0.0, 0.0]) for p in np.sign(poles.real) * np.abs(poles)]
    again, more = search_poles(projection, min(singles, key=projection.cost))
    best = min(reached, again, key=projection.cost)
    return projection.at(best)[0], used + more + len(singles)


def search_poles(projection: Projection, t: FloatArray) -> tuple[FloatArray, int]:
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
    """The problem with D, E and F solved for: a function of the three pole coordinates only."""

    def __init__(self, problem: Problem, traces: Traces) -> None:
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
        """Return the weighted square sum of the residuals."""
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
