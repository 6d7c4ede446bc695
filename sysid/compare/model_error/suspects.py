"""What effects would change in the logs of a model's fit, so that a study asks what is new since then.

A model of another robot never has all that the robot has: its rollers and bearings rub, its links and sensors
lag a little. What every effect would do, to first order, is therefore among the uncertain columns that the
logs of the fit determine (`sysid.compare.model_error.learned`). An effect that these logs show is taken off
in the new logs, and the size that a study finds is the difference between the two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from itertools import product
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.scale import Scale
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error.elsewhere import change
from sysid.compare.predicted import Simulators
from sysid.compare.search_space import EffectSet, components, coordinate, scanned, searched_alone

_STEP: Final = 0.05
"""Standard deviation of a column's factor over ten: on the 0..1 scale of a parameter, half of the range is
likely, as where sets of effects are fitted."""
_PROBE: Final = 0.03
"""Step of a difference on the planar plant."""
_ROLLER_PROBE: Final = 0.15
"""The same on rollers, where a smaller step shows mostly rollers that meet the floor a little earlier."""


def suspect_columns(model: Model, scale: Scale, simulators: Simulators, at: Model) -> list[list[FloatArray]]:
    """Return what each effect of a robot would change, to first order: columns of an array (m,) per block.

    There is a column for each parameter that changes something as soon as it leaves its neutral value, with
    the parameters that have none at each of the values that a search tries. With factors of standard
    deviation 10 the effects may be as large as a search in a drive of this `scale` lets them be. What cannot
    be simulated, or changes nothing, is a column of zeros, so that any logs have the same columns. `at` is
    the model that moves the robot: this one, or one with further effects.
    """
    columns = []
    for chosen, place in _trials(model, scale):
        # Where the search simulates it (`ResidualProblem.surrogate_covers`): the scatter of rollers would be
        # another column of it, beside which the effect itself would seem to be new.
        covered = simulators.planar is None or CATALOGUE[chosen.names[0]].acts_in("planar")
        moved, step = np.array(place), _PROBE if covered else _ROLLER_PROBE
        moved[0] += step if place[0] <= 0.5 + 1e-9 else -step
        simulate = simulators.smooth if covered else simulators.full.predictions
        changes = change(simulate, chosen.model(model, moved), model, at)
        columns.append([c * (_STEP / step) for c in changes])
    return columns


def _trials(model: Model, scale: Scale) -> Iterator[tuple[EffectSet, FloatArray]]:
    """Yield each effect as a set, and a place of it from which its first coordinate is to be moved."""
    for name, effect in CATALOGUE.items():
        # The phase of a ripple differs from run to run.
        if not effect.searched_in("rollers") or effect.search_from or effect.reads or effect.follows_angle:
            continue
        known = {p: coordinate(model, effect, p, scale) for p in searched_alone(effect)}
        moved = [c for p, c in known.items() if p.neutral is not None and math.isfinite(c.neutral)]
        moved = [c for c in (*moved, *components(model, effect, scale)) if not c.stepwise]
        beside = [(c, scanned(p, c, scale)) for p, c in known.items() if p.neutral is None and p.scan]
        for one in moved:
            chosen = EffectSet((name,), (one, *(other for other, _ in beside)))
            for places in product(*(places for _, places in beside)):
                yield chosen, np.array([one.neutral_place, *places])
