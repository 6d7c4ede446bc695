"""The wheel law as what is fitted: alone, as the rival of every set of effects, or together with a set.

A law that is fitted alone takes up part of what friction, limits and delays do, and they are then missed or
found at a wrong size.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Final

import numpy as np

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.stability import POLE_LIMIT, free_coordinates, stable_abc
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.search_space.coordinates import EffectSet

_LAW_RANGE: Final = np.array([1.5, 1.5, 1.5, 0.5, 0.5])
"""Half width of the search: three stable coordinates of A-C (`mecanum_env.law.stability`), D and E."""
_ROBOT_RANGE: Final = 3.0  # factor by which a robot's parameter may grow or shrink


@dataclass(frozen=True)
class RefittedLaw:
    """The wheel law with five free parameters (F keeps its DC gain), and some of the robot's parameters."""

    base: Model
    robot: tuple[str, ...] = ()
    """Names of the robot's parameters that are fitted together with the law."""
    largest_pole: float = POLE_LIMIT
    """Largest magnitude of a pole; the poles of the base model's law must be smaller."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what is fitted."""
        return ("wheel_law", *self.robot)

    @property
    def parameter_count(self) -> int:
        """Number of free parameters."""
        return len(_LAW_RANGE) + len(self.robot)

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which responses are discontinuous: none."""
        return (False,) * self.parameter_count

    @property
    def owners(self) -> tuple[str, ...]:
        """The effects that the parameters belong to: none."""
        return ("",) * self.parameter_count

    def start(self) -> FloatArray:
        """Return the place of the unchanged law and robot, (p,)."""
        return np.full(self.parameter_count, 0.5)

    def model(self, base: Model, unit: Sequence[float] | FloatArray) -> Model:
        """Return the `base` model with the law and the robot's parameters at a place `unit`, (p,)."""
        places = np.asarray(unit, float)
        factors = _ROBOT_RANGE ** (2.0 * places[len(_LAW_RANGE) :] - 1.0)
        scaled = zip(self.robot, factors.tolist(), strict=True)
        changed: dict[str, Any] = {name: getattr(base.robot, name) * factor for name, factor in scaled}
        if changed:
            base = replace(base, robot=replace(base.robot, **changed))
        moved = (places[: len(_LAW_RANGE)] - 0.5) * 2.0 * _LAW_RANGE
        if not np.any(moved):
            return base
        return replace(base, wheel=replace(base.wheel, law=self._laws.at(moved)))

    @cached_property
    def _laws(self) -> _LawsAround:
        return _LawsAround.of(self.base.wheel.law, self.largest_pole / POLE_LIMIT)


@dataclass(frozen=True, eq=False)
class _LawsAround:
    """The laws of one DC gain around a law, with what does not differ between them computed once."""

    centre: FloatArray
    """Stable coordinates of its A-C divided by `scale`, then D and E, shape (5,)."""
    scale: FloatArray
    """Powers of the largest magnitude of a pole, relative to `POLE_LIMIT`, shape (3,)."""
    gain: float
    """The DC gain of all of them."""
    sample_period_s: float

    @classmethod
    def of(cls, law: WheelLaw, share: float) -> _LawsAround:
        """Return the laws around a law, whose poles reach a `share` of `POLE_LIMIT`."""
        c = law.coefficients
        scale = np.asarray(share ** np.arange(1, 4), float)
        centre = np.concatenate([free_coordinates(c[:3] / scale), c[3:5]])
        return cls(centre, scale, float(np.sum(c[3:]) / (1.0 - np.sum(c[:3]))), law.sample_period_s)

    def at(self, moved: FloatArray) -> WheelLaw:
        """Return the law whose coordinates are those of the centre, `moved` by some distance, (5,)."""
        place = self.centre + moved
        abc = self.scale * stable_abc(place[:3])
        d, e = place[3:]
        f = self.gain * (1.0 - float(np.sum(abc))) - d - e
        return WheelLaw.from_coefficients([*abc.tolist(), d, e, f], self.sample_period_s)


def robot_deviations(law: RefittedLaw, covariance: FloatArray) -> FloatArray:
    """Return the standard deviations of the logarithms of a law's robot parameters, (r,).

    `covariance` is that of a place of which the law's parameters are the first.
    """
    first = len(_LAW_RANGE)
    own = np.diag(covariance)[first : first + len(law.robot)]
    return np.asarray(2.0 * math.log(_ROBOT_RANGE) * np.sqrt(own), float)


@dataclass(frozen=True)
class LawWithEffects:
    """The wheel law with five free parameters (its DC gain is kept), and effects with theirs."""

    law: RefittedLaw
    effects: EffectSet

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the effects."""
        return self.effects.names

    @property
    def parameter_count(self) -> int:
        """Number of free parameters, those of the law first."""
        return self.law.parameter_count + self.effects.parameter_count

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which free parameters have a discontinuous response."""
        return (*self.law.stepwise, *self.effects.stepwise)

    @property
    def owners(self) -> tuple[str, ...]:
        """The effect that each free parameter belongs to, "" for the law's."""
        return (*self.law.owners, *self.effects.owners)

    def start(self) -> FloatArray:
        """Return the place of the unchanged law with neutral effects, (p,)."""
        return np.concatenate([self.law.start(), self.effects.start()])

    def model(self, base: Model, unit: FloatArray) -> Model:
        """Return the `base` model with the law and the effects at a place `unit`, (p,)."""
        count = self.law.parameter_count
        return self.effects.model(self.law.model(base, unit[:count]), unit[count:])
