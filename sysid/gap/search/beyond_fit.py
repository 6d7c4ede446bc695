"""Effects that a robot's logs show no more than the logs of the model's fit do, and that are no news.

What an effect would do to first order is among the model's own error, as far as the logs of the fit leave it
open (`sysid.compare.model_error.suspects`). That is not so of a ripple, whose phase differs from run to run,
nor of a limit or a threshold, which has no first order. A model of other rollers, with another servo, lacks
some of each. So these effects are tried in the logs of the fit, too, at whatever size fits best there.

If an effect is only what the model lacks, each command sequence shows a part of it by chance, and the mean
squares of two sets of m and n sequences have a ratio with the F distribution of m and n degrees of freedom.
An effect is looked for where the fall of the cost for each value is larger in the new logs than in those of
the fit, by whichever form of its cause, by more than that ratio ever is, but for the probability of a false
alarm. With few sequences that takes much more.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from scipy.stats import f as f_distribution

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import cause_of
from sysid.compare.least_squares import ResidualProblem, base_fit, fit
from sysid.compare.measured import Observations
from sysid.compare.model_error import Learned, RepeatedCommands, as_fitted
from sysid.gap.search.responses import Growth, Response, growths, responses
from sysid.gap.search.sets import EMPTY
from sysid.gap.search.thresholds import THRESHOLDS


def beyond_fit(problem: ResidualProblem, learned: Learned, library: Sequence[Response]) -> list[Response]:
    """Return the responses of a `library` without those of effects that the logs of the fit show as much.

    `problem` is that of a robot's new logs, beside what was `learned` from those of the fit.
    """
    first_order = {r.effect for r in library if r.linear and not CATALOGUE[r.effect].follows_angle}
    asked = {response.effect for response in library} - first_order
    of_fit = ResidualProblem(learned.model, learned.whitener, problem.settings, learned.simulators, learned)
    return _without_known(problem, of_fit, library, asked)


def ripples_beyond_fit(
    problem: ResidualProblem, repeated: RepeatedCommands, library: Sequence[Response]
) -> list[Response]:
    """Return the responses of a `library` without ripples that the logs of the fit show as much.

    `problem` is that of new logs of a robot beside what was measured in the same commands (`repeated`). What
    a limit or a threshold did there is taken off with the rest; a ripple comes with another phase each time,
    and so is as large in what repeats differ by.
    """
    asked = {response.effect for response in library if CATALOGUE[response.effect].follows_angle}
    unchanged = repeated.unchanged(problem.base, problem.simulators)
    if unchanged is None:
        model, whitener, simulators = as_fitted(problem.base), repeated.whitener, repeated.simulators
        of_fit = ResidualProblem(model, whitener, problem.settings, simulators)
    else:
        of_fit = ResidualProblem(
            problem.base, problem.whitener, problem.settings, problem.simulators, unchanged
        )
    return _without_known(problem, of_fit, library, asked)


def _without_known(
    problem: ResidualProblem, of_fit: ResidualProblem, library: Sequence[Response], effects: Collection[str]
) -> list[Response]:
    """Return the responses of a `library` without those of `effects` that the logs `of_fit` show as much."""
    asked = {
        growth.names[0]: gain / problem.size
        for growth, gain in _growths(problem, library)
        if growth.names[0] in effects and gain > THRESHOLDS.tie_sigmas**2
    }
    if not asked:
        return list(library)
    largest = largest_ratio(problem.observations, of_fit.observations)
    there: dict[str, float] = {}
    # The residual of the one may show another ripple most than that of the other.
    fixed = [value for response in library for value in response.chosen.fixed]
    per_turn = {int(value) for _, parameter, value in fixed if parameter == "per_turn"}
    tried = responses(of_fit, list(asked), per_turn=per_turn)
    for growth, promised in _growths(of_fit, tried):
        (name,) = growth.names
        shown = of_fit.surrogate_covers([name])
        gain = _shown_gain(of_fit, growth, tried) if shown else promised
        there[cause_of(name)] = max(there.get(cause_of(name), 0.0), gain / of_fit.size)
    known = {name for name, gain in asked.items() if gain < largest * there.get(cause_of(name), 0.0)}
    return [response for response in library if response.effect not in known]


def largest_ratio(new: Observations, of_fit: Observations) -> float:
    """Return by how much more an error of the model may show in `new` logs than in those of its fit."""
    sequences = [len({situation.group for situation in one.situations}) for one in (new, of_fit)]
    return float(f_distribution.isf(THRESHOLDS.false_alarm, *sequences))


def _shown_gain(problem: ResidualProblem, growth: Growth, tried: Sequence[Response]) -> float:
    """Return how much an effect lowers the cost: fitted from a growth, or at a size that was simulated.

    Where it is not proportional to its size, what the screening promises may be far more. `tried` are the
    responses of all effects.
    """
    parent, (name,) = growth.parent, growth.names
    sizes = [parent.residual + r.change for r in tried if r.effect == name and not r.linear]
    costs = [parent.cost, *(float(residual @ residual) for residual in sizes)]
    found = fit(problem, growth.candidate, growth.place)
    return parent.cost - min(costs if found is None else [*costs, found.cost])


def _growths(problem: ResidualProblem, library: Sequence[Response]) -> list[tuple[Growth, float]]:
    """Return the single effects of a `library`, each with the fall of the cost that it promises."""
    base = base_fit(problem, EMPTY)
    found = growths(problem.base, base, library, problem.settings.scale, wary=True)
    return [(growth, base.cost - growth.expected) for growth in found]
