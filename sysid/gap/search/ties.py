"""Which sets explain the runs as well as the chosen one: names that these logs cannot tell apart.

With u the difference of two sets' predictions and R the columns of the rollers' roughness
(`ResidualProblem.roller_scatter`), what tells the two apart is the residual along u, which chance moves by
sqrt(1 + rho^2) sigmas, rho = |R'u| /
|u|. If the rival is the truth, it is dropped with a probability below Phi(-NEVER), however large u is, where
its square sum may be larger by NEVER^2 (1 + rho^2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.adequacy import rough
from sysid.gap.search.chance import NEVER
from sysid.gap.search.scores import FORMULA_ERROR, ScoredSet
from sysid.gap.search.sets import Search


def tied(
    search: Search, chosen: ScoredSet, same_size: Sequence[ScoredSet], inflation: float
) -> tuple[ScoredSet, ...]:
    """Return the chosen set and those as good, without those that say the same with more parameters.

    Args:
        search: what was fitted.
        chosen: the set with the best score.
        same_size: sets of its size, itself among them.
        inflation: of the variance of everything.
    """
    near = [j for j in same_size if j is chosen or _as_good(search, chosen, j, inflation)]
    near.sort(key=lambda j: (j.fitted.candidate.parameter_count, j.score, j.names))
    kept: list[ScoredSet] = []
    for one in near:
        if not any(_repeats(search, one, other, inflation) for other in kept):
            kept.append(one)
    kept.sort(key=lambda j: (j is not chosen, j.score, j.names))
    return tuple(kept)


def _as_good(search: Search, chosen: ScoredSet, rival: ScoredSet, inflation: float) -> bool:
    allowed = _tolerance(search, chosen, rival, inflation)
    if rival.score <= chosen.score + allowed:
        return True
    problem = search.problem
    if not problem.has_surrogate:
        return False
    residual = chosen.fitted.residual
    apart = _apart(problem, chosen, rival)
    square = float(apart @ apart)
    if square == 0.0:
        return True
    chance = float(np.sum((rough(problem, chosen.fitted).T @ apart) ** 2)) / square
    # The same roughness for both, where a quick simulation tells them apart: it is no reason to drop one.
    worse = (float(np.sum((residual + apart) ** 2)) - float(residual @ residual)) / inflation
    return min(worse, rival.score - chosen.score) <= allowed + NEVER**2 * chance / inflation


def _apart(problem: ResidualProblem, one: ScoredSet, other: ScoredSet) -> FloatArray:
    """Return how another set's marginal residual differs, (N,); without roughness if possible."""
    if problem.surrogate_covers((*one.names, *other.names)):
        models = [j.fitted.candidate.model(problem.base, j.fitted.place) for j in (one, other)]
        here, there = (problem.surrogate_residual(model) for model in models)
        if here is not None and there is not None:
            return problem.marginal(there - here)
    return other.fitted.residual - one.fitted.residual


def _tolerance(search: Search, chosen: ScoredSet, rival: ScoredSet, inflation: float) -> float:
    """Return how much worse a rival's score may be, roughness aside.

    A formula that is right to `FORMULA_ERROR` leaves its square of what it explains beyond the effects that
    both sets have.
    """
    common = tuple(name for name in chosen.names if name in rival.names)
    rest = search.fitted.get((common, False)) or search.fitted.get((common, True)) or search.base
    explained = max(0.0, rest.cost - chosen.fitted.cost) / inflation
    return NEVER**2 + FORMULA_ERROR**2 * explained


def _repeats(search: Search, one: ScoredSet, other: ScoredSet, inflation: float) -> bool:
    """Return whether a set says what another says, as far as formulas go, with more parameters."""
    if one.names == other.names:
        return True
    more = one.fitted.candidate.parameter_count > other.fitted.candidate.parameter_count
    apart = float(np.sum((one.fitted.residual - other.fitted.residual) ** 2)) / inflation
    return more and apart < _tolerance(search, other, one, inflation)
