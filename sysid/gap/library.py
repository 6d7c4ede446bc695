"""What each effect by itself does to these very logs: its response at one or several sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.coordinates import FRICTION, Coordinate, EffectSet, coordinate, integral_action, scanned
from sysid.gap.problem import Problem

_TORQUES: Final = (0.05, 0.2, 0.5)
"""Of friction on a drive with integral action, on the scale 0 .. 1."""
_TYPICAL_INTEGRAL: Final = 50.0
"""At which friction on a drive with integral action is tried first [N m/rad]."""


@dataclass(frozen=True, eq=False)
class Response:
    """The change of the marginal residual that one effect makes."""

    chosen: EffectSet
    """The effect, with the coordinates that were moved."""
    place: FloatArray
    """(p,)"""
    change: FloatArray
    """Residual there less that of the base model, marginalised, (N,)."""
    linear: bool
    """From a small step: its multiples mean something, the other way too where neutral is inside."""
    size: float
    """Along the first coordinate, how far from neutral (0 .. 1)."""


def responses(problem: Problem, effects: Sequence[str], at: Model | None = None) -> list[Response]:
    """Return the responses of effects, in the order of the catalogue; what cannot be simulated is left out.

    Args:
        problem: the model and the logs.
        effects: names in the catalogue.
        at: the model that has none of them yet; the base model when None.
    """
    found = []
    start = problem.base if at is None else at
    for name in [name for name in CATALOGUE if name in effects]:
        trials = _trials(problem.base, CATALOGUE[name], problem.look_step([name]), problem.scale)
        models = [chosen.model(start, place) for chosen, place, _, _ in trials]
        for (chosen, place, linear, size), change in zip(
            trials, problem.changes(models, quick=problem.is_quick([name]), at=start), strict=True
        ):
            if change is not None:
                found.append(Response(chosen, place, change, linear, size))
    return found


def _trials(
    base: Model, effect: Effect, step: float, scale: float
) -> list[tuple[EffectSet, FloatArray, bool, float]]:
    """Return set, place, whether a small step, and how far from neutral, of each simulation to make."""
    trials = []
    primary = [p for p in effect.parameters if p.simulated and p.neutral is not None]
    secondary = [p for p in effect.parameters if p.simulated and p.neutral is None and p.scan]
    for parameter in primary:
        one = coordinate(base, effect, parameter, scale)
        neutral = one.unit(one.neutral) if np.isfinite(one.neutral) else 1.0
        places = scanned(parameter, one, scale)
        linear = not places
        if linear:
            # Into the side with more room: a servo can be far weaker than the model's, and hardly stiffer.
            places = [neutral + step if neutral <= 0.5 + 1e-9 else neutral - step]
        for place in places:
            if abs(place - neutral) < 1e-9:
                continue
            moved, where = [one], [place]
            if not secondary:
                trials.append((_set(effect, moved), np.array(where), linear, abs(place - neutral)))
            for other in secondary:
                second = coordinate(base, effect, other, scale)
                for beside in scanned(other, second, scale):
                    both = np.array([place, beside])
                    trials.append((_set(effect, [one, second]), both, linear, abs(place - neutral)))
    if effect.name in FRICTION:
        trials += _with_integral(base, effect, scale)
    return trials


def _with_integral(
    base: Model, effect: Effect, scale: float
) -> list[tuple[EffectSet, FloatArray, bool, float]]:
    """Return a friction's trials on a drive with integral action, or, where it has, almost without."""
    extra = integral_action(base)
    parameter = effect.parameters[0]
    one = coordinate(base, effect, parameter, scale)
    places = scanned(parameter, one, scale) or [one.unit(one.neutral) + x for x in _TORQUES]
    action = 0.0 if extra.neutral > 0.0 else extra.unit(_TYPICAL_INTEGRAL)
    chosen = EffectSet((effect.name,), (one, extra), integral=True)
    return [(chosen, np.array([place, action]), False, place) for place in places if place <= 1.0]


def _set(effect: Effect, coordinates: list[Coordinate]) -> EffectSet:
    return EffectSet((effect.name,), tuple(coordinates))
