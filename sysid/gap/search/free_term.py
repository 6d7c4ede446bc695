"""A free term as the rival of every named set: a smooth function that may describe the difference better.

The free term is a sum of smooth columns (`sysid.compare.model_error.shape`): of the time since a change of
command and its size, of the speed, of the sign of the motion, and of how far the speed is behind its command.
No cause is behind it. It is judged as a set of effects is, by how well it predicts each group of runs from
the others (`sysid.gap.search.scores`). Where it does clearly better than a named set, by more than the
formulas of the set may err, the name is not borne by the data: whatever happened, it is not (only) that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import PRIOR, Fitted, ResidualProblem
from sysid.compare.model_error import ShapeBasis
from sysid.gap.search.scores import ScoredSet, scored

FREE_TERM: Final = "free_term"
_SIZES: Final = (0.05, 0.2, 0.8)
"""Standard deviations that the factors may have, in shares of the change or speed that a column is of; that
which predicts best is taken."""


@dataclass(frozen=True)
class _FreeTerm:
    """The free term as a candidate, which has no model."""

    count: int

    @property
    def names(self) -> tuple[str, ...]:
        """Its name among the sets."""
        return (FREE_TERM,)

    @property
    def parameter_count(self) -> int:
        """Number of its columns."""
        return self.count

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which responses are discontinuous: none."""
        return (False,) * self.count

    @property
    def owners(self) -> tuple[str, ...]:
        """The effects that the columns belong to: none."""
        return ("",) * self.count

    def model(self, base: Model, _unit: FloatArray) -> Model:
        """Return the `base` model: no program simulates the term."""
        return base

    def start(self) -> FloatArray:
        """Return the place without it, (p,)."""
        return np.zeros(self.count)


def free_term(problem: ResidualProblem, residual: FloatArray, inflation: float) -> ScoredSet | None:
    """Return the free term with its score, fitted to a marginal `residual` (N,); None if it has no column.

    `inflation` is the residual variance of the best fit relative to the expected one, as for other sets.
    """
    columns = _columns(problem)
    if not columns.shape[1]:
        return None
    candidate, rivals = _FreeTerm(columns.shape[1]), []
    for size in _SIZES:
        fitted = Fitted(candidate, candidate.start(), residual, -size / PRIOR * columns)
        # Its sizes are not at a minimum: the score says where they would be.
        rivals.append(replace(scored(problem, fitted, inflation), least=-math.inf))
    return min(rivals, key=lambda rival: rival.score)


def _columns(problem: ResidualProblem) -> FloatArray:
    """Return the marginal columns of the term, (N, q), of a factor of 1."""
    observations = problem.observations
    predicted = problem.simulators.full.predictions(problem.base)
    basis = ShapeBasis.of(problem.base, observations, predicted)
    columns = basis.columns(problem.base, observations, predicted)
    if not columns:
        return np.zeros((problem.size, 0))
    blocks = [
        np.stack([columns[key][index] for key in sorted(columns)], axis=1)
        for index in range(len(observations.blocks))
    ]
    return problem.marginal(problem.whitener.whiten(blocks))
