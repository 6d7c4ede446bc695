"""Squared errors of a fit without any whitening: how large, how much larger than expected, how many removed.

Whitened, an error that lasts is in few of many samples, the others being noise; its plain squares are in all.
"""

from __future__ import annotations

import numpy as np

from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.compare.search_space import EffectSet
from sysid.gap.search.thresholds import THRESHOLDS


def mean_squares(problem: ResidualProblem, fitted: Fitted[EffectSet]) -> float:
    """Return the sum of squared errors, each a mean over repeats, in variances of such a mean."""
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    parts = problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
    both = zip(blocks, parts, strict=True)
    return sum(float(block.weight @ part**2) / noise[block.channel] ** 2 for block, part in both)


def plainly_larger(problem: ResidualProblem, base: Fitted[EffectSet]) -> bool:
    """Return whether the squared errors are plainly larger than a right model's, without any whitening.

    The cost of many samples of noise hides an error that is slow: whitened, it is in few of them.
    """
    return mean_squares(problem, base) > THRESHOLDS.plainly_visible * right_squares(problem)


def right_squares(problem: ResidualProblem) -> float:
    """Return the `mean_squares` that are expected of a right model."""
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    unknown = problem.whitener.unwhiten(problem.nuisance)
    parts = zip(blocks, problem.whitener.expected_squares(), unknown, strict=True)
    return sum(
        float(block.weight @ (squares + np.sum(columns**2, axis=1))) / noise[block.channel] ** 2
        for block, squares, columns in parts
    )


def noise_ratio(problem: ResidualProblem, base: Fitted[EffectSet]) -> float:
    """Return the mean squared error over single samples in noise variances, 1 for a right model."""
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    spread = sum(b.repeat_squares / noise[b.channel] ** 2 for b in blocks)
    return (mean_squares(problem, base) + spread) / sum(float(b.weight.sum()) for b in blocks)


def removed(problem: ResidualProblem, base: Fitted[EffectSet], chosen: Fitted[EffectSet]) -> float:
    """Return the share of the squared difference above the noise that a set removes, sample by sample."""
    before, after = (mean_squares(problem, fitted) - problem.size for fitted in (base, chosen))
    return (before - after) / before if before > 0.0 else 0.0
