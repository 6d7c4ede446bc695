"""Which sets explain the runs as well as the chosen one: names that these logs cannot tell apart.

With u the difference of two sets' predictions and R the columns of the rollers' scatter
(`ResidualProblem.roller_scatter`), only the residual along u tells the two apart. Its standard deviation is
sqrt(1 + rho^2), where rho = |R'u| / |u|. With z = `tie_sigmas`, a rival that is the truth is therefore
dropped with a probability below Phi(-z), however large u is, if its cost may be larger by z^2 (1 + rho^2).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.adequacy import roller_scatter
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import THRESHOLDS


def tied(
    search: Search, chosen: ScoredSet, same_size: Sequence[ScoredSet], inflation: float
) -> tuple[ScoredSet, ...]:
    """Return the chosen set and those as good, without those that predict the same with more parameters.

    `same_size` are the sets of its size, itself among them; `inflation` is the residual variance of the best
    fit relative to the expected one.
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
    difference = _difference(problem, chosen, rival)
    square = float(difference @ difference)
    if square == 0.0:
        return True
    rho_square = float(np.sum((roller_scatter(problem, chosen.fitted).T @ difference) ** 2)) / square
    # The planar plant tells the two apart without the scatter, which is no reason to drop one of them.
    worse = (float(np.sum((residual + difference) ** 2)) - float(residual @ residual)) / inflation
    allowed += THRESHOLDS.tie_sigmas**2 * rho_square / inflation
    return min(worse, rival.score - chosen.score) <= allowed


def _difference(problem: ResidualProblem, one: ScoredSet, other: ScoredSet) -> FloatArray:
    """Return the marginal residual of another set less that of one, (N,); without scatter if possible."""
    if problem.surrogate_covers((*one.names, *other.names)):
        models = [j.fitted.candidate.model(problem.base, j.fitted.place) for j in (one, other)]
        ours, theirs = (problem.surrogate_residual(model) for model in models)
        if ours is not None and theirs is not None:
            return problem.marginal(theirs - ours)
    return other.fitted.residual - one.fitted.residual


def _tolerance(search: Search, chosen: ScoredSet, rival: ScoredSet, inflation: float) -> float:
    """Return how much worse a rival's score may be, without the rollers' scatter.

    An imperfect formula leaves the square of `formula_error` of what it explains beyond the effects that both
    sets have.
    """
    common = tuple(name for name in chosen.names if name in rival.names)
    rest = search.fitted.get((common, False)) or search.fitted.get((common, True)) or search.base
    explained = max(0.0, rest.cost - chosen.fitted.cost) / inflation
    return THRESHOLDS.tie_sigmas**2 + THRESHOLDS.formula_error**2 * explained


def _repeats(search: Search, one: ScoredSet, other: ScoredSet, inflation: float) -> bool:
    """Return whether a set predicts what another predicts, up to formula errors, with more parameters."""
    if one.names == other.names:
        return True
    more = one.fitted.candidate.parameter_count > other.fitted.candidate.parameter_count
    square = float(np.sum((one.fitted.residual - other.fitted.residual) ** 2)) / inflation
    return more and square < _tolerance(search, other, one, inflation)
