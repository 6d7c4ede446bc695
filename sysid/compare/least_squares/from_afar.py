"""Least squares that begin far from the minimum, where residuals are cheap, by SciPy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.units import FloatArray

_Residuals = Callable[[FloatArray], FloatArray]
_Scale = Literal["jac"] | float
_SCALES: Final[tuple[_Scale, ...]] = (1.0, "jac")
"""Trust regions of the numbers as they are, and scaled by the Jacobian, lead to different minima."""
_STAGES: Final = ((4, 1e-2, 8), (8, 1e-2, 3), (30, 1e-3, 1))
"""Most steps of each descent of a stage, the relative step of their differences, and how many descents go on,
the best first. Assumed: the first steps tell which descents are worth the others."""
_SHORTEST: Final = 1e-12
"""Shortest difference, far below any that is used."""


def descend_from_afar(
    residuals: _Residuals, place: FloatArray, step: float, most: int
) -> tuple[float, FloatArray]:
    """Return the least sum of squares near a place, (p,), each number from 0 to 1, and where it is.

    The squares are those of the `residuals` (m, N) of places (m, p), which are asked for together where that
    is possible. There are at `most` so many steps, with differences over a relative `step`.
    """
    found = [_descended(residuals, _Descent(np.inf, place, scale), step, most) for scale in _SCALES]
    best = min(found, key=_cost)
    return best.cost, best.place


def descend_from_many(residuals: _Residuals, places: Sequence[FloatArray]) -> tuple[float, FloatArray]:
    """Return the least sum of squares near any of some places, (p,) each, and where it is.

    `residuals` are as for `descend_from_afar`. Descents whose first steps lead least far are given up
    (successive halving; K. Jamieson, A. Talwalkar, "Non-stochastic best arm identification and hyperparameter
    optimization", AISTATS 2016).
    """
    found = [_Descent(np.inf, place, scale) for place in places for scale in _SCALES]
    for most, step, kept in _STAGES:
        found = sorted((_descended(residuals, one, step, most) for one in found), key=_cost)[:kept]
    return found[0].cost, found[0].place


@dataclass(frozen=True, eq=False)
class _Descent:
    """How far a descent has come."""

    cost: float
    place: FloatArray
    scale: _Scale
    """Scale of its trust region."""


def _cost(descent: _Descent) -> float:
    return descent.cost


def _descended(residuals: _Residuals, begun: _Descent, step: float, most: int) -> _Descent:
    last, inside = _Last(residuals, step), np.clip(begun.place, 1e-6, 1.0 - 1e-6)
    limits: dict[str, Any] = {"bounds": (0.0, 1.0), "max_nfev": most, "x_scale": begun.scale}
    found = least_squares(last.residual, inside, jac=last.jacobian, **limits)
    return _Descent(2.0 * float(found.cost), found.x, begun.scale)


class _Last:
    """Residuals of single places, and their derivatives; that of the last place is remembered."""

    def __init__(self, residuals: _Residuals, step: float) -> None:
        self._residuals, self._step = residuals, step
        self._place, self._found = np.zeros(0), np.zeros(0)

    def residual(self, place: FloatArray) -> FloatArray:
        """Return the residual (N,) of a place (p,)."""
        if not np.array_equal(place, self._place):
            self._place, self._found = place.copy(), self._residuals(place[None])[0]
        return self._found

    def jacobian(self, place: FloatArray) -> FloatArray:
        """Return the derivative (N, p) of the residual by differences that stay below 1."""
        step = np.maximum(self._step * place, _SHORTEST)
        ahead = place + np.where(place + step > 1.0, -step, step)
        moved = self._residuals(np.where(np.eye(place.size, dtype=bool), ahead, place))
        return ((moved - self.residual(place)) / (ahead - place)[:, None]).T
