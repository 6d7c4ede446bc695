"""What a single command sequence of a robot may show by chance, where it drives those of its fit again.

A robot slips in one run now and then as in no other, by more than the scatter of all repeats lets expect. The
new runs of a sequence are compared with the same runs of the fit, so that one of these that was odd shows in
all of them. What one sequence shows by chance is therefore taken to have the wide tails of Student's t, and a
set must explain more than that, or more without its best sequence than chance does.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.compare.search_space import EffectSet
from sysid.gap.search.responses import Response
from sysid.gap.search.scores import group_masks

OF_ONE: Final = 2.0
"""Degrees of freedom of what one sequence shows by chance: so many differences of repeats tell it where the
logs of the fit and the new ones have two runs of each sequence. Assumed for other numbers of runs, too."""


def is_asked(problem: ResidualProblem) -> bool:
    """Return whether it matters in a `problem`: of a robot that drives the commands of its fit again."""
    return problem.knows_all and problem.same_commands


def is_of_one_sequence(
    problem: ResidualProblem,
    base: Fitted[EffectSet],
    fitted: Fitted[EffectSet],
    by_chance: float,
    by_one: float,
) -> bool:
    """Return whether what a set explains is, but for one sequence, no more than chance does.

    It is not where that is not asked in a `problem`. `base` is the model as it is, and `fitted` the set.
    Chance lowers the cost by `by_chance`, and that of one sequence by `by_one`.
    """
    if not is_asked(problem):
        return False
    falls = _of_sequences(problem, base.residual**2 - fitted.residual**2)
    whole = float(np.sum(falls))
    return whole < by_one and whole - float(np.max(falls)) < by_chance


def least_falls(
    problem: ResidualProblem, library: Sequence[Response], by_chance: float, by_one: float
) -> dict[str, float]:
    """Return effect -> fall of the cost that it needs, so that it is not of one sequence.

    `library` holds the responses of the effects in the `problem`; `by_chance` and `by_one` are as in
    `is_of_one_sequence`.
    """
    least: dict[str, float] = {}
    for response in library:
        squares = _of_sequences(problem, response.change**2)
        rest = 1.0 - float(np.max(squares)) / max(float(np.sum(squares)), 1e-300)
        needed = min(by_one, by_chance / rest) if rest > 0.0 else by_one
        least[response.effect] = min(needed, least.get(response.effect, needed))
    return least


def _of_sequences(problem: ResidualProblem, values: FloatArray) -> FloatArray:
    """Return the sum of some `values` (N,) over each command sequence, (sequences,)."""
    return np.array([float(np.sum(values[mask])) for mask in group_masks(problem)])
