"""Least squares that begin far from the minimum, where residuals are cheap, by SciPy."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.units import FloatArray


def descend_from_afar(
    residual: Callable[[FloatArray], FloatArray],
    place: FloatArray,
    step: float,
    most: int,
    *,
    thorough: bool = True,
) -> tuple[float, FloatArray]:
    """Return the least sum of squares near a place, (p,), each number from 0 to 1, and where it is.

    The squares are those of the `residual` of a place. There are at `most` so many steps, with differences
    over a relative `step`. The trust region is of the numbers scaled by the Jacobian, and if `thorough` also
    of the numbers as they are, which may lead to another minimum and takes twice as long.
    """
    inside = np.clip(place, 1e-6, 1.0 - 1e-6)
    limits: dict[str, Any] = {"bounds": (0.0, 1.0), "diff_step": step, "max_nfev": most}
    scales = (1.0, "jac") if thorough else ("jac",)
    found = [least_squares(residual, inside, x_scale=scale, **limits) for scale in scales]
    best = min(found, key=lambda one: float(one.cost))
    return 2.0 * float(best.cost), best.x
