"""Coordinates in which every point is a stable wheel law (Schur-Cohn, or reflection, coefficients).

Any three numbers t map to (A, B, C): k_i = tanh(t_i) are the reflection coefficients of a monic polynomial
with no root outside the unit circle (Levinson's step-up recursion; Jury and Schur-Cohn), and its roots are
then multiplied by `POLE_LIMIT`, so that all stay inside by a margin that double precision still resolves.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

POLE_LIMIT: Final = 1.0 - 2e-5
"""Largest pole magnitude. Three poles there make 1-A-B-C = 8e-15, just above what rounding leaves."""

_LARGEST_REFLECTION: Final = 1.0 - 1e-9
_SCALES: Final = POLE_LIMIT ** np.arange(1, 4)


def stable_abc(t: npt.ArrayLike) -> FloatArray:
    """Return the stable (A, B, C), shape (..., 3), of free coordinates t, shape (..., 3)."""
    k1, k2, k3 = np.moveaxis(np.tanh(np.asarray(t, float)), -1, 0)
    first = k1 * (1.0 + k2)
    return np.asarray(-np.stack([first + k3 * k2, k2 + k3 * first, k3], axis=-1) * _SCALES)


def stable_abc_jacobian(t: npt.ArrayLike) -> FloatArray:
    """Return d(A, B, C)/dt, shape (3, 3), at coordinates t, shape (3,)."""
    k1, k2, k3 = k = np.tanh(np.asarray(t, float))
    by_reflection = -np.array(
        [
            [1.0 + k2, k1 + k3, k2],
            [k3 * (1.0 + k2), 1.0 + k3 * k1, k1 * (1.0 + k2)],
            [0.0, 0.0, 1.0],
        ]
    )
    return np.asarray(_SCALES[:, None] * by_reflection * (1.0 - k * k))


def free_coordinates(abc: npt.ArrayLike) -> FloatArray:
    """Return the coordinates t, shape (3,), of a stable (A, B, C): the inverse of `stable_abc`.

    A triple outside the region gives the nearest reflection coefficients inside, hence always finite numbers.
    """
    a1, a2, a3 = -np.asarray(abc, float) / _SCALES
    limit = _LARGEST_REFLECTION
    k3 = float(np.clip(a3, -limit, limit))
    scale = 1.0 - k3 * k3
    k2 = float(np.clip((a2 - k3 * a1) / scale, -limit, limit))
    k1 = float(np.clip((a1 - k3 * a2) / scale / (1.0 + k2), -limit, limit))
    return np.asarray(np.arctanh([k1, k2, k3]))


def stabilised_abc(abc: npt.ArrayLike, largest_pole: float = 0.995) -> FloatArray:
    """Return `abc` = (A, B, C) with poles outside the unit circle reflected, none above `largest_pole`.

    A reflected pole keeps its frequency; this is how an unstable start becomes a usable one.
    """
    coefficients = np.nan_to_num(np.asarray(abc, float), nan=0.0, posinf=0.0, neginf=0.0)
    poles = np.roots([1.0, *(-coefficients)]).astype(complex)
    size = np.abs(poles)
    outside = size > 1.0
    poles[outside] /= size[outside] ** 2
    size = np.abs(poles)
    large = size > largest_pole
    poles[large] *= largest_pole / size[large]
    return np.asarray(-np.real(np.poly(poles))[1:])
