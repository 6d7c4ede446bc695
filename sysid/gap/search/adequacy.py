"""What a right model would leave on these runs, and whether a set of effects leaves no more.

It leaves noise, and on robots the rollers' own roughness where it stands (`ResidualProblem.roller_scatter`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.chance import largest_misfit, misfit_p_value

ENOUGH: Final = 0.2
"""Of what a set explains (root mean square) so much may be left beyond chance, and its name still stands.

Of a set of k effects, which can bend more, 1 / sqrt(k) of it."""


@dataclass(frozen=True)
class Floor:
    """What is known of the noise."""

    freedom: float
    """Degrees of freedom of the noise."""
    trusted: bool
    """Whether what a right model leaves is known: else no set can be called inadequate."""
    repeatable: bool = True
    """Whether repeats are alike but for noise: where chance acts on the wheel, no effect is all of it."""


def rough(problem: ResidualProblem, fitted: Fitted[Any]) -> FloatArray:
    """Return `ResidualProblem.roller_scatter` of a fitted set, (N, k).

    Args:
        problem: the model and the runs that decide.
        fitted: where.
    """
    return problem.roller_scatter(fitted.candidate.model(problem.base, fitted.place))


def expected(problem: ResidualProblem, *fitted: Fitted[Any]) -> float:
    """Return the square sum that a right model leaves, by the roughest of some fitted sets.

    Args:
        problem: the model and the runs that decide.
        fitted: one or more.
    """
    return problem.size + max(float(np.sum(rough(problem, one) ** 2)) for one in fitted)


def misfit(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> float:
    """Return how likely a right model leaves as much as a fitted set does; 1 where none can tell.

    Args:
        problem: the model and the runs that decide.
        fitted: the set.
        floor: what is known of the noise.
    """
    if not floor.trusted:
        return 1.0
    share = problem.size / expected(problem, fitted)
    return misfit_p_value(fitted.cost * share, problem.size, floor.freedom)


def complete(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> bool:
    """Return whether a set leaves no more than chance allows.

    Args:
        problem: the model and the runs that decide.
        fitted: the set.
        floor: what is known of the noise.
    """
    return floor.trusted and fitted.cost <= expected(problem, fitted) * largest_misfit(
        problem.size, floor.freedom
    )


def enough(
    problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any], floor: Floor, right: float | None = None
) -> bool:
    """Return whether what a set leaves is what chance allows, or little beside what it explains.

    Args:
        problem: the model and the runs that decide.
        base: the empty set.
        fitted: the set.
        floor: what is known of the noise.
        right: what a right model leaves, if it is known; else it is measured where the set stands.
    """
    if not floor.trusted:
        return True
    right = expected(problem, fitted) if right is None else right
    allowed = right * largest_misfit(problem.size, floor.freedom)
    explained = float(np.sum((base.residual - fitted.residual) ** 2))
    return fitted.cost <= allowed + ENOUGH**2 / max(1, len(fitted.names)) * explained
