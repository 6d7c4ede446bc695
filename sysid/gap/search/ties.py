"""Which sets of effects these logs cannot tell from the chosen one."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.drive import FADING
from mecanum_env.effects.friction import COULOMB, DEAD_ZONE_LIKE_IT
from mecanum_env.model import cause_of
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.compare.search_space import EffectSet
from sysid.gap.search.chance import Floor, complete, roller_scatter
from sysid.gap.search.scores import ScoredSet, doubtful, rises
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import THRESHOLDS

_NEEDLESS: Final = 1.0
"""What a parameter that is not needed adds to a score, -2 log density of data that it was not fitted to, on
average. (Akaike's criterion takes 2, since it starts from the data of the fit, in which it gains as much.)"""

_AT_THE_END: Final = 0.01
"""Share of a range within which a value counts as at its end. Assumed."""


def tied(
    search: Search,
    floor: Floor,
    chosen: ScoredSet,
    same_size: Sequence[ScoredSet],
    inflation: float,
    lacking: float = 0.0,
) -> tuple[ScoredSet, ...]:
    """Return the chosen set and those as good, without those that predict the same with more parameters.

    `same_size` are the sets of its size, itself among them; `floor` says what a right model leaves, and
    `inflation` is the residual variance of the best fit relative to the expected one. `lacking` is by how
    much a function without a cause has a better score than the chosen set: so much at least its formula
    lacks, and so much the right one's may lack, too.
    """
    near = [j for j in same_size if j is chosen or _as_good(search, floor, chosen, j, inflation, lacking)]
    near = [j for j in near if j is chosen or not any(_stays_like(search, j, other) for other in near)]
    near.sort(key=lambda j: (j.fitted.candidate.parameter_count, j.score, j.names))
    kept: list[ScoredSet] = []
    for one in near:
        if not any(_repeats(search, one, other, inflation) for other in kept):
            kept.append(one)
    kept.sort(key=lambda j: (j is not chosen, j.score, j.names))
    return tuple(kept)


def friction_first(as_good: Sequence[ScoredSet]) -> tuple[ScoredSet, ...]:
    """Return the sets `as_good` with friction before a dead zone that subtracts, which looks the same.

    The first one is added to the model; all are reported.
    """
    if not as_good:
        return ()
    return tuple(sorted(as_good, key=lambda one: not _is_friction_of(one, as_good[0])))


def _is_friction_of(one: ScoredSet, other: ScoredSet) -> bool:
    """Return whether a set has friction where another one has the dead zone that looks the same."""
    wanted = {COULOMB if name == DEAD_ZONE_LIKE_IT else name for name in other.names}
    return DEAD_ZONE_LIKE_IT in other.names and set(one.names) == wanted


def with_causes(
    search: Search,
    floor: Floor,
    as_good: Sequence[ScoredSet],
    judged: Sequence[ScoredSet],
    inflation: float,
    lacking: float = 0.0,
) -> tuple[ScoredSet, ...]:
    """Return the sets that do as well as those `as_good` without an effect that is only a description.

    Such an effect, a curve of several numbers, stands for what no cause does. If all are such, sets of
    more effects with fewer parameters among those `judged` count, too. None is returned if no set of causes
    does as well. What ties with the best one of them counts as well, though a description may do better by a
    little more than a formula may err. A description that does better than all of these, by as much as a
    free term must (`free_sigmas`), comes last: it may be what there is. `floor`, `inflation` and `lacking`
    are as in `tied`.
    """
    named = tuple(one for one in as_good if not is_description(one))
    if named and is_description(as_good[0]):
        named = _tied_with_best(search, floor, named, judged, inflation, lacking)
    named = named or _simpler_causes(search, floor, as_good, judged, inflation, lacking)
    least = min((one.score for one in named), default=-math.inf) - THRESHOLDS.free_sigmas**2
    return (*named, *(one for one in as_good if is_description(one) and one.score < least))


def _tied_with_best(
    search: Search,
    floor: Floor,
    named: Sequence[ScoredSet],
    judged: Sequence[ScoredSet],
    inflation: float,
    lacking: float,
) -> tuple[ScoredSet, ...]:
    """Return the sets of causes that tie with the best of those `named`, the cheapest one first.

    The price is the cost and what needless parameters take: a set of more parameters that fits no better
    than a simpler one comes behind it.
    """
    best = min(named, key=lambda one: one.score)
    found = tied(search, floor, best, _causes_beside(search, best, judged), inflation, lacking)

    def price(one: ScoredSet) -> float:
        return float(one.fitted.cost / inflation + _NEEDLESS * one.fitted.candidate.parameter_count)

    return tuple(sorted(found, key=price))


def _simpler_causes(
    search: Search,
    floor: Floor,
    as_good: Sequence[ScoredSet],
    judged: Sequence[ScoredSet],
    inflation: float,
    lacking: float,
) -> tuple[ScoredSet, ...]:
    """Return sets of more effects with fewer parameters than descriptions `as_good`, and as good."""
    if not as_good:
        return ()
    problem, best = search.problem, as_good[0]
    simpler = [
        one
        for one in judged
        if len(one.names) > len(best.names)
        and not is_description(one)
        and one.fitted.candidate.parameter_count < best.fitted.candidate.parameter_count
        and _as_good(search, floor, best, one, inflation, lacking)
        and not rises(problem, search.base, one.fitted)
        and not doubtful(problem, one.fitted, inflation)
    ]
    if not simpler:
        return ()
    chosen = min(simpler, key=lambda one: (len(one.names), one.score))
    return tied(search, floor, chosen, _causes_beside(search, chosen, judged), inflation, lacking)


def _causes_beside(search: Search, best: ScoredSet, judged: Sequence[ScoredSet]) -> list[ScoredSet]:
    """Return the sets of causes among those `judged` that are as large as the best one and do no harm."""
    return [
        one
        for one in judged
        if len(one.names) == len(best.names)
        and not is_description(one)
        and not rises(search.problem, search.base, one.fitted)
    ]


def with_fewer(
    search: Search, floor: Floor, as_good: Sequence[ScoredSet], judged: Sequence[ScoredSet], inflation: float
) -> tuple[ScoredSet, ...]:
    """Return the sets `as_good` and, behind them, sets of fewer effects that may only have crude formulas.

    A second effect is often what the formula of the first one lacks. Sets of one size less count, by turns
    down to single effects, that leave at most the square of `crude_formula` of what the chosen set explains,
    unless the chosen set reaches the noise, which imperfect formulas do not, or there is only one formula for
    what they have (`formula_error`). Beside the logs of a robot's fit neither is an objection: what the noise
    is, is known roughly, and the model lacks more than formulas. `judged` are all sets, and `inflation` is as
    in `tied`.
    """
    if not as_good or len(as_good[0].names) == 1:
        return tuple(as_good)
    problem, chosen = search.problem, as_good[0]
    explained = search.base.cost - chosen.fitted.cost
    share = THRESHOLDS.crude_robot_formula if problem.knows_all else THRESHOLDS.crude_formula
    found = list(as_good)
    for size in range(len(chosen.names) - 1, 0, -1):
        near = [
            one
            for one in judged
            if len(one.names) == size
            and one.fitted.cost <= chosen.fitted.cost + share**2 * explained
            and (
                problem.knows_all
                or formula_error(problem, floor, chosen.fitted, one.fitted) == THRESHOLDS.formula_error
            )
            and not is_description(one)
            and not rises(problem, search.base, one.fitted)
            and not doubtful(problem, one.fitted, inflation)
        ]
        found += sorted(near, key=lambda one: (one.score, one.names))
    return tuple(found)


def is_description(one: ScoredSet) -> bool:
    """Return whether a set has an effect that stands for whatever has no simpler name."""
    return any(CATALOGUE[name].search_from is not None for name in one.names if name in CATALOGUE)


def in_first_forms(chosen: ScoredSet, rivals: Sequence[ScoredSet], inflation: float) -> ScoredSet:
    """Return the set that explains the same causes by fewer parameters, or else by more of their first forms.

    Only `rivals` whose score chance may have made worse than that of the `chosen` set count, and whose cost
    is no larger by more than that, either: a score goes along a straight line from where a fit ended, and
    does not show one that ended early. `inflation` is as in `tied`.
    """
    margin = THRESHOLDS.tie_sigmas**2
    alike = [
        one
        for one in rivals
        if one.causes == chosen.causes
        and one.score <= chosen.score + margin
        and one.fitted.cost <= chosen.fitted.cost + margin * inflation
    ]

    def complexity(one: ScoredSet) -> tuple[int, int, float]:
        further_forms = sum(name != cause_of(name) for name in one.names)
        return one.fitted.candidate.parameter_count, further_forms, one.score

    return min(alike, key=complexity, default=chosen)


def formula_error(
    problem: ResidualProblem, floor: Floor, better: Fitted[EffectSet], worse: Fitted[EffectSet]
) -> float:
    """Return the relative error (rms) of formulas that may be all that makes a set worse than a better one.

    If the better one reaches the noise and the other does not, chance would have to give the first one just
    what the other's formulas lack. Nor do the formulas of a factor or a delay lack anything. But where two
    factors are told apart only by what the model does between them, such as its friction, the formulas of
    that may lack something.
    """
    sharp = complete(problem, better, floor) and not complete(problem, worse, floor)
    own = [name for name in worse.names if name not in better.names] or worse.names
    others = [name for name in better.names if name not in worse.names]
    if any(_are_twins(one, other) for one in own for other in others) and problem.bench:
        return THRESHOLDS.formula(beside_fit_of_robot=problem.knows_all)
    if all(name in CATALOGUE and CATALOGUE[name].exact for name in own):
        return THRESHOLDS.exact_formula
    if problem.knows_all or not sharp:
        return THRESHOLDS.formula(beside_fit_of_robot=problem.knows_all)
    return THRESHOLDS.familiar_formula if floor.familiar else THRESHOLDS.exact_formula


def _are_twins(one: str, other: str) -> bool:
    """Return whether no log of a wheel on the bench separates two effects of an ideal drive."""
    known = one in CATALOGUE and other in CATALOGUE
    return known and (other in CATALOGUE[one].bench_twins or one in CATALOGUE[other].bench_twins)


def _as_good(
    search: Search, floor: Floor, chosen: ScoredSet, rival: ScoredSet, inflation: float, lacking: float
) -> bool:
    """Return whether these logs cannot tell a rival from the chosen set.

    With u the difference of two sets' predictions and R the columns of the rollers' scatter, only the
    residual along u tells the two apart. Its standard deviation is sqrt(1 + rho^2), where rho = |R'u| / |u|.
    With z = `tie_sigmas`, a rival that is the truth is therefore dropped with a probability below Phi(-z),
    however large u is, if its cost may be larger by z^2 (1 + rho^2).
    """
    share = formula_error(search.problem, floor, chosen.fitted, rival.fitted)
    allowed = max(_tolerance(search, chosen, rival, inflation, share), lacking)
    if rival.score <= chosen.score + allowed:
        return True
    problem = search.problem
    if not problem.has_surrogate:
        return False
    if problem.knows_all and rival.fitted.cost > search.base.cost - THRESHOLDS.tie_sigmas**2 * inflation:
        # It explains nothing, however much the rollers scatter.
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


def _tolerance(
    search: Search,
    chosen: ScoredSet,
    rival: ScoredSet,
    inflation: float,
    share: float,
) -> float:
    """Return how much worse a rival's score may be, without the rollers' scatter.

    An imperfect formula leaves the square of a `share` of what it explains beyond the effects that both sets
    have.
    """
    rest = search.shared(chosen.names, rival.names)
    explained = max(0.0, rest.cost - chosen.fitted.cost) / inflation
    return THRESHOLDS.tie_sigmas**2 + share**2 * explained


def _stays_like(search: Search, one: ScoredSet, other: ScoredSet) -> bool:
    """Return whether a set has an effect that hardly fades in a run, for what stays in another set.

    The other set has fewer parameters and a score no worse, and shares the other effects. The time constant
    of the effect is as long as its range lets it be (`FADING`): nothing in these logs tells that it fades.
    """
    further = one.fitted.candidate.parameter_count - other.fitted.candidate.parameter_count
    own = set(one.names) - set(other.names)
    if further <= 0 or one.score < other.score or len(own) != 1 or len(one.names) != len(other.names):
        return False
    (name,) = own
    if name not in CATALOGUE or FADING not in CATALOGUE[name].parameters:
        return False
    model = one.fitted.candidate.model(search.problem.base, one.fitted.place)
    # A parameter that the set does not need is left out of it.
    values = CATALOGUE[name].complete(model.effects[name], model)
    longest_s = FADING.scaled(search.problem.settings.scale).bounds[1]
    return bool(values[FADING.name] >= (1.0 - _AT_THE_END) * longest_s)


def _repeats(search: Search, one: ScoredSet, other: ScoredSet, inflation: float) -> bool:
    """Return whether a set predicts what another predicts, up to formula errors, with more parameters.

    Its score must be no better, and that of other causes worse by what needless parameters cost: where they
    cost less, nothing tells which of the two is the truth. Friction, which may answer late, is no repetition
    of a dead zone that looks the same (`friction_first`). Nor is a set that an earlier search of these logs
    told apart from the other: a truth with more parameters may be hidden by the weights of the later one.
    """
    if one.names == other.names:
        return True
    if _is_friction_of(one, other) or one.names in search.told_before:
        return False
    further = one.fitted.candidate.parameter_count - other.fitted.candidate.parameter_count
    margin = 0.0 if one.causes == other.causes else _NEEDLESS * further
    more = further > 0 and one.score >= other.score + margin
    square = float(np.sum((one.fitted.residual - other.fitted.residual) ** 2)) / inflation
    return more and square < _tolerance(search, other, one, inflation, THRESHOLDS.exact_formula)
