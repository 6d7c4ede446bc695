"""Least squares that begin far from the minimum, where residuals are cheap, by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.units import FloatArray


def descend_from_afar(
    residual: Callable[[FloatArray], FloatArray], place: FloatArray, step: float, most: int
) -> tuple[float, FloatArray]:
    """Return the least sum of squares near a place, (p,), each number from 0 to 1, and where it is.

    The squares are those of the `residual` of a place. There are at `most` so many steps, with differences
    over a relative `step`. Trust regions of the numbers as they are, and scaled by the Jacobian, lead to
    different minima.
    """
    inside = np.clip(place, 1e-6, 1.0 - 1e-6)
    limits: dict[str, Any] = {"bounds": (0.0, 1.0), "diff_step": step, "max_nfev": most}
    found = [least_squares(residual, inside, x_scale=scale, **limits) for scale in (1.0, "jac")]
    best = min(found, key=lambda one: float(one.cost))
    return 2.0 * float(best.cost), best.x
