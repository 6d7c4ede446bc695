"""Gradient descent from many starts at once, with or without constraints on (A, B, C).

One iteration is Steps 2-4 of Nie, Igo and Hoshino, section 3.2: the gradient of the Lagrangian
L = H + sum lambda_i g_i, a step against it, the update lambda_i <- max(0, lambda_i + alpha g_i), and the
return of a point outside the region. Step 5 stops when the gradient or the change of H is small.

As printed, with g_i >= 0 meaning stable, Steps 2 and 4 drive the point *out* of the region: lambda grows
while the law is stable, and the step descends g. With g_i <= 0 meaning stable both signs are right, which is
what is implemented; `Constraint.printed_signs` keeps the printed form for comparison.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

CostAndGradient = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""From laws A-F, shape (S, 6), to H, shape (S,), infinite on overflow, and dH/d(A-F), shape (S, 6)."""

Rule = Literal["fixed", "spectral"]
"""Length of the steps, which go against the gradient.

fixed: constant alpha, as in the paper. spectral: the Barzilai-Borwein lengths (J. Barzilai and J. M. Borwein,
"Two-point step size gradient methods", IMA J. Numerical Analysis 8, 1988), accepted only if H falls (Armijo)
and cut to a quarter otherwise.
"""

_CHANGE_TOLERANCE: Final = 1e-6
"""Stop when H fell by less than this share of itself in `_CHANGE_WINDOW` iterations."""
_CHANGE_WINDOW: Final = 50
_GRADIENT_TOLERANCE: Final = 1e-12
"""Stop when a step of the rate `alpha` would move the coefficients by less than this."""
_LARGEST: Final = 1e3  # coefficients beyond this have diverged
_ARMIJO: Final = 1e-4
_SHRINK: Final = 0.25
_GROW: Final = 4.0
_SAFEGUARD: Final = 1e10  # largest factor between the lengths of successive steps


@dataclass(frozen=True)
class Constraint:
    """Inequalities g(A, B, C) <= 0, and how to return a point that violates them."""

    values: Callable[[FloatArray], FloatArray]
    """From (S, 3) to g, shape (S, n)."""
    gradients: Callable[[FloatArray], FloatArray]
    """From (S, 3) to dg/d(A, B, C), shape (S, n, 3)."""
    pull_back: Callable[[FloatArray], FloatArray]
    """From (S, 3) to points that satisfy the constraints, shape (S, 3)."""
    printed_signs: bool = False
    """Treat g >= 0 as stable in the Lagrangian and the multipliers, as printed in the paper, to compare."""


@dataclass(frozen=True, eq=False)
class Descent:
    """Results of S starts; every array has S rows."""

    laws: FloatArray
    """A-F, shape (S, 6)."""
    cost: FloatArray
    """H; infinite if the search diverged."""
    multipliers: FloatArray
    """lambda, shape (S, n)."""
    converged: npt.NDArray[np.bool_]
    """Whether a stop criterion was met before the limit of iterations."""
    iterations: npt.NDArray[np.intp]


def descend(
    cost: CostAndGradient,
    starts: npt.ArrayLike,
    *,
    rate: float,
    iterations: int,
    rule: Rule = "spectral",
    constraint: Constraint | None = None,
    unit_gain: bool = False,
) -> Descent:
    """Descend the `cost` from all `starts` A-F, shape (S, 6), until a stop criterion, divergence or a limit.

    Args:
        cost: H and its gradient.
        starts: pulled back into the constraint before the first step.
        rate: alpha of the fixed rule; the spectral rule uses it for the stop criterion only.
        iterations: largest number of iterations of each start.
        rule: length of the steps.
        constraint: None for plain descent.
        unit_gain: keep A+B+C+D+E+F = 1; the gradient's mean is removed, which is its exact projection.
    """
    x = _admitted(np.array(starts, float), constraint, unit_gain)
    count = len(x)
    h, gradient = cost(x)
    conditions = 0 if constraint is None else constraint.values(x[:1, :3]).shape[1]
    multipliers = np.zeros((count, conditions))
    norm = np.max(np.abs(_tangent(gradient, unit_gain)), axis=1)
    step = np.full(count, rate) if rule == "fixed" else np.minimum(rate, 0.1 / np.maximum(norm, 1e-300))
    converged = np.zeros(count, bool)
    done = np.zeros(count, np.intp)
    checked = h.copy()
    active = np.flatnonzero(np.isfinite(h))
    for i in range(1, iterations + 1):
        if len(active) == 0:
            break
        at, alpha, old = x[active], step[active][:, None], h[active]
        slope = _tangent(gradient[active] + _pressure(at, multipliers[active], constraint), unit_gain)
        trial = at - alpha * slope
        too_large = ~(np.max(np.abs(trial), axis=1) <= _LARGEST)
        trial[too_large] = at[too_large]
        if constraint is not None:
            g = constraint.values(trial[:, :3])
            g = -g if constraint.printed_signs else g
            multipliers[active] = np.maximum(0.0, multipliers[active] + alpha * g)
        unprojected, trial = trial, _admitted(trial, constraint, unit_gain)
        new, new_gradient = cost(trial)
        moved = trial - at
        moved_squared = np.sum(moved * moved, axis=1)
        if rule == "fixed":
            accepted = ~too_large
        else:
            accepted = ~too_large & (new <= old - _ARMIJO * moved_squared / alpha[:, 0])
            change = _tangent(new_gradient - gradient[active], unit_gain)
            step[active] = _next_step(alpha[:, 0], moved, change, accepted, odd=bool(i % 2))
            multipliers[active[~accepted]] = 0.0
        taken = active[accepted]
        x[taken], h[taken], gradient[taken] = trial[accepted], new[accepted], new_gradient[accepted]
        done[active] = i
        diverged = ~np.isfinite(h[active])
        if rule == "fixed":
            diverged |= too_large
            h[active[too_large]] = np.inf
        pulled = np.any(trial[:, :3] != unprojected[:, :3], axis=1)
        length = np.max(np.where(pulled[:, None], np.abs(moved) / alpha, np.abs(slope)), axis=1)
        stopped = ~too_large & (length * rate <= _GRADIENT_TOLERANCE)
        if i % _CHANGE_WINDOW == 0:
            with np.errstate(invalid="ignore"):
                stopped |= np.abs(checked[active] - h[active]) <= _CHANGE_TOLERANCE * h[active]
            checked[active] = h[active]
        converged[active] = stopped & ~diverged
        active = active[~(diverged | stopped)]
    return Descent(x, h, multipliers, converged, done)


def _admitted(x: FloatArray, constraint: Constraint | None, unit_gain: bool) -> FloatArray:
    """Return the points pulled back into the constraints and onto unit gain, shape (S, 6)."""
    x = x.copy()
    if constraint is not None:
        x[:, :3] = constraint.pull_back(x[:, :3])
    if unit_gain:
        # D, E and F share the difference equally: the nearest point of unit gain that keeps the poles.
        x[:, 3:] += ((1.0 - np.sum(x, axis=1)) / 3.0)[:, None]
    return x


def _tangent(gradient: FloatArray, unit_gain: bool) -> FloatArray:
    return gradient - np.mean(gradient, axis=1, keepdims=True) if unit_gain else gradient


def _pressure(x: FloatArray, multipliers: FloatArray, constraint: Constraint | None) -> FloatArray:
    """Return sum lambda_i dg_i/dx, shape (S, 6)."""
    result = np.zeros_like(x)
    if constraint is not None and np.any(multipliers):
        sign = -1.0 if constraint.printed_signs else 1.0
        result[:, :3] = sign * np.einsum("sn,snj->sj", multipliers, constraint.gradients(x[:, :3]))
    return result


def _next_step(
    alpha: FloatArray, moved: FloatArray, change: FloatArray, accepted: npt.NDArray[np.bool_], *, odd: bool
) -> FloatArray:
    """Return the next lengths: both Barzilai-Borwein formulae in turn, longer ones where H is not convex."""
    size = np.maximum(np.max(np.abs(change), axis=1), 1e-150)
    scaled = change / size[:, None]  # the squared gradients of unstable laws would overflow
    curvature = np.sum(moved * scaled, axis=1)
    convex = curvature > 0.0
    safe = np.where(convex, curvature, 1.0)
    with np.errstate(over="ignore"):
        if odd:
            length = np.sum(moved * moved, axis=1) / safe / size
        else:
            length = safe / np.maximum(np.sum(scaled * scaled, axis=1), 1e-150) / size
    length = np.clip(length, alpha / _SAFEGUARD, alpha * _SAFEGUARD)
    return np.where(accepted, np.where(convex, length, _GROW * alpha), _SHRINK * alpha)
