"""Fitting a candidate, such as a set of effects, to the runs of a study.

The rival of every set of effects is here, too: the wheel law itself, fitted again to these logs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final, Generic, TypeVar

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.least_squares.gauss_newton import (
    Function,
    Minimum,
    compass_search,
    derivative_free,
    descend_sparingly,
    differences,
    refined,
)
from sysid.compare.least_squares.problem import ROLLER_STEP, SMOOTH_STEP, ResidualOf, ResidualProblem
from sysid.compare.search_space import Candidate

PRIOR: Final = 0.5
"""Prior standard deviation of a parameter on the 0..1 scale between its bounds."""
_WORTH: Final = 0.5  # decrease of the cost that is worth new derivatives
_PROMISE: Final = 2.0
"""Decrease of the corrected surrogate's cost, in residual variances, that is worth a full simulation."""
_SHARE: Final = 1e-4
"""The same relative to the cost of the base model: formulas err by a hundred times that."""
_ROUGH: Final = 0.03
"""Step on the 0..1 scale of a parameter below which the rollers' scatter is most of what they add to it."""
_CORRECTIONS: Final = 6
_SHARES: Final = (1.0, 0.5)  # steps tried, relative to the one to the corrected surrogate's minimum


C = TypeVar("C", bound=Candidate)


@dataclass(frozen=True, eq=False)
class Fitted(Generic[C]):
    """A candidate at its best place."""

    candidate: C
    place: FloatArray
    """Shape (p,), each 0..1."""
    residual: FloatArray
    """Marginal residual, shape (N,)."""
    jacobian: FloatArray
    """Derivative of the marginal residual, shape (N, p)."""
    given_up: bool = False
    """Whether the place is not the best one, since the cost there would be above the limit of the fit."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.candidate.names

    @property
    def cost(self) -> float:
        """Sum of squares of the marginal residual; its expectation for a right model is N."""
        return float(self.residual @ self.residual)

    def covariance(self, inflation: float = 1.0) -> FloatArray:
        """Return the covariance (p, p) of the place, for residuals of variance `inflation`."""
        information = self.jacobian.T @ self.jacobian / inflation
        return np.asarray(np.linalg.inv(information + np.eye(self.place.size) / PRIOR**2))


def base_fit(problem: ResidualProblem, empty: C) -> Fitted[C]:
    """Return the base model as the fit of a candidate that is `empty`: without parameters."""
    residual = problem.marginal(problem.base_residual)
    return Fitted(empty, np.zeros(0), residual, np.zeros((problem.size, 0)))


def fit(
    problem: ResidualProblem,
    candidate: C,
    place: FloatArray,
    *,
    most: int = 12,
    limit: float = math.inf,
    known: Mapping[int, FloatArray] = MappingProxyType({}),
) -> Fitted[C] | None:
    """Fit a candidate; None if it cannot be simulated at the start.

    Where the problem has a surrogate, `function_near` is minimised instead and corrected by full simulation
    at each minimum, its slopes by Broyden's formula, until the cost no longer decreases. It starts at a
    `place` (p,), and a descent takes at `most` so many simulations beyond those for derivatives. A fit that
    would not come below a cost of `limit` is of no interest, and ends where that became clear. `known` are
    columns (N,) of the Jacobian at a place nearby, by the number of the parameter.
    """
    full = marginal_function(problem, candidate)
    place = np.asarray(place, float)
    residual = full(place)
    if residual is None:
        return None
    if not problem.has_surrogate:
        minimum = _minimum(full, candidate, place, residual, most, limit)
        return Fitted(candidate, minimum.place, minimum.residual, minimum.jacobian, minimum.given_up)
    beyond = slopes_beyond(problem, candidate, place, residual, known)
    near = function_near(problem, candidate, place, residual, beyond)
    explained = float(np.sum(problem.marginal(problem.base_residual) ** 2))
    for _ in range(_CORRECTIONS):
        promised = _minimum(near, candidate, place, residual, most, limit)
        if promised.given_up:
            return Fitted(candidate, place, residual, promised.jacobian, given_up=True)
        cost = float(residual @ residual)
        worth = _PROMISE * max(1.0, cost / problem.size) + _SHARE * explained
        if promised.cost > cost - worth:
            break
        better = _first_better(full, place, promised.place, cost - _WORTH)
        if better is None:
            break
        step, told = better[0] - place, near(better[0])
        place, residual = better
        if told is not None:
            # Over a short step rollers that meet the floor otherwise are most of the difference.
            beyond = beyond + np.outer(residual - told, step / float(step @ step + _ROUGH**2))
        near = function_near(problem, candidate, place, residual, beyond)
    here = Minimum(place, residual, differences(near, place, residual), 0)
    return Fitted(candidate, place, residual, refined(near, here, SMOOTH_STEP).jacobian)


def _first_better(
    full: Function, place: FloatArray, promised: FloatArray, cost: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the first place on the way to the promised one with a cost below `cost`, and its residual."""
    for share in _SHARES if np.any(promised != place) else ():
        trial = place + share * (promised - place)
        residual = full(trial)
        if residual is not None and float(residual @ residual) < cost:
            return trial, residual
    return None


def _minimum(
    function: Function,
    candidate: Candidate,
    place: FloatArray,
    residual: FloatArray,
    most: int,
    limit: float,
) -> Minimum:
    found = descend_sparingly(function, place, residual=residual, most=most, limit=limit)
    if found is None:
        raise AssertionError("a descent from a known residual has an end")
    if found.given_up:
        return found
    minimum = refined(function, found, SMOOTH_STEP)
    looked = compass_search(function, minimum, derivative_free(minimum, candidate.stepwise))
    # Refined derivatives, or the compass search, may show a descent that Broyden's Jacobian did not.
    again = descend_sparingly(
        function, looked.place, residual=looked.residual, jacobian=looked.jacobian, most=max(2, most // 3)
    )
    if again is not None and again.cost < minimum.cost - _WORTH:
        return refined(function, again, SMOOTH_STEP)
    return minimum


def marginal_function(
    problem: ResidualProblem, candidate: Candidate, residual_of: ResidualOf | None = None
) -> Function:
    """Return the marginal residual (N,) of a candidate as a function of its place (p,).

    `residual_of` gives that of a model; by default the `problem` does.
    """
    simulated = problem.residual if residual_of is None else residual_of

    def marginal_residual(place: FloatArray) -> FloatArray | None:
        residual = simulated(candidate.model(problem.base, place))
        return None if residual is None else problem.marginal(residual)

    return marginal_residual


def held_starts(
    problem: ResidualProblem, candidate: Candidate, function: Function
) -> Callable[[FloatArray], Function]:
    """Return what gives, near a place (p,), the marginal `function` of a candidate with starts held."""

    def near(place: FloatArray) -> Function:
        residual_of = problem.residual_near(candidate.model(problem.base, place))
        return function if residual_of is None else marginal_function(problem, candidate, residual_of)

    return near


def function_near(
    problem: ResidualProblem,
    candidate: Candidate,
    place: FloatArray,
    residual: FloatArray,
    beyond: FloatArray,
) -> Function:
    """Return a candidate's marginal residual as a function of its place (p,) that is exact at one place.

    Without a surrogate it is exact everywhere. Else it is the surrogate with a linear correction (Alexandrov
    et al., Journal of Aircraft 38:1093, 2001). At the `place` of exactness the marginal `residual` (N,) is
    known, and so is what its derivative is `beyond` that of the surrogate, (N, p), see `slopes_beyond`.
    """
    linear = ~problem.surrogate_mask(candidate.owners)

    def surrogate(at: FloatArray) -> FloatArray | None:
        simulated = problem.surrogate_residual(candidate.model(problem.base, np.where(linear, place, at)))
        return None if simulated is None else problem.marginal(simulated)

    here = surrogate(place) if problem.has_surrogate else None
    if here is None:
        return marginal_function(problem, candidate)
    correction = residual - here

    def near(at: FloatArray) -> FloatArray | None:
        simulated = surrogate(at)
        return None if simulated is None else simulated + correction + beyond @ (at - place)

    return near


def slopes_beyond(
    problem: ResidualProblem,
    candidate: Candidate,
    place: FloatArray,
    residual: FloatArray,
    known: Mapping[int, FloatArray] = MappingProxyType({}),
) -> FloatArray:
    """Return the derivative (N, p) of a candidate's marginal residual that the surrogate does not show.

    It is that of the parameters that the surrogate does not cover, and taken to be 0 for the others. Columns
    (N,) that are not `known` are measured by differences, at a `place` (p,) with a marginal `residual` (N,).
    """
    full, along = marginal_function(problem, candidate), ~problem.surrogate_mask(candidate.owners)
    unknown = np.array([i not in known for i in range(along.size)], bool)
    slopes = differences(full, place, residual, ROLLER_STEP, along=along & unknown)
    for index, column in known.items():
        slopes[:, index] = column if along[index] else 0.0
    return slopes
