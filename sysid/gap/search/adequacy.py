"""What a right model would leave on these runs, and whether a set of effects leaves no more.

It leaves noise and, on robots, the scatter of the rollers at the place of the set. The noise variance is
estimated from finitely many samples, so that the ratio of a cost to it follows an F distribution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import f as f_distribution

from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.thresholds import THRESHOLDS

_KNOWN: Final = 1e7
"""Degrees of freedom of a variance that is known exactly, as the F distribution takes them."""


@dataclass(frozen=True)
class Floor:
    """What is known of the noise floor."""

    freedom: float
    """Degrees of freedom of the estimated noise variance."""
    trusted: bool
    """Whether it is known what a right model leaves; if not, no set can be called inadequate."""
    repeatable: bool = True
    """Whether repeats differ by no more than noise; if not, something random acts on the wheel."""

    def largest_ratio(self, size: int) -> float:
        """Return the cost over `size` values that a right model exceeds in a false alarm."""
        return float(f_distribution.isf(THRESHOLDS.false_alarm, size, min(self.freedom, _KNOWN)))


def roller_scatter(problem: ResidualProblem, fitted: Fitted[Any]) -> FloatArray:
    """Return the columns of the rollers' scatter at the place of a set, (N, k), each one sigma."""
    return problem.roller_scatter(fitted.candidate.model(problem.base, fitted.place))


def expected(problem: ResidualProblem, *fitted: Fitted[Any]) -> float:
    """Return the cost that a right model has, with the largest roller scatter of some fitted sets."""
    return problem.size + max(float(np.sum(roller_scatter(problem, one) ** 2)) for one in fitted)


def misfit(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> float:
    """Return the probability that a right model has at least the cost of a set; 1 if nobody can tell."""
    if not floor.trusted:
        return 1.0
    ratio = fitted.cost * (problem.size / expected(problem, fitted)) / problem.size
    return float(f_distribution.sf(ratio, problem.size, min(floor.freedom, _KNOWN)))


def complete(problem: ResidualProblem, fitted: Fitted[Any], floor: Floor) -> bool:
    """Return whether a set leaves no more than a right model would."""
    return floor.trusted and fitted.cost <= expected(problem, fitted) * floor.largest_ratio(problem.size)


def enough(
    problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any], floor: Floor, right: float | None = None
) -> bool:
    """Return whether a set leaves what a right model would, or little beside what the set explains.

    `right` is the cost of a right model, by default measured at the place of the set.
    """
    if not floor.trusted:
        return True
    right = expected(problem, fitted) if right is None else right
    allowed = right * floor.largest_ratio(problem.size)
    explained = float(np.sum((base.residual - fitted.residual) ** 2))
    share = THRESHOLDS.adequate_residual**2 / max(1, len(fitted.names))
    return fitted.cost <= allowed + share * explained
