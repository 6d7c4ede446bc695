"""A start for law and effects from anywhere: a simple drive of a few physical numbers, fitted globally.

A law that was fitted alone to a ramp behind a delay imitates both with zeros and slow poles, and descents
from there do not find the ramp. A first-order lag with a gain, a delay, a limit of the acceleration and
friction has so few numbers that all of their ranges can be searched (differential evolution; Storn and Price,
J. Global Optimization 11:341, 1997); law and effects then descend from the best of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from scipy.optimize import differential_evolution

from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.search_space import EffectSet

SIMPLE_DRIVE: Final = ("command_latency", "speed_gain", "acceleration_limit", "coulomb_friction")
"""Effects of the simple drive beside its lag."""
_POPULATION: Final = 6
_GENERATIONS: Final = 40
"""Members for each number that is searched, and most generations. Assumed: 2 to 10 s for a fit."""
_FASTEST: Final = 0.25
"""Shortest time constant of the lag, in ticks of the law."""
_TOLERANCE: Final = 0.03


def simple_drive(
    alone: Model,
    effects: EffectSet,
    largest_pole: float,
    cost: Callable[[Model], float],
) -> Model:
    """Return the model with a first-order law and `effects` whose cost is least over all of their ranges.

    `alone` gives the rest of the model; `largest_pole` is that of the slowest law; the `cost` of a model that
    cannot be simulated is infinite.
    """
    tick = alone.wheel.law.sample_period_s
    slowest_s = -tick / math.log(largest_pole)
    fastest_s = _FASTEST * tick
    plain = replace(alone, effects={}, uncertainty={})

    def model(place: FloatArray) -> Model:
        lag_s = fastest_s * (slowest_s / fastest_s) ** float(place[0])
        pole = math.exp(-tick / lag_s)
        law = WheelLaw(A=pole, B=0.0, C=0.0, D=1.0 - pole, E=0.0, F=0.0, sample_period_s=tick)
        lagging: Model = replace(plain, wheel=replace(plain.wheel, law=law))
        return effects.model(lagging, place[1:])

    count = 1 + effects.parameter_count
    found = differential_evolution(
        lambda place: cost(model(place)),
        [(0.0, 1.0)] * count,
        popsize=_POPULATION,
        maxiter=_GENERATIONS,
        tol=_TOLERANCE,
        polish=False,
        rng=np.random.default_rng(0),
    )
    return model(found.x)
