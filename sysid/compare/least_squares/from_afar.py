"""Least squares that begin far from the minimum, where residuals are cheap, by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.units import FloatArray

_SHORTEST: Final = 1e-12
"""Shortest difference, far below any that is used."""


def descend_from_afar(
    residuals: Callable[[FloatArray], FloatArray], place: FloatArray, step: float, most: int
) -> tuple[float, FloatArray]:
    """Return the least sum of squares near a place, (p,), each number from 0 to 1, and where it is.

    The squares are those of the `residuals` (m, N) of places (m, p), which are asked for together where that
    is possible. There are at `most` so many steps, with differences over a relative `step`. Trust regions of
    the numbers as they are, and scaled by the Jacobian, lead to different minima.
    """
    inside = np.clip(place, 1e-6, 1.0 - 1e-6)
    limits: dict[str, Any] = {"bounds": (0.0, 1.0), "max_nfev": most}
    found = []
    for scale in (1.0, "jac"):
        last = _Last(residuals, step)
        found.append(least_squares(last.residual, inside, jac=last.jacobian, x_scale=scale, **limits))
    best = min(found, key=lambda one: float(one.cost))
    return 2.0 * float(best.cost), best.x


class _Last:
    """Residuals of single places, and their derivatives; that of the last place is remembered."""

    def __init__(self, residuals: Callable[[FloatArray], FloatArray], step: float) -> None:
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
