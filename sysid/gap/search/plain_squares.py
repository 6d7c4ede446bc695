"""Squared errors of a fit without any whitening: how large, how much larger than expected, how many removed.

Whitened, an error that lasts is in few of many samples, the others being noise; its plain squares are in all.
"""

from __future__ import annotations

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.compare.search_space import EffectSet
from sysid.gap.search.thresholds import THRESHOLDS


def mean_squares(problem: ResidualProblem, fitted: Fitted[EffectSet]) -> float:
    """Return the sum of squared errors, each a mean over repeats, in variances of such a mean."""
    return _squares(problem, problem.marginal_inverse(fitted.residual))


def plainly_larger(problem: ResidualProblem, base: Fitted[EffectSet]) -> bool:
    """Return whether the squared errors are plainly larger than a right model's, without any whitening.

    The cost of many samples of noise hides an error that is slow: whitened, it is in few of them.
    """
    return plain_ratio(problem, base) > THRESHOLDS.plainly_visible


def plain_ratio(problem: ResidualProblem, base: Fitted[EffectSet]) -> float:
    """Return how many times larger than a right model's the squared errors are, without any whitening.

    The model must err as much without what the logs of its fit say of its error: in commands far from theirs
    this correction may be wrong by more than the model is.
    """
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    unknown = problem.whitener.unwhiten(problem.nuisance)
    parts = zip(blocks, problem.whitener.expected_squares(), unknown, strict=True)
    right = sum(
        float(block.weight @ (squares + np.sum(columns**2, axis=1))) / noise[block.channel] ** 2
        for block, squares, columns in parts
    )
    uncorrected = _squares(problem, problem.base_residual + problem.correction)
    return min(mean_squares(problem, base), uncorrected) / right


def noise_ratio(problem: ResidualProblem, base: Fitted[EffectSet]) -> float:
    """Return the mean squared error over single samples in noise variances, 1 for a right model."""
    return _sample_squares(problem, base) / sum(float(b.weight.sum()) for b in problem.observations.blocks)


def removed(problem: ResidualProblem, base: Fitted[EffectSet], chosen: Fitted[EffectSet]) -> float:
    """Return the share of the squared difference above the noise that a set removes, sample by sample."""
    before, after = (mean_squares(problem, fitted) - problem.size for fitted in (base, chosen))
    return (before - after) / before if before > 0.0 else 0.0


def removed_of_all(problem: ResidualProblem, base: Fitted[EffectSet], chosen: Fitted[EffectSet]) -> float:
    """Return the share of the squared errors of single samples that a set removes.

    What differs between repeats of a command is part of these errors, not noise, and no set can remove it.
    """
    before, after = (mean_squares(problem, fitted) for fitted in (base, chosen))
    whole = _sample_squares(problem, base)
    return (before - after) / whole if whole > 0.0 else 0.0


def _sample_squares(problem: ResidualProblem, fitted: Fitted[EffectSet]) -> float:
    """Return the sum of squared errors of single samples, repeats included, in noise variances."""
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    spread = sum(block.repeat_squares / noise[block.channel] ** 2 for block in blocks)
    return mean_squares(problem, fitted) + spread


def _squares(problem: ResidualProblem, residual: FloatArray) -> float:
    """Return the squares of a whitened residual (N,) as `mean_squares` counts them."""
    noise, blocks = problem.whitener.noise.sigma, problem.observations.blocks
    both = zip(blocks, problem.whitener.unwhiten(residual), strict=True)
    return sum(float(block.weight @ part**2) / noise[block.channel] ** 2 for block, part in both)
