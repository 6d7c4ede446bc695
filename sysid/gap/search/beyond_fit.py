"""Effects that a robot's logs show no more than the logs of the model's fit do, and that are no news.

What an effect would do to first order is among the model's own error, as far as the logs of the fit leave it
open (`sysid.compare.model_error.suspects`). That is not so of a ripple, whose phase differs from run to run,
nor of a limit, a threshold or a curve (`without_first_order`). A model of other rollers, with another
servo, lacks some of each. So these effects are tried in the logs of the fit, too, at whatever size fits best
there.

If an effect is only what the model lacks, each command sequence shows a part of it by chance, and the mean
squares of two sets of m and n sequences have a ratio with the F distribution of m and n degrees of freedom.
An effect is looked for where the fall of the cost for each value is larger in the new logs than in those of
the fit, by whichever form of its cause, by more than that ratio ever is, but for the probability of a false
alarm. With few sequences that takes much more.

A limit or a threshold may act in the new commands alone: the logs of the fit then say nothing of it, and the
robot may well have had it before. So it must also explain more than such effects do in logs of an unchanged
robot (`Thresholds.least_elsewhere`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.stats import f as f_distribution

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import cause_of
from sysid.compare.least_squares import ResidualProblem, base_fit, fit
from sysid.compare.measured import Observations
from sysid.compare.model_error import Learned, RepeatedCommands, as_fitted
from sysid.gap.search.chance import chance_gains
from sysid.gap.search.responses import Growth, Library, Response, growths, responses
from sysid.gap.search.sets import EMPTY
from sysid.gap.search.thresholds import THRESHOLDS


def beyond_fit(problem: ResidualProblem, learned: Learned, library: Sequence[Response]) -> Library:
    """Return which effects of a `library` may be more than the model's own error.

    `problem` is that of a robot's new logs, beside what was `learned` from those of the fit.
    """
    ripples = {r.effect for r in library if CATALOGUE[r.effect].follows_angle}
    rough = dict.fromkeys(without_first_order(library), THRESHOLDS.least_elsewhere * problem.size)
    of_fit = ResidualProblem(learned.model, learned.whitener, problem.settings, learned.simulators, learned)
    return _beyond(problem, of_fit, library, dict.fromkeys(ripples, 0.0) | rough)


def without_first_order(library: Sequence[Response]) -> set[str]:
    """Return the effects of a `library` that may act for the first time where the robot goes faster.

    These are limits and thresholds, of which no small step does anything, whether or not a soft knee has one
    that does; and a curve, which may be such a limit. They are not among the model's own error.
    """
    return {
        response.effect
        for response in library
        if CATALOGUE[response.effect].search_from is not None
        or (not response.linear and not CATALOGUE[response.effect].follows_angle)
    }


def promised_gains(problem: ResidualProblem, library: Sequence[Response]) -> dict[str, float]:
    """Return the fall of the cost that each single effect of a `library` promises, by its name."""
    return {growth.names[0]: gain for growth, gain in _growths(problem, library)}


def ripples_beyond_fit(
    problem: ResidualProblem, repeated: RepeatedCommands, library: Sequence[Response]
) -> Library:
    """Return which ripples of a `library` are more than what the logs of the fit show, beside all others.

    `problem` is that of new logs of a robot beside what was measured in the same commands (`repeated`). What
    a limit or a threshold did there is taken off with the rest; a ripple comes with another phase each time,
    and so is as large in what repeats differ by.
    """
    ripples = {response.effect for response in library if CATALOGUE[response.effect].follows_angle}
    unchanged = repeated.unchanged(problem.base, problem.simulators)
    if unchanged is None:
        model, whitener, simulators = as_fitted(problem.base), repeated.whitener, repeated.simulators
        of_fit = ResidualProblem(model, whitener, problem.settings, simulators)
    else:
        of_fit = ResidualProblem(
            problem.base, problem.whitener, problem.settings, problem.simulators, unchanged
        )
    return _beyond(problem, of_fit, library, dict.fromkeys(ripples, 0.0))


def limits_beyond_luck(problem: ResidualProblem, library: Library, false_alarm: float) -> Library:
    """Return a `library` without limits and thresholds that may be but chance in the repeated commands.

    What they vary by from run to run is not looked for, and other commands do not tell it. `false_alarm` is
    the probability with which chance may do as much.
    """
    unsteady = without_first_order(library.searched)
    own = [response for response in library.searched if response.effect in unsteady]
    rng = np.random.default_rng(problem.settings.seed)
    few = chance_gains(
        problem, base_fit(problem, EMPTY), own, rng, false_alarm, problem.difference_counts.shared
    )
    threshold = few.threshold()
    promised = promised_gains(problem, own)
    small = {name for name in unsteady if promised.get(name, 0.0) < threshold}
    searched = [response for response in library.searched if response.effect not in small]
    left = [response for response in own if response.effect in small]
    least = {name: max(threshold, library.least.get(name, 0.0)) for name in unsteady}
    return Library(searched, [*library.left_out, *left], {**library.least, **least})


def _beyond(
    problem: ResidualProblem,
    of_fit: ResidualProblem,
    library: Sequence[Response],
    least: Mapping[str, float],
) -> Library:
    """Return which effects are more than the logs `of_fit` show, and than the `least` fall of the cost.

    Each effect that may be among the model's own error has such a least fall.
    """
    promised = promised_gains(problem, library)
    asked = [
        name for name, gain in least.items() if promised.get(name, 0.0) > max(THRESHOLDS.tie_sigmas**2, gain)
    ]
    there = _shown_gains(of_fit, asked, library) if asked else {}
    most = largest_ratio(problem.observations, of_fit.observations) * problem.size
    least = {name: max(gain, most * there.get(cause_of(name), 0.0)) for name, gain in least.items()}
    small = {name for name, gain in least.items() if promised.get(name, 0.0) < gain}
    searched = [response for response in library if response.effect not in small]
    return Library(searched, [response for response in library if response.effect in small], least)


def _shown_gains(
    of_fit: ResidualProblem, names: Sequence[str], library: Sequence[Response]
) -> dict[str, float]:
    """Return by how much causes lower the cost in the logs `of_fit`, for each value, by their best form.

    `names` are the effects that are tried there, of the `library` of new logs.
    """
    there: dict[str, float] = {}
    # The residual of the one may show another ripple most than that of the other.
    fixed = [value for response in library for value in response.chosen.fixed]
    per_turn = {int(value) for _, parameter, value in fixed if parameter == "per_turn"}
    tried = responses(of_fit, names, per_turn=per_turn)
    for growth, promised in _growths(of_fit, tried):
        (name,) = growth.names
        shown = of_fit.surrogate_covers([name])
        gain = _shown_gain(of_fit, growth, tried) if shown else promised
        there[cause_of(name)] = max(there.get(cause_of(name), 0.0), gain / of_fit.size)
    return there


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
