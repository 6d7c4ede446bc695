"""Whether an effect is new since the model was fitted: a comparison with the logs of the fit.

Two explanations of an effect that was found in new logs compete: it came later, or it was there already and
the fit left it out. In the first case the logs of the fit are explained by the law without it; in the second
by a law beside it. Both laws are fitted again, and must hold in the new logs, too. The smaller sum of the
costs of both sets of logs decides. Where the sums are alike, as for a limit that the logs of the fit never
reach, the logs do not tell.

Effects that were there already are put into the model, with the law fitted again beside them, and the study
is repeated: what is left is new.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.stats import norm

from mecanum_env.model import Model
from sysid.compare.least_squares import Fitted, ResidualProblem, fit
from sysid.compare.model_error import Learned, as_fitted
from sysid.compare.search_space import Bounds, EffectSet, LawWithEffects, RefittedLaw
from sysid.gap.result import Since
from sysid.gap.search.thresholds import THRESHOLDS

_LAW_STEPS: Final = 8
_JOINT_STEPS: Final = 20


def since_of(problem: ResidualProblem, learned: Learned, chosen: Fitted[EffectSet]) -> dict[str, Since]:
    """Return for each effect of a set, fitted to a `problem`, whether the logs of the model's fit show it.

    `learned` is what these logs taught about the model.
    """
    whole = chosen.candidate.model(learned.model, chosen.place)
    model = as_fitted(learned.model)
    without = _law_beside(learned, model)
    found: dict[str, Since] = dict.fromkeys(chosen.names, "unknown")
    if without is None:
        return found
    # Not the cost of the set: whenever the effect came, a law fitted again may serve the new logs better.
    later = _cost(problem, without.candidate.model(whole, without.place))
    for name in chosen.names:
        # Beside the effects of the model, this one alone; it takes the place of another form of its cause.
        own = EffectSet((name,), ()).model(model, ()).with_effect(name, **whole.effects[name])
        beside = _law_beside(learned, own)
        if beside is None:
            continue
        there = _cost(problem, beside.candidate.model(whole, beside.place))
        rise = beside.cost + there - without.cost - later
        if math.isfinite(rise) and abs(rise) > THRESHOLDS.tie_sigmas**2:
            found[name] = "new" if rise > 0.0 else "already when fitted"
    return found


def since_of_robot(problem: ResidualProblem, learned: Learned, chosen: Fitted[EffectSet]) -> dict[str, Since]:
    """Return for each effect of a set, fitted to a robot's `problem`, whether the logs of its fit exclude it.

    What they show of every effect is taken off, so that none was there already. But where they say nothing
    of it, as of a limit that they never reach, the robot may have had it before.
    """
    settings = learned.simulators.full.settings
    of_fit = ResidualProblem(learned.model, learned.whitener, settings, learned.simulators, learned)
    before = _cost(of_fit, learned.model)
    values = chosen.candidate.model(problem.base, chosen.place).effects
    found: dict[str, Since] = {}
    for name in chosen.names:
        own = EffectSet((name,), ()).model(learned.model, ()).with_effect(name, **values[name])
        rise = _cost(of_fit, own) - before
        found[name] = "new" if rise > THRESHOLDS.tie_sigmas**2 else "unknown"
    return found


def _cost(problem: ResidualProblem, model: Model) -> float:
    """Return the cost of a model in the logs of a `problem`, infinite if it cannot be simulated."""
    residual = problem.residual(model)
    return math.inf if residual is None else float(np.sum(problem.marginal(residual) ** 2))


@dataclass(frozen=True, eq=False)
class Completion:
    """A model with effects that the logs of its fit show, which it lacked."""

    model: Model
    effects: dict[str, dict[str, Bounds]]
    """Effect -> parameter -> value and the ends of its 90 % interval, from the logs of the fit."""


def completed(learned: Learned, chosen: Fitted[EffectSet], names: Sequence[str]) -> Completion | None:
    """Return the model with the effects `names` of a set, fitted with the law to the logs of the model's fit.

    Returns None where that does not explain these logs better than the law alone, fitted again.
    """
    model = learned.model
    mine = [index for index, owner in enumerate(chosen.candidate.owners) if owner in names]
    effects = EffectSet(
        tuple(name for name in chosen.names if name in names),
        tuple(chosen.candidate.coordinates[index] for index in mine),
        tuple(one for one in chosen.candidate.fixed if one[0] in names),
    )
    candidate = LawWithEffects(RefittedLaw(model), effects)
    start = np.concatenate([candidate.law.start(), chosen.place[mine]])
    then = as_fitted(model)
    found = fit(_problem(learned, then), candidate, start, most=_JOINT_STEPS)
    without = _law_beside(learned, then)
    if found is None or without is None or found.cost > without.cost - THRESHOLDS.tie_sigmas**2:
        return None
    count = candidate.law.parameter_count
    tail = 0.5 * (1.0 + THRESHOLDS.interval_level)
    half = norm.ppf(tail) * np.sqrt(np.diag(found.covariance())[count:])
    place = found.place[count:]
    intervals = effects.intervals(place, place - half, place + half)
    for name, parameter, number in effects.fixed:
        intervals[name].setdefault(parameter, (number, number, number))
    return Completion(candidate.model(model, found.place), intervals)


def _law_beside(learned: Learned, model: Model) -> Fitted[RefittedLaw] | None:
    """Return the law fitted again to the logs of the fit, beside the effects of a model; None without a fit.

    The cost of a model that cannot be simulated there is not known.
    """
    rival = RefittedLaw(model)
    found = fit(_problem(learned, model), rival, rival.start(), most=_LAW_STEPS)
    return found if found is not None and math.isfinite(found.cost) else None


def _problem(learned: Learned, model: Model) -> ResidualProblem:
    settings = learned.simulators.full.settings
    return ResidualProblem(model, learned.whitener, settings, learned.simulators, learned.before())
