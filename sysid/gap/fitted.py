"""One set of effects, fitted to the runs of a study."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.descent import Function, descend, explored, flat_or, refined
from sysid.gap.problem import Problem

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

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the model at a place (p,)."""
        ...

    def start(self) -> FloatArray:
        """Return the place nearest to the base model, (p,)."""
        ...


_WORTH: Final = 0.5  # of square sum: less is not worth new derivatives
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


def unchanged(problem: Problem, empty: C) -> Fitted[C]:
    """Return the base model as a fit of the empty set.

    Args:
        problem: the model and the logs.
        empty: a candidate without parameters.
    """
    residual = problem.marginal(problem.base_residual)
    return Fitted(empty, np.zeros(0), residual, np.zeros((problem.size, 0)))


def fit(problem: Problem, candidate: C, place: FloatArray, *, most: int = 12) -> Fitted[C] | None:
    """Fit a candidate by full simulation, from a place; None where it cannot be simulated.

    Args:
        problem: the model and the logs.
        candidate: what to fit.
        place: the start (p,).
        most: simulations beyond those of the derivatives.
    """
    function = marginal_function(problem, candidate)
    minimum = descend(function, place, most=most)
    if minimum is None:
        return None
    minimum = refined(function, minimum, problem.least_step)
    looked = explored(function, minimum, flat_or(minimum, candidate.stepwise))
    # The refined derivatives, or a look about, may show a way that Broyden's did not.
    again = descend(
        function, looked.place, residual=looked.residual, jacobian=looked.jacobian, most=max(2, most // 3)
    )
    if again is not None and again.cost < minimum.cost - _WORTH:
        minimum = refined(function, again, problem.least_step)
    return Fitted(candidate, minimum.place, minimum.residual, minimum.jacobian)


def marginal_function(problem: Problem, candidate: Candidate) -> Function:
    """Return the marginal residual (N,) of a candidate as a function of its place (p,).

    Args:
        problem: the model and the logs.
        candidate: what is fitted.
    """

    def marginal_residual(place: FloatArray) -> FloatArray | None:
        residual = problem.residual(candidate.model(problem.base, place))
        return None if residual is None else problem.marginal(residual)

    return marginal_residual
