"""Whether a further effect is needed where the others already move the robot, beside the logs of the fit.

What a robot's model errs by is learned in the logs of its fit and carried to new logs by what each error
would change there, about the motion of the model as it is. Behind a low limit, or with other wheels, the
robot moves otherwise: the error that is taken off is then too large, and what is left looks like a second
effect, of the gains of the wheels, say. So a set of several effects is judged once more with the error where
the smaller set moves the robot. There the last effect must lower the cost by more than chance and what an
imperfect formula of the others leaves, as when it was added.
"""

from __future__ import annotations

import numpy as np

from sysid.compare.least_squares import Fitted, ResidualProblem, base_fit, fit
from sysid.compare.search_space import EffectSet
from sysid.gap.search.chance import Floor, chance_gains, complete, expected
from sysid.gap.search.sets import EMPTY, Search
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.search.ties import formula_error


def needed(
    search: Search, floor: Floor, chosen: Fitted[EffectSet], inflation: float, rng: np.random.Generator
) -> bool:
    """Return whether a fitted set of a robot's effects needs its last one, and the rest its own last one.

    Of the sets with one effect less that were fitted, the best one is what it must do better than. A third
    effect that is needed beside two says nothing where the second is not needed beside the first. `floor`
    says how often chance may do so, `inflation` is the residual variance of the best fit relative to the
    expected one, and `rng` draws what chance does.
    """
    problem = search.problem
    parts = [f for f in search.of_size(len(chosen.names) - 1) if set(f.names) < set(chosen.names)]
    if not problem.knows_all or len(chosen.names) < 2 or not parts:
        return True
    part = parts[0]
    there = problem.moved(part.candidate.model(problem.base, part.place))
    moved = _again(there, problem, part)
    if moved is None:
        return True
    # Its size was wrong, too, as long as the error was.
    there = problem.moved(part.candidate.model(problem.base, moved.place))
    smaller, larger = (_again(there, problem, fitted) for fitted in (part, chosen))
    if smaller is None or larger is None:
        return True
    chance = chance_gains(
        problem, part, search.library, rng, floor.false_alarm, problem.difference_counts.shared
    )
    least = chance.threshold() * inflation + residue(there, floor, base_fit(there, EMPTY), smaller, larger)
    return smaller.cost - larger.cost >= least and needed(search, floor, part, inflation, rng)


def residue(
    problem: ResidualProblem,
    floor: Floor,
    base: Fitted[EffectSet],
    smaller: Fitted[EffectSet],
    larger: Fitted[EffectSet],
) -> float:
    """Return how much of the cost that a set lowers may be what imperfect formulas of a smaller one leave.

    The residue of an imperfect formula can mimic another effect, and so can that of an imperfect fit. It is
    none of it where the smaller set leaves plainly more than a right model and the larger one does not, or,
    on the bench, so little of it that its last effect would be adequate by itself: one effect hardly has the
    shape of whatever the formula of another lacks. `base` is the fit of no effects.
    """
    if visible(problem, smaller) and (
        complete(problem, larger, floor) or (problem.bench and _removes_the_rest(problem, smaller, larger))
    ):
        return 0.0
    share = formula_error(problem, floor, larger, smaller)
    return share**2 * max(0.0, base.cost - smaller.cost)


def _removes_the_rest(
    problem: ResidualProblem, smaller: Fitted[EffectSet], larger: Fitted[EffectSet]
) -> bool:
    """Return whether a larger set leaves as little of what a smaller one leaves as an adequate effect may."""
    before, after = (fitted.cost - expected(problem, fitted) for fitted in (smaller, larger))
    return after <= THRESHOLDS.adequate_residual**2 * (before - after)


def visible(problem: ResidualProblem, fitted: Fitted[EffectSet]) -> bool:
    """Return whether a set leaves plainly more than a right model would."""
    return fitted.cost > THRESHOLDS.plainly_visible * expected(problem, fitted)


def _again(
    there: ResidualProblem, problem: ResidualProblem, fitted: Fitted[EffectSet]
) -> Fitted[EffectSet] | None:
    """Return a set fitted with the error of another place, from where it was fitted to a `problem`."""
    columns = there.marginal(problem.marginal_inverse(fitted.jacobian))
    return fit(there, fitted.candidate, fitted.place, known=dict(enumerate(columns.T)))
