"""How well each group of runs is predicted from the others: the score that decides between sets.

With the residual linear in the parameters p and the model's own error z about the fit,

    r = r0 + J theta,    theta = (p, z),    J = (Jp, -X),    theta ~ N(0, prior),

the predictive density of a group g given all others is normal, with

    r_g = r0_g + J_g m,   C_g = I + J_g H^-1 J_g',   H = J_o' J_o + prior^-1,   m = -H^-1 J_o' r0_o,

o being the other groups. The score is the sum over the groups of r_g' C_g^-1 r_g + log |C_g|: minus twice
the log predictive density by leave-one-group-out cross-validation (for its use: Vehtari, Gelman and Gabry,
Statistics and Computing 27:1413, 2017). A needless parameter costs, a needed one gains.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.gap.fitted import PRIOR, Fitted
from sysid.gap.problem import Problem

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Judged:
    """A fitted set with its scores."""

    fitted: Fitted[Any]
    scores: FloatArray
    """One a group."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.fitted.names

    @property
    def score(self) -> float:
        """Sum over the groups."""
        return total(self.scores)


def group_masks(problem: Problem) -> dict[str, Mask]:
    """Return group -> which of the N values belong to it."""
    masks: dict[str, Mask] = {}
    observations = problem.observations
    for block, place in zip(observations.blocks, problem.whitener.slices, strict=True):
        group = observations.situations[block.situation].group
        masks.setdefault(group, np.zeros(problem.size, bool))[place] = True
    return masks


def group_scores(
    problem: Problem, fitted: Fitted[Any], masks: Mapping[str, Mask], inflation: float = 1.0
) -> FloatArray:
    """Return the score of each group, in the order of `masks`; lower is better.

    Args:
        problem: the model and the logs.
        fitted: a fit to all groups.
        masks: group -> which of the N values belong to it.
        inflation: of the variance of everything, where the best fit leaves more than expected.
    """
    residual = problem.unmarginal(fitted.residual)
    own = problem.unmarginal(fitted.jacobian)
    columns = np.concatenate([own, -problem.nuisance], axis=1) / np.sqrt(inflation)
    residual = residual / np.sqrt(inflation)
    p = own.shape[1]
    prior = np.concatenate([np.full(p, 1.0 / PRIOR**2), np.full(columns.shape[1] - p, 1.0 / inflation)])
    normal = columns.T @ columns + np.diag(prior)
    gradient = columns.T @ residual
    scores = []
    for mask in masks.values():
        ours, left = columns[mask], residual[mask]
        information = normal - ours.T @ ours
        factor = np.linalg.cholesky(information)
        mean = -np.linalg.solve(information, gradient - ours.T @ left)
        predicted = left + ours @ mean
        # (I + J H^-1 J')^-1 by Woodbury, and its determinant by Sylvester.
        whole = np.linalg.cholesky(normal)
        half = np.linalg.solve(whole, ours.T @ predicted)
        square = float(predicted @ predicted - half @ half)
        logarithm = 2.0 * float(np.sum(np.log(np.diag(whole))) - np.sum(np.log(np.diag(factor))))
        scores.append(square + logarithm)
    return np.array(scores)


def total(scores: Sequence[float] | FloatArray) -> float:
    """Return the sum of group scores."""
    return float(np.sum(scores))
