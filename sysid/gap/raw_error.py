"""The plain root mean square of measured minus simulated, before any weighting by noise that lasts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from mecanum_env.units import FloatArray
from sysid.gap.fitted import Fitted
from sysid.gap.observations import Observations
from sysid.gap.problem import Problem

RISES: Final = 1.01
"""Ratio of root mean squares that is a rise; chance moves it by less where there are some hundred samples."""


def raw_rms(problem: Problem, observations: Observations, parts: Sequence[FloatArray], split: str) -> float:
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
            squares += (float(block.weight @ part**2) + block.spread) / scale**2
            weights += float(block.weight.sum())
    return math.sqrt(squares / weights) if weights else math.nan


def fitted_rms(problem: Problem, fitted: Fitted[Any], split: str) -> float:
    """Return `raw_rms` of a fit on the runs of a split that decide.

    Args:
        problem: the model and the runs.
        fitted: a set of effects or the law.
        split: of the runs that count.
    """
    parts = problem.whitener.unwhiten(problem.unmarginal(fitted.residual))
    return raw_rms(problem, problem.observations, parts, split)


def rises(problem: Problem, base: Fitted[Any], fitted: Fitted[Any]) -> bool:
    """Return whether a fit leaves more on the validation runs than the model as it is, in plain numbers.

    What the weights of a small noise, or of the model's own error, make look better is no gain then.

    Args:
        problem: the model and the runs.
        base: the model as it is.
        fitted: a set of effects.
    """
    return fitted_rms(problem, fitted, "validation") > RISES * fitted_rms(problem, base, "validation")
