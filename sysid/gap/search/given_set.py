"""The set of effects that a fit of law and effects found in these very logs: a study need not find it again.

Where the law was fitted beside several effects, hardly one of them may be worth much alone, and a search that
grows sets one by one does not come to the whole set.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from mecanum_env.effects.definition import Values
from mecanum_env.effects.scale import Scale
from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray
from sysid.compare.search_space import EffectSet, effect_set

GivenSet = Mapping[str, Values]
"""Effect -> parameter -> value."""


def beyond(base: Model, whole: Model, considered: Collection[str]) -> GivenSet:
    """Return the `considered` effects of a whole model of which the `base` has no form."""
    present = {cause_of(name) for name in base.effects}
    return {
        name: values
        for name, values in whole.effects.items()
        if name in considered and cause_of(name) not in present
    }


def set_at(base: Model, given: GivenSet, scale: Scale) -> tuple[EffectSet, FloatArray]:
    """Return the set of the given effects, with the parameters free that a search fits, and its place (p,).

    The others have the values that are given.
    """
    chosen = effect_set(base, tuple(given), scale=scale)
    place = chosen.start()
    for index, one in enumerate(chosen.coordinates):
        if one.parameter in given[one.effect]:
            place[index] = np.clip(one.unit(given[one.effect][one.parameter]), 0.0, 1.0)
    free = {(one.effect, one.parameter) for one in chosen.coordinates}
    others = tuple(
        (name, parameter, value)
        for name, values in given.items()
        for parameter, value in values.items()
        if (name, parameter) not in free
    )
    return replace(chosen, fixed=(*chosen.fixed, *others)), place
