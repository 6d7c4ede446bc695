"""Adding the effects that a study found to the model, with how uncertain they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mecanum_env.model import Model
from sysid.compare.adopted import covariance_of, with_adopted
from sysid.compare.coordinates import EffectSet
from sysid.gap.result import FoundEffect
from sysid.gap.search.decision import Decision
from sysid.gap.search.thresholds import THRESHOLDS


def improved_model(model: Model, base: Model, decision: Decision, effects: Sequence[FoundEffect]) -> Model:
    """Return the model with the chosen set, if any, the intervals of its parameters and their covariance.

    The covariance has the widths of the intervals, which allow for more than noise, and the correlations of
    the fit. `base` is the model with what was there already, and `effects` are all that were added.
    """
    if decision.chosen is None:
        return model
    fitted = decision.chosen.fitted
    candidate: EffectSet = fitted.candidate
    improved: Model = candidate.model(base, fitted.place)
    stated = {found.name: found.intervals for found in effects}
    # A cause that takes another form leaves nothing of the form it had.
    known = {
        name: one
        for name, one in (model.uncertainty.get("effects") or {}).items()
        if name in improved.effects
    }
    improved = replace(improved, uncertainty={**model.uncertainty, "effects": {**known, **stated}})
    ends = {
        f"{found.name}.{parameter}": (interval.low, interval.high)
        for found in effects
        for parameter, interval in found.parameters.items()
    }
    # The two components of a vector are no parameters of the file, and are left uncorrelated.
    names = ["" if one.axis else f"{one.effect}.{one.parameter}" for one in candidate.coordinates]
    level = THRESHOLDS.interval_level
    known_names, covariance = covariance_of(ends, names, fitted.covariance(), level)
    new = [found.name for found in effects if found.since == "new"]
    return with_adopted(improved, known_names, covariance, [found.name for found in effects], new)
