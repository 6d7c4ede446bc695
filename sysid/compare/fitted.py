"""One set of effects, fitted to the runs of a study.

The rival of every effect: the wheel law itself, fitted again to these logs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Generic, Protocol, TypeVar

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.stability import free_coordinates, stable_abc
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.descent import (
    Function,
    Minimum,
    compass_search,
    derivative_free,
    descend,
    differences,
    refined,
)
from sysid.compare.problem import ROLLER_STEP, SMOOTH_STEP, ResidualProblem

PRIOR: Final = 0.5
"""Spread of a parameter, on the scale 0 .. 1 between its bounds, before any log is looked at."""


class Candidate(Protocol):
    """What can be fitted: a set of effects, or the wheel law."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        ...

    @property
    def parameter_count(self) -> int:
        """Free parameters p."""
        ...

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which free parameters have a response that jumps, (p,)."""
        ...

    @property
    def owners(self) -> tuple[str, ...]:
        """The effect that each free parameter belongs to, "" for none, (p,)."""
        ...

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the model at a place (p,)."""
        ...

    def start(self) -> FloatArray:
        """Return the place nearest to the base model, (p,)."""
        ...


_WORTH: Final = 0.5  # of square sum: less is not worth new derivatives
_PROMISE: Final = 2.0  # of square sum: less is not worth another full simulation
_CORRECTIONS: Final = 4
_SHARES: Final = (1.0, 0.5)  # of the way to where a corrected simulation has its minimum
C = TypeVar("C", bound=Candidate)


@dataclass(frozen=True, eq=False)
class Fitted(Generic[C]):
    """A candidate at its best place."""

    candidate: C
    place: FloatArray
    """(p,), each 0 .. 1."""
    residual: FloatArray
    """Marginal, (N,)."""
    jacobian: FloatArray
    """Of the marginal residual, (N, p)."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.candidate.names

    @property
    def cost(self) -> float:
        """Square sum of the marginal residual; expected to be N where nothing is missing."""
        return float(self.residual @ self.residual)

    def covariance(self, inflation: float = 1.0) -> FloatArray:
        """Return the covariance (p, p) of the place, `inflation` times what the noise alone would make."""
        information = self.jacobian.T @ self.jacobian / inflation
        return np.asarray(np.linalg.inv(information + np.eye(self.place.size) / PRIOR**2))


def base_fit(problem: ResidualProblem, empty: C) -> Fitted[C]:
    """Return the base model as a fit of the empty set.

    Args:
        problem: the model and the logs.
        empty: a candidate without parameters.
    """
    residual = problem.marginal(problem.base_residual)
    return Fitted(empty, np.zeros(0), residual, np.zeros((problem.size, 0)))


def fit(problem: ResidualProblem, candidate: C, place: FloatArray, *, most: int = 12) -> Fitted[C] | None:
    """Fit a candidate by full simulation, from a place; None where it cannot be simulated.

    On the robot `function_near` is minimised instead, corrected at the place reached by full simulation,
    until nothing is gained.

    Args:
        problem: the model and the logs.
        candidate: what to fit.
        place: the start (p,).
        most: simulations beyond those of the derivatives.
    """
    full = marginal_function(problem, candidate)
    place = np.asarray(place, float)
    residual = full(place)
    if residual is None:
        return None
    if not problem.has_surrogate:
        minimum = _minimum(full, candidate, place, residual, most)
        return Fitted(candidate, minimum.place, minimum.residual, minimum.jacobian)
    near = function_near(problem, candidate, place, residual)
    for _ in range(_CORRECTIONS):
        promised = _minimum(near, candidate, place, residual, most)
        cost = float(residual @ residual)
        if promised.cost > cost - _PROMISE:
            break
        better = _first_better(full, place, promised.place, cost - _WORTH)
        if better is None:
            break
        place, residual = better
        near = function_near(problem, candidate, place, residual)
    here = Minimum(place, residual, differences(near, place, residual), 0)
    return Fitted(candidate, place, residual, refined(near, here, SMOOTH_STEP).jacobian)


def _first_better(
    full: Function, place: FloatArray, promised: FloatArray, cost: float
) -> tuple[FloatArray, FloatArray] | None:
    """Return the first of some places on the way to the promised one whose square sum is below `cost`."""
    for share in _SHARES if np.any(promised != place) else ():
        there = place + share * (promised - place)
        residual = full(there)
        if residual is not None and float(residual @ residual) < cost:
            return there, residual
    return None


def _minimum(
    function: Function, candidate: Candidate, place: FloatArray, residual: FloatArray, most: int
) -> Minimum:
    found = descend(function, place, residual=residual, most=most)
    if found is None:
        raise AssertionError("a descent from a known residual has an end")
    minimum = refined(function, found, SMOOTH_STEP)
    looked = compass_search(function, minimum, derivative_free(minimum, candidate.stepwise))
    # The refined derivatives, or a look about, may show a way that Broyden's did not.
    again = descend(
        function, looked.place, residual=looked.residual, jacobian=looked.jacobian, most=max(2, most // 3)
    )
    if again is not None and again.cost < minimum.cost - _WORTH:
        return refined(function, again, SMOOTH_STEP)
    return minimum


def marginal_function(problem: ResidualProblem, candidate: Candidate) -> Function:
    """Return the marginal residual (N,) of a candidate as a function of its place (p,).

    Args:
        problem: the model and the logs.
        candidate: what is fitted.
    """

    def marginal_residual(place: FloatArray) -> FloatArray | None:
        residual = problem.residual(candidate.model(problem.base, place))
        return None if residual is None else problem.marginal(residual)

    return marginal_residual


def function_near(
    problem: ResidualProblem,
    candidate: Candidate,
    place: FloatArray,
    residual: FloatArray,
    jacobian: FloatArray | None = None,
) -> Function:
    """Return a candidate's marginal residual as a function of its place (p,), exact at one place.

    Elsewhere the quicker simulation, if there is one, tells the difference (an additive correction:
    Alexandrov et al., Journal of Aircraft 38:1093, 2001), and slopes tell what the rollers alone show.

    Args:
        problem: the model and the logs.
        candidate: what is fitted.
        place: where it is exact (p,).
        residual: marginal, there (N,).
        jacobian: there (N, p), where it is known.
    """
    full = marginal_function(problem, candidate)
    there = (
        problem.surrogate_residual(candidate.model(problem.base, place)) if problem.has_surrogate else None
    )
    if there is None:
        return full
    correction = residual - problem.marginal(there)
    slow = ~problem.surrogate_mask(candidate.owners)
    if jacobian is None:
        jacobian = differences(full, place, residual, ROLLER_STEP, along=slow)

    def near(at: FloatArray) -> FloatArray | None:
        quick = problem.surrogate_residual(candidate.model(problem.base, np.where(slow, place, at)))
        if quick is None:
            return None
        moved = np.where(slow, at - place, 0.0)
        return problem.marginal(quick) + correction + jacobian @ moved

    return near


NAME: Final = "wheel_law"
_REACH: Final = np.array([1.5, 1.5, 1.5, 0.5, 0.5])
"""Of the search to either side: three stable coordinates of A-C (`mecanum_env.law.stability`), D and E."""


@dataclass(frozen=True)
class RefittedLaw:
    """The law's five free numbers as a vector, each 0 .. 1; F keeps the law's steady gain."""

    base: Model
    names: tuple[str, ...] = field(default=(NAME,))

    @property
    def parameter_count(self) -> int:
        """Free numbers."""
        return len(_REACH)

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """None of them jumps."""
        return (False,) * self.parameter_count

    @property
    def owners(self) -> tuple[str, ...]:
        """None of them belongs to an effect."""
        return ("",) * self.parameter_count

    def start(self) -> FloatArray:
        """Return the place of the law as it is, shape (5,)."""
        return np.full(len(_REACH), 0.5)

    def model(self, base: Model, unit: Sequence[float] | FloatArray) -> Model:
        """Return the base model with the law at a place `unit`, shape (5,)."""
        law = self.base.wheel.law
        c = law.coefficients
        moved = (np.asarray(unit, float) - 0.5) * 2.0 * _REACH
        if not np.any(moved):
            return base
        abc = stable_abc(free_coordinates(c[:3]) + moved[:3])
        gain = float(np.sum(c[3:]) / (1.0 - np.sum(c[:3])))
        d, e = c[3:5] + moved[3:]
        f = gain * (1.0 - float(np.sum(abc))) - d - e
        values = dict(zip(COEFFICIENTS, [*abc.tolist(), float(d), float(e), float(f)], strict=True))
        return replace(base, wheel=replace(base.wheel, law=replace(law, **values)))
