"""How well each group of runs is predicted from the others: the score that decides between sets.

With the residual linear in the parameters p and the model's own error z about the fit,

    r = r0 + J theta,    theta = (p, z),    J = (Jp, -X),    theta ~ N(0, prior),

the predictive density of a group g given all others is normal, with

    r_g = r0_g + J_g m,   C_g = I + J_g H^-1 J_g',   H = J_o' J_o + prior^-1,   m = -H^-1 J_o' r0_o,

o being the other groups. The score is the sum over the groups of r_g' C_g^-1 r_g + log |C_g|: minus twice
the log predictive density by leave-one-group-out cross-validation (for its use: Vehtari, Gelman and Gabry,
Statistics and Computing 27:1413, 2017). A needless parameter costs, a needed one gains.

The plain root mean square of measured minus simulated, before any weighting by noise that lasts.

How sure the parameters of a fitted set are.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2, norm, t

from mecanum_env.units import FloatArray
from sysid.compare.descent import Minimum, derivative_free, reach
from sysid.compare.fitted import PRIOR, Fitted, function_near, marginal_function
from sysid.compare.observations import Observations
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.coordinates import EffectSet

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ScoredSet:
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


def group_masks(problem: ResidualProblem) -> dict[str, Mask]:
    """Return group -> which of the N values belong to it."""
    masks: dict[str, Mask] = {}
    observations = problem.observations
    for block, place in zip(observations.blocks, problem.whitener.slices, strict=True):
        group = observations.situations[block.situation].group
        masks.setdefault(group, np.zeros(problem.size, bool))[place] = True
    return masks


def group_scores(
    problem: ResidualProblem, fitted: Fitted[Any], masks: Mapping[str, Mask], inflation: float = 1.0
) -> FloatArray:
    """Return the score of each group, in the order of `masks`; lower is better.

    Args:
        problem: the model and the logs.
        fitted: a fit to all groups.
        masks: group -> which of the N values belong to it.
        inflation: of the variance of everything, where the best fit leaves more than expected.
    """
    residual = problem.marginal_inverse(fitted.residual)
    own = problem.marginal_inverse(fitted.jacobian)
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


RISES: Final = 1.01
"""Ratio of root mean squares that is a rise; chance moves it by less where there are some hundred samples."""


def raw_rms(
    problem: ResidualProblem, observations: Observations, parts: Sequence[FloatArray], split: str
) -> float:
    """Return the rms of a residual over single samples, repeats' spread included; NaN without such runs.

    In the channel's unit where there is one channel, else over the noise.

    Args:
        problem: whose noise counts.
        observations: what the residual is of.
        parts: measured minus simulated, one array (m,) a block.
        split: of the runs that count.
    """
    alone = len(problem.observations.channels) == 1
    squares = weights = 0.0
    for block, part in zip(observations.blocks, parts, strict=True):
        if observations.situations[block.situation].split == split:
            scale = 1.0 if alone else problem.whitener.noise.sigma[block.channel]
            squares += (float(block.weight @ part**2) + block.repeat_squares) / scale**2
            weights += float(block.weight.sum())
    return math.sqrt(squares / weights) if weights else math.nan


def fitted_rms(problem: ResidualProblem, fitted: Fitted[Any], split: str) -> float:
    """Return `raw_rms` of a fit on the runs of a split that decide.

    Args:
        problem: the model and the runs.
        fitted: a set of effects or the law.
        split: of the runs that count.
    """
    parts = problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
    return raw_rms(problem, problem.observations, parts, split)


def rises(problem: ResidualProblem, base: Fitted[Any], fitted: Fitted[Any]) -> bool:
    """Return whether a fit leaves more on the validation runs than the model as it is, in plain numbers.

    What the weights of a small noise, or of the model's own error, make look better is no gain then.

    Args:
        problem: the model and the runs.
        base: the model as it is.
        fitted: a set of effects.
    """
    return fitted_rms(problem, fitted, "validation") > RISES * fitted_rms(problem, base, "validation")


LEVEL: Final = 0.9
"""Of the intervals."""
SYSTEMATIC: Final = 0.25
"""Correlation that what is left beyond chance, or a formula's error, may have with a parameter's response.

It moves the estimate in all groups alike, so that they do not show it.
"""
FORMULA_ERROR: Final = 0.1
"""Relative error that an effect's formula may have."""
FEWEST_GROUPS: Final = 4
"""Fewer say too little about how much they differ."""


def interval_ends(
    problem: ResidualProblem, fitted: Fitted[EffectSet], inflation: float
) -> tuple[FloatArray, FloatArray]:
    """Return the lower and upper ends of the 90 % intervals, each (p,), on the scale 0 .. 1.

    An interval is the wider of two: that of the linearised fit, with noise, the model's own error, the
    inflation and what is left (`SYSTEMATIC`) in it; and that of the groups, from how much each of them would
    move the estimate (Liang and Zeger, Biometrika 73:13, 1986), which knows nothing of what the errors are
    like. Where the square sum has no slope (a threshold between two commands) it reaches as far as the square
    sum does not rise.

    Args:
        problem: the model and the runs that decided.
        fitted: a set of effects.
        inflation: of the variance of everything.
    """
    tail = 0.5 * (1.0 + LEVEL)
    explained = float(np.sum((problem.marginal(problem.base_residual) - fitted.residual) ** 2))
    left = max(0.0, fitted.cost - problem.size) + FORMULA_ERROR**2 * explained
    half = norm.ppf(tail) * np.sqrt(np.diag(fitted.covariance(inflation + SYSTEMATIC**2 * left)))
    masks = list(group_masks(problem).values())
    if len(masks) >= FEWEST_GROUPS:
        pulls = np.array([fitted.jacobian[mask].T @ fitted.residual[mask] for mask in masks])
        moves = pulls @ fitted.covariance()
        spread = np.sqrt(np.sum(moves**2, axis=0) * len(masks) / (len(masks) - 1))
        half = np.maximum(half, t.ppf(tail, len(masks) - 1) * spread)
    low, high = fitted.place - half, fitted.place + half
    minimum = Minimum(fitted.place, fitted.residual, fitted.jacobian, 0)
    near = function_near(problem, fitted.candidate, fitted.place, fitted.residual, fitted.jacobian)
    full = marginal_function(problem, fitted.candidate)
    quick = problem.surrogate_mask(fitted.candidate.owners)
    for i in np.flatnonzero(derivative_free(minimum, fitted.candidate.stepwise)):
        down, up = reach(near if quick[i] else full, minimum, int(i), chi2.ppf(LEVEL, 1) * inflation)
        low[i], high[i] = fitted.place[i] - down, fitted.place[i] + up
    return low, high


def doubtful(problem: ResidualProblem, fitted: Fitted[EffectSet], inflation: float) -> tuple[str, ...]:
    """Return the effects of a set of which no parameter is surely away from neutral.

    Args:
        problem: the model and the runs that decided.
        fitted: a set of effects.
        inflation: of the variance of everything.
    """
    low, high = interval_ends(problem, fitted, inflation)
    neutral = fitted.candidate.start()
    clear = (neutral < low) | (neutral > high)
    owners = fitted.candidate.owners
    sure = {effect for effect, is_clear in zip(owners, clear, strict=True) if is_clear}
    return tuple(name for name in fitted.names if name not in sure)
