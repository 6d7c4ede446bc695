"""The effects that a study found, with how certain they are, and the model with them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from mecanum_env.effects.friction import droop_rpm, stiffness_is_known, torques_of
from mecanum_env.model import Model, cause_of, form_of
from sysid.compare.model_error import covariance_of, with_adopted
from sysid.compare.search_space import EffectSet
from sysid.gap.inquiry import Inquiry
from sysid.gap.result import FoundEffect, Interval
from sysid.gap.search.scores import ScoredSet, interval_ends
from sysid.gap.search.thresholds import THRESHOLDS


def found_effects(found: Inquiry) -> tuple[FoundEffect, ...]:
    """Return what is to be added to the model: the chosen set, and what was there already beside it.

    There is nothing to add for a verdict without a chosen set.
    """
    chosen = found.decision.chosen
    return () if chosen is None else (*_chosen_effects(found, chosen), *_effects_there(found, chosen))


def _chosen_effects(found: Inquiry, chosen: ScoredSet) -> tuple[FoundEffect, ...]:
    """Return the effects of the chosen set with 90 % intervals."""
    problem, decision, fitted = found.search.problem, found.decision, chosen.fitted
    candidate: EffectSet = fitted.candidate
    correlation = THRESHOLDS.interval_correlation
    low, high = interval_ends(problem, fitted, decision.facts.inflation, correlation)
    bounds = candidate.intervals(fitted.place, low, high)
    intervals = {name: {p: Interval(*ends) for p, ends in own.items()} for name, own in bounds.items()}
    for name, parameter, number in candidate.fixed:
        intervals[name].setdefault(parameter, Interval(number, number, number))
    model = candidate.model(problem.base, fitted.place)
    return tuple(
        FoundEffect(
            name,
            parameters,
            decision.facts.frequency.get(name, 0.0),
            _droop(name, parameters, model, problem.settings.scale.top_rpm),
            stiffness_is_known(model),
            _forms_tied(name, chosen, decision.candidates),
            found.since.get(name, "unknown"),
        )
        for name, parameters in intervals.items()
    )


def _effects_there(found: Inquiry, chosen: ScoredSet) -> tuple[FoundEffect, ...]:
    """Return the effects that were there already, as the logs of the fit size them.

    Those that the chosen set has at a new size are left out.
    """
    problem = found.search.problem
    model = problem.base
    return tuple(
        FoundEffect(
            name,
            parameters := {key: Interval(*ends) for key, ends in bounds.items()},
            1.0,  # Every resample is searched beside it.
            _droop(name, parameters, model, problem.settings.scale.top_rpm),
            stiffness_is_known(model),
            since="already when fitted",
        )
        for name, bounds in found.there.items()
        if cause_of(name) not in chosen.causes
    )


def _droop(name: str, parameters: Mapping[str, Interval], model: Model, speed_rpm: float) -> Interval | None:
    """Return the droop [rpm] of an effect that is a torque, of one in proportion to speed at `speed_rpm`."""
    torques = {key: parameters[key] for key in torques_of(name) if key in parameters}
    if not torques:
        return None
    ends = (
        {key: getattr(torque, end) for key, torque in torques.items()} for end in ("value", "low", "high")
    )
    return Interval(*(droop_rpm(name, values, model, speed_rpm) for values in ends))


def _forms_tied(name: str, chosen: ScoredSet, candidates: Sequence[ScoredSet]) -> tuple[str, ...]:
    """Return the other forms of an effect of the chosen set that do as well beside the same causes."""
    alike = [one for one in candidates if one.causes == chosen.causes]
    others = (other for one in alike for other in one.names if other != name)
    return tuple(dict.fromkeys(form_of(other) for other in others if cause_of(other) == cause_of(name)))


def improved_model(model: Model, found: Inquiry, effects: Sequence[FoundEffect]) -> Model:
    """Return the model with the chosen set, if any, the intervals of its parameters and their covariance.

    The covariance has the widths of the intervals, which allow for more than noise, and the correlations of
    the fit. `effects` are all that are added, as `found_effects` returns them.
    """
    if found.decision.chosen is None:
        return model
    fitted = found.decision.chosen.fitted
    candidate: EffectSet = fitted.candidate
    improved: Model = candidate.model(found.search.problem.base, fitted.place)
    stated = {one.name: one.intervals for one in effects}
    # A cause that takes another form leaves nothing of the form it had.
    known = {
        name: one
        for name, one in (model.uncertainty.get("effects") or {}).items()
        if name in improved.effects
    }
    improved = replace(improved, uncertainty={**model.uncertainty, "effects": {**known, **stated}})
    ends = {
        f"{one.name}.{parameter}": (interval.low, interval.high)
        for one in effects
        for parameter, interval in one.parameters.items()
    }
    # The two components of a vector are no parameters of the file, and are left uncorrelated.
    names = ["" if one.axis else f"{one.effect}.{one.parameter}" for one in candidate.coordinates]
    level = THRESHOLDS.interval_level
    known_names, covariance = covariance_of(ends, names, fitted.covariance(), level)
    new = [one.name for one in effects if one.since == "new"]
    return with_adopted(improved, known_names, covariance, [one.name for one in effects], new)
