"""How sure the parameters of a fitted set are."""

from __future__ import annotations

from typing import Final

import numpy as np
from scipy.stats import chi2, norm, t

from mecanum_env.units import FloatArray
from sysid.gap.coordinates import EffectSet
from sysid.gap.descent import Minimum, flat_or, reach
from sysid.gap.fitted import Fitted, function_near, marginal_function
from sysid.gap.problem import Problem
from sysid.gap.scores import group_masks

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
    problem: Problem, fitted: Fitted[EffectSet], inflation: float
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
    quick = problem.quick_ones(fitted.candidate.owners)
    for i in np.flatnonzero(flat_or(minimum, fitted.candidate.stepwise)):
        down, up = reach(near if quick[i] else full, minimum, int(i), chi2.ppf(LEVEL, 1) * inflation)
        low[i], high[i] = fitted.place[i] - down, fitted.place[i] + up
    return low, high


def doubtful(problem: Problem, fitted: Fitted[EffectSet], inflation: float) -> tuple[str, ...]:
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
