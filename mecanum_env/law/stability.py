"""The stable region of the coefficients (A, B, C): margins, free coordinates, constraints, nearest point.

**Margins.** Four polynomials that are all positive exactly inside the region (`stability_margins`).

**Free coordinates.** Any three numbers t map to a stable (A, B, C): k_i = tanh(t_i) are the reflection
coefficients of a monic polynomial without roots outside the unit circle (Levinson's step-up recursion; Jury
and Schur-Cohn), whose roots are then multiplied by `POLE_LIMIT`.

**Constraints.** For methods that search (A, B, C) itself: the closed region in which no pole exceeds
`FEASIBLE_POLE`. Its boundary has three faces. With a root at z = 1 or at z = -1 the other two roots range
over the stable quadratics, a triangle, and the map to (A, B, C) is linear: two plane triangles. With a pair
exp(+-i angle) and a real root s it is A = c + s, B = -1 - c s, C = s for c = 2 cos(angle): a bilinear patch,
whose nearest point is a search over c alone. So the nearest point is found globally although the region is
not convex.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

POLE_LIMIT: Final = 1.0 - 2e-5
"""Largest pole magnitude in free coordinates. Three such poles make 1-A-B-C = 8e-15, just above rounding."""
FEASIBLE_POLE: Final = 1.0 - 1e-4
"""Largest pole magnitude of a feasible law. Three such poles leave a margin of 1e-12, far above rounding."""

_LARGEST_REFLECTION: Final = 1.0 - 1e-9
_COORDINATE_SCALES: Final = POLE_LIMIT ** np.arange(1, 4)
_CONSTRAINT_SCALES: Final = FEASIBLE_POLE ** np.arange(1, 4)
_ROUNDING: Final = 1e-13
_TRIANGLES: Final = np.array(
    [
        # Vertices: (z - 1)(z - p)(z - q) and (z + 1)(z - p)(z - q) with p and q at +1 or -1.
        [[3.0, -3.0, 1.0], [1.0, 1.0, -1.0], [-1.0, 1.0, 1.0]],
        [[1.0, 1.0, -1.0], [-1.0, 1.0, 1.0], [-3.0, -3.0, -1.0]],
    ]
)
_GRID: Final = np.linspace(-2.0, 2.0, 81)
_GOLDEN: Final = 0.5 * (np.sqrt(5.0) - 1.0)


def stability_margins(abc: npt.ArrayLike) -> FloatArray:
    """Return the four margins, shape (..., 4), of coefficients `abc` = (A, B, C), shape (..., 3).

    All four are positive exactly when z^3 - A z^2 - B z - C has its roots inside the unit circle: the
    Routh-Hurwitz conditions b0, b2, b3, (b2 b1 - b3 b0)/b2 > 0 after the bilinear transformation, cleared of
    denominators.
    """
    a, b, c = np.moveaxis(np.asarray(abc, float), -1, 0)
    return np.stack([1 - a - b - c, 3 + a + b - 3 * c, 1 + a - b + c, 1 + b + a * c - c * c], axis=-1)


def stable_abc(t: npt.ArrayLike) -> FloatArray:
    """Return the stable (A, B, C), shape (..., 3), of free coordinates t, shape (..., 3)."""
    reflections = np.tanh(np.asarray(t, float))
    k1, k2, k3 = reflections[..., 0], reflections[..., 1], reflections[..., 2]
    first = k1 * (1.0 + k2)
    # Searches ask for one law at a time, for which `np.stack` takes half of the time.
    abc = np.empty(reflections.shape)
    abc[..., 0], abc[..., 1], abc[..., 2] = first + k3 * k2, k2 + k3 * first, k3
    return np.asarray(-abc * _COORDINATE_SCALES)


def stable_abc_jacobian(t: npt.ArrayLike) -> FloatArray:
    """Return d(A, B, C)/dt, shape (3, 3), at coordinates t, shape (3,)."""
    k1, k2, k3 = k = np.tanh(np.asarray(t, float))
    rows = [[1.0 + k2, k1 + k3, k2], [k3 * (1.0 + k2), 1.0 + k3 * k1, k1 * (1.0 + k2)], [0.0, 0.0, 1.0]]
    by_reflection = -np.array(rows)
    return np.asarray(_COORDINATE_SCALES[:, None] * by_reflection * (1.0 - k * k))


def free_coordinates(abc: npt.ArrayLike) -> FloatArray:
    """Return the coordinates t, shape (3,), of a stable (A, B, C): the inverse of `stable_abc`.

    Reflection coefficients of a triple outside the region are clipped, so that the result is always finite.
    """
    a1, a2, a3 = -np.asarray(abc, float) / _COORDINATE_SCALES
    limit = _LARGEST_REFLECTION
    k3 = float(np.clip(a3, -limit, limit))
    scale = 1.0 - k3 * k3
    k2 = float(np.clip((a2 - k3 * a1) / scale, -limit, limit))
    k1 = float(np.clip((a1 - k3 * a2) / scale / (1.0 + k2), -limit, limit))
    return np.asarray(np.arctanh([k1, k2, k3]))


def stabilised_abc(abc: npt.ArrayLike, largest_pole: float = 0.995) -> FloatArray:
    """Return `abc` = (A, B, C) with poles reflected into the unit circle and none above `largest_pole`.

    A reflected pole keeps its frequency. This turns an unstable start of a search into a usable one.
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


def violations(abc: npt.ArrayLike) -> FloatArray:
    """Return the constraints g, shape (..., 4), of (A, B, C), shape (..., 3).

    All are <= 0 exactly when no pole exceeds `FEASIBLE_POLE`: minus the `stability_margins` after division of
    the poles by it.
    """
    return np.asarray(-stability_margins(np.asarray(abc, float) / _CONSTRAINT_SCALES))


def violation_gradients(abc: npt.ArrayLike) -> FloatArray:
    """Return the gradients dg/d(A, B, C), shape (..., 4, 3), of `violations` at `abc`, shape (..., 3)."""
    scaled = np.asarray(abc, float) / _CONSTRAINT_SCALES
    a, _, c = np.moveaxis(scaled, -1, 0)
    result = np.empty((*scaled.shape[:-1], 4, 3))
    result[..., 0, :] = [1.0, 1.0, 1.0]
    result[..., 1, :] = [-1.0, -1.0, 3.0]
    result[..., 2, :] = [-1.0, 1.0, -1.0]
    result[..., 3, :] = np.stack([-c, np.full_like(c, -1.0), 2.0 * c - a], axis=-1)
    return np.asarray(result / _CONSTRAINT_SCALES)


def feasible(abc: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return whether no pole of (A, B, C), shape (..., 3), exceeds `FEASIBLE_POLE` up to rounding."""
    return np.asarray(np.all(violations(abc) <= _ROUNDING, axis=-1))


def nearest_feasible(abc: npt.ArrayLike) -> FloatArray:
    """Return the nearest feasible (A, B, C), shape (S, 3), of finite points, shape (S, 3).

    Distances are measured after division by `FEASIBLE_POLE` to the power 1, 2, 3, so they are Euclidean to
    3 in 10,000.
    """
    points = np.array(abc, float)
    outside = ~feasible(points)
    if np.any(outside):
        wanted = points[outside] / _CONSTRAINT_SCALES
        found = np.stack([_on_triangle(wanted, t) for t in _TRIANGLES] + [_on_patch(wanted)])
        best = np.argmin(np.sum((found - wanted) ** 2, axis=-1), axis=0)
        points[outside] = found[best, np.arange(len(best))] * _CONSTRAINT_SCALES
    return points


def _on_triangle(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the nearest points, shape (S, 3), on a plane triangle with `corners`, shape (3, 3)."""
    edges = corners[[1, 2]] - corners[0]
    inner = (points - corners[0]) @ np.linalg.pinv(edges)  # (S, 2): coordinates along the two edges
    inside = np.all(inner >= 0.0, axis=1) & (np.sum(inner, axis=1) <= 1.0)
    result = corners[0] + inner @ edges
    nearest = np.full(len(points), np.inf)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        along = corners[second] - corners[first]
        share = np.clip((points - corners[first]) @ along / (along @ along), 0.0, 1.0)
        candidate = corners[first] + share[:, None] * along
        distance = np.sum((points - candidate) ** 2, axis=1)
        closer = ~inside & (distance < nearest)
        result[closer], nearest[closer] = candidate[closer], distance[closer]
    return np.asarray(result)


def _on_patch(points: FloatArray) -> FloatArray:
    """Return the nearest points, shape (S, 3), on the face with a pair of roots on the unit circle."""

    def at(c: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the squared distance and the best real root s for c, all of shape (S, n)."""
        a, b, third = points[:, :1], points[:, 1:2], points[:, 2:]
        s = np.clip(((a - c) - c * (b + 1.0) + third) / (2.0 + c * c), -1.0, 1.0)
        return (c + s - a) ** 2 + (-1.0 - c * s - b) ** 2 + (s - third) ** 2, s

    grid = np.broadcast_to(_GRID, (len(points), len(_GRID)))
    middle = _GRID[np.argmin(at(grid)[0], axis=1)][:, None]
    step = _GRID[1] - _GRID[0]
    low, high = np.maximum(middle - step, -2.0), np.minimum(middle + step, 2.0)
    for _ in range(60):  # golden section: 0.618**60 of a grid step is below rounding
        left, right = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        smaller = at(left)[0] < at(right)[0]
        low, high = np.where(smaller, low, left), np.where(smaller, right, high)
    c = 0.5 * (low + high)
    s = at(c)[1]
    return np.concatenate([c + s, -1.0 - c * s, s], axis=1)
