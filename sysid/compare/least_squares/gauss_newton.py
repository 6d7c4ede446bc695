"""Least squares for expensive residuals: each evaluation simulates all runs, so few evaluations are made.

Gauss-Newton with Broyden's rank-one updates of the Jacobian (Math. Comp. 19:577, 1965), Marquardt damping
that grows when a step fails, and the bounds 0..1 kept in the linear subproblem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import lsq_linear

from mecanum_env.units import FloatArray

STEP: Final = 0.02
"""Step of a finite difference on the 0..1 scale of a parameter."""
_GAIN: Final = 0.02  # decrease of the cost that is worth a simulation
_FLAT: Final = 2.0
"""Norm of a derivative [sigma per whole range] below which it carries no information."""
_SHORTEST: Final = 0.005  # resolution of `reach`
_COMPASS_STEPS: Final = (0.1, -0.1, 0.05, -0.05, 0.05, -0.05, 0.025, -0.025, 0.0125, -0.0125, 0.006, -0.006)
_RELATIVE_GAIN: Final = 1e-4
_DAMPINGS: Final = 5
"""Shorter and shorter steps that are tried before a place counts as a minimum."""
_STEEP_GAIN: Final = 1e-3
"""Relative decrease of the cost that is worth new derivatives where residuals are cheap."""
_LONGEST_STEP: Final = 0.5  # relative to the whole range
_PATIENCE: Final = 3.0
"""A descent beyond its limit is given up if even so many times its latest progress does not lead there."""

Mask = npt.NDArray[np.bool_]
Function = Callable[[FloatArray], FloatArray | None]
"""Place (p,), each parameter scaled to 0..1 -> residual (N,), None if there is none."""


@dataclass(frozen=True, eq=False)
class Minimum:
    """Result of a descent."""

    place: FloatArray
    """Shape (p,), each 0..1."""
    residual: FloatArray
    """Shape (N,)."""
    jacobian: FloatArray
    """Derivative of the residual, shape (N, p); by Broyden's formula until `refined`."""
    evaluations: int
    given_up: bool = False
    """Whether the descent ended because it would not have come below its limit."""

    @property
    def cost(self) -> float:
        """Sum of squares of the residual."""
        return float(self.residual @ self.residual)


def descend_sparingly(
    function: Function,
    place: FloatArray,
    *,
    residual: FloatArray | None = None,
    jacobian: FloatArray | None = None,
    most: int = 12,
    limit: float = math.inf,
) -> Minimum | None:
    """Minimise |function|^2 within 0..1 from a `place` (p,); None if there is no residual there.

    `residual` (N,) and `jacobian` (N, p), an approximation, are those at the start, if they are known. After
    them the function is evaluated at `most` so many times. A minimum above the `limit` is of no interest: the
    descent is given up when neither what the linearisation promises nor the latest progress leads below it.
    """
    used = 0
    if residual is None:
        residual, used = function(place), 1
        if residual is None:
            return None
    if jacobian is None:
        jacobian, used = differences(function, place, residual), used + place.size
    damping, promises, given_up = 0.0, list[float](), False
    for _ in range(most):
        step = _step(jacobian, residual, place, damping)
        promised = float(np.sum((residual + jacobian @ step) ** 2))
        expected = float(residual @ residual) - promised
        if expected < max(_GAIN, _RELATIVE_GAIN * float(residual @ residual)):
            break
        # A damped step promises less than there is.
        promises += [promised] if damping == 0.0 else []
        given_up = _hopeless(promises, limit)
        if given_up:
            break
        trial = function(place + step)
        used += 1
        if trial is not None:
            error = trial - residual - jacobian @ step
            jacobian = jacobian + np.outer(error, step / float(step @ step))
        if trial is not None and float(trial @ trial) < float(residual @ residual):
            place, residual, damping = place + step, trial, 0.1 * damping if damping > 1e-3 else 0.0
        else:
            damping = max(10.0 * damping, 0.1)
    return Minimum(place, residual, jacobian, used, given_up)


def descend_steeply(
    function: Function,
    place: FloatArray,
    *,
    step: FloatArray | float,
    most: int = 8,
    near: Callable[[FloatArray], Function] | None = None,
) -> Minimum | None:
    """Minimise |function|^2 as `descend_sparingly` does where residuals are cheap: by new derivatives.

    A descent takes at `most` so many steps, each with a new Jacobian by finite differences over a `step`;
    the minimum has that at its end. None if there is no residual at the `place` (p,).

    `near` a place (p,) gives a function with about the same derivative that is cheaper, or the `function`
    itself: steps are tried with it, and taken if the `function` agrees.
    """
    residual = function(place)
    if residual is None:
        return None

    def derivative(place: FloatArray, residual: FloatArray) -> tuple[Function, FloatArray, FloatArray]:
        local = function if near is None else near(place)
        here = residual if local is function else local(place)
        if here is None:
            local, here = function, residual
        return local, here, differences(local, place, here, step)

    local, here, jacobian = derivative(place, residual)
    damping, used = 0.0, 1
    for _ in range(most):
        before = cost = float(residual @ residual)
        for _ in range(_DAMPINGS):
            move = _step(jacobian, here, place, damping)
            trial, used = local(place + move), used + 1
            if local is not function and trial is not None and float(trial @ trial) < float(here @ here):
                trial, used = function(place + move), used + 1
            if trial is not None and float(trial @ trial) < cost:
                place, residual, cost = place + move, trial, float(trial @ trial)
                damping = 0.1 * damping if damping > 1e-3 else 0.0
                local, here, jacobian = derivative(place, residual)
                used += place.size
                break
            damping = max(10.0 * damping, 0.01)
        if before - cost < max(_GAIN, _STEEP_GAIN * before):
            break
    return Minimum(place, residual, jacobian, used)


def _hopeless(promises: Sequence[float], limit: float) -> bool:
    """Return whether a descent's promised costs, from step to step, do not lead below a limit."""
    if len(promises) < 2:
        return False
    progress = max(0.0, promises[-2] - promises[-1])
    return promises[-1] - _PATIENCE * progress > limit


def refined(function: Function, minimum: Minimum, least_step: float) -> Minimum:
    """Return the minimum of a `function` with a Jacobian by finite differences over about a standard error.

    Below the `least_step` of a difference the simulation is not smooth.
    """
    p = minimum.place.size
    normal = minimum.jacobian.T @ minimum.jacobian
    spread = np.sqrt(np.maximum(np.diag(np.linalg.pinv(normal)), 0.0)) if p else np.zeros(0)
    step = np.clip(spread, least_step, STEP)
    jacobian = differences(function, minimum.place, minimum.residual, step)
    return Minimum(minimum.place, minimum.residual, jacobian, minimum.evaluations + p)


def compass_search(function: Function, minimum: Minimum, along: Mask) -> Minimum:
    """Return the minimum of a `function` after a compass search, without derivatives, `along` a mask (p,)."""
    place, residual, used = minimum.place, minimum.residual, minimum.evaluations
    for i in np.flatnonzero(along):
        for step in _COMPASS_STEPS:
            moved = np.array(place)
            moved[i] = float(np.clip(place[i] + step, 0.0, 1.0))
            trial = function(moved)
            used += 1
            if trial is not None and float(trial @ trial) < float(residual @ residual) - _GAIN:
                place, residual = moved, trial
    return Minimum(place, residual, minimum.jacobian, used)


def derivative_free(minimum: Minimum, stepwise: Sequence[bool]) -> Mask:
    """Return which coordinates have no informative derivative: `stepwise` or flat ones, (p,)."""
    lengths = np.linalg.norm(minimum.jacobian, axis=0)
    return np.asarray((lengths < _FLAT) | np.asarray(stepwise, bool))


def reach(function: Function, minimum: Minimum, index: int, rise: float) -> tuple[float, float]:
    """Return how far the coordinate `index` can move down and up before the cost rises by `rise`.

    It replaces the standard error of a coordinate in which the `function` has no informative derivative.
    """
    ends = []
    for sign in (-1.0, 1.0):
        inside, outside = 0.0, None
        step = _SHORTEST
        room = minimum.place[index] if sign < 0.0 else 1.0 - minimum.place[index]
        while inside < room and (outside is None or outside - inside > _SHORTEST):
            trial = min(step, room) if outside is None else 0.5 * (inside + outside)
            moved = np.array(minimum.place)
            moved[index] += sign * trial
            residual = function(moved)
            if residual is not None and float(residual @ residual) <= minimum.cost + rise:
                inside, step = trial, 2.0 * step
            else:
                outside = trial
        ends.append(inside)
    return ends[0], ends[1]


def differences(
    function: Function,
    place: FloatArray,
    residual: FloatArray,
    step: FloatArray | float = STEP,
    along: Mask | None = None,
) -> FloatArray:
    """Return the Jacobian (N, p) of a `function` by one-sided finite differences that stay within 0..1.

    It is taken at a `place` (p,) of known `residual` (N,), with one `step` or one per coordinate, (p,), and
    `along` those of a mask (p,); the columns of the others are 0.
    """
    columns = np.zeros((residual.size, place.size))
    steps = np.broadcast_to(np.asarray(step, float), place.shape)
    for i in range(place.size) if along is None else np.flatnonzero(along):
        sign = 1.0 if place[i] + steps[i] <= 1.0 else -1.0
        moved = np.array(place)
        moved[i] += sign * steps[i]
        trial = function(moved)
        if trial is not None:
            columns[:, i] = (trial - residual) / (sign * steps[i])
    return columns


def _step(jacobian: FloatArray, residual: FloatArray, place: FloatArray, damping: float) -> FloatArray:
    """Return the step within bounds that minimises the linearised cost plus damping."""
    orthogonal, triangle = np.linalg.qr(jacobian)
    scale = damping * float(np.linalg.norm(triangle)) / max(1, place.size) ** 0.5
    matrix = np.concatenate([triangle, (scale + 1e-9) * np.eye(place.size)])
    wanted = np.concatenate([-orthogonal.T @ residual, np.zeros(place.size)])
    low = np.maximum(-place, -_LONGEST_STEP)
    high = np.minimum(1.0 - place, _LONGEST_STEP)
    tiny = 1e-12  # lsq_linear requires low < high
    found = lsq_linear(matrix, wanted, bounds=(low - tiny, high + tiny), method="bvls")
    return np.asarray(np.clip(found.x, low, high))
