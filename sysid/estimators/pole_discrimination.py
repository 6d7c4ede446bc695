"""Gradient descent constrained by the magnitudes of the poles themselves: the paper's third variant.

The paper names it ("pole discrimination", section 4.1), gives no equations and reports that all trials fail.
Here it is the loop of `kkt` with other constraints: g_i = |z_i| - limit <= 0 for the three roots z_i, and an
unstable update is brought back by moving each offending pole radially to the limit. Two things set it apart
from Routh-Hurwitz: d|z|/d(A, B, C) is infinite at a double pole, and the radial move is not the nearest
point, so that it may raise H.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.estimators.descent import Constraint
from sysid.estimators.feasible import FEASIBLE_POLE
from sysid.estimators.gradient import estimate_by_descent
from sysid.estimators.interface import Estimate, Options
from sysid.estimators.runs import WheelRun

_SMALLEST_SLOPE: Final = 1e-9
"""Bounds the derivative of a root where two meet."""


def pole_discrimination(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate by gradient descent with constraints on the pole magnitudes (section 4.1 of the paper).

    S. Nie, N. Igo and K. Hoshino, "Parameter identification of Mecanum wheel robot using descent with
    stability criterion"; how it fails there is not told, so its 0 % is reported beside ours rather than
    reproduced.

    Args:
        runs: one or more runs.
        options: as for `gradient.gradient`.

    Raises:
        InputError: no usable data.
    """
    return estimate_by_descent("poles", runs, options or Options(), POLE_MAGNITUDES)


def poles(abc: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Return the roots of z^3 - A z^2 - B z - C, shape (S, 3), of (A, B, C), shape (S, 3)."""
    companion = np.zeros((len(np.asarray(abc)), 3, 3))
    companion[:, 0] = abc
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    return np.linalg.eigvals(companion).astype(np.complex128)


def magnitude_excess(abc: FloatArray) -> FloatArray:
    """Return |z_i| - `FEASIBLE_POLE`, shape (S, 3), of (A, B, C), shape (S, 3)."""
    return np.abs(poles(abc)) - FEASIBLE_POLE


def magnitude_gradients(abc: FloatArray) -> FloatArray:
    """Return d|z_i|/d(A, B, C), shape (S, 3, 3), from dz = (z^2 dA + z dB + dC) / (3 z^2 - 2 A z - B)."""
    z = poles(abc)
    slope = 3.0 * z * z - 2.0 * abc[:, :1] * z - abc[:, 1:2]
    slope = np.where(np.abs(slope) < _SMALLEST_SLOPE, _SMALLEST_SLOPE, slope)
    by_coefficient = np.stack([z * z, z, np.ones_like(z)], axis=-1) / slope[:, :, None]
    size = np.maximum(np.abs(z), 1e-12)
    return np.asarray(np.real(np.conj(z)[:, :, None] * by_coefficient) / size[:, :, None])


def radially_stable(abc: FloatArray) -> FloatArray:
    """Return (A, B, C), shape (S, 3), with every pole beyond `FEASIBLE_POLE` moved to it along its ray."""
    z = poles(abc)
    size = np.abs(z)
    outside = np.any(size > FEASIBLE_POLE * (1.0 + 1e-12), axis=1)
    z = np.where(size > FEASIBLE_POLE, z * (FEASIBLE_POLE / np.maximum(size, 1e-12)), z)
    one, two, three = z.T
    moved = np.stack(
        [(one + two + three).real, -(one * two + two * three + three * one).real, (one * two * three).real],
        axis=1,
    )
    return np.where(outside[:, None], moved, abc)


POLE_MAGNITUDES: Final = Constraint(magnitude_excess, magnitude_gradients, radially_stable)
"""The three pole magnitudes and the radial way back."""
