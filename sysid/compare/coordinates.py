"""A set of effects as a vector: each free parameter on a scale from 0 to 1 between its bounds.

A size with a direction, such as a slope and its heading, has two components instead: at size 0 the angle
would change nothing, and a search that starts there could not find it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect, Parameter
from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray

_LOGARITHMIC: Final = 20.0
"""Ratio of the bounds above which a parameter is searched in the logarithm."""
Axis = Literal["", "x", "y"]
Bounds = tuple[float, float, float]
"""Value, lower and upper end of its interval."""
_INTEGRAL_BOUNDS: Final = (1.0, 500.0)
"""Bounds of the drive's integral action [N m/rad] when friction is tried on a drive that has one."""


@dataclass(frozen=True)
class Coordinate:
    """One free parameter."""

    effect: str
    """Name in the catalogue; "" for the drive's integral action, which is a number of the robot."""
    parameter: str
    low: float
    high: float
    neutral: float
    """Value in the base model; may be infinite."""
    stepwise: bool = False
    """Whether its response is piecewise constant, so that derivatives say nothing."""
    axis: Axis = ""
    """Of a size (`parameter`) with a direction: "x" for size times cosine, "y" for size times sine."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters that it decides about: one, or a size and its angle."""
        vector = CATALOGUE[self.effect].vector if self.axis else None
        return vector or (self.parameter,)

    @property
    def logarithmic(self) -> bool:
        """Whether equal steps of the place are equal ratios of the value."""
        return self.low > 0.0 and self.high > _LOGARITHMIC * self.low

    @property
    def neutral_place(self) -> float:
        """Place of the neutral value; 1 if it is infinite."""
        return self.unit(self.neutral) if math.isfinite(self.neutral) else 1.0

    def value(self, unit: float) -> float:
        """Return the parameter at a place `unit`, 0 .. 1; a neutral value beyond a bound lies at that end."""
        if (unit >= 1.0 and self.neutral > self.high) or (unit <= 0.0 and self.neutral < self.low):
            return self.neutral
        if math.isfinite(self.neutral) and unit == self.unit(self.neutral):
            # A logarithm and back rounds, and neutral must be exact.
            return self.neutral
        if self.logarithmic:
            return self.low * math.exp(unit * math.log(self.high / self.low))
        return self.low + unit * (self.high - self.low)

    def unit(self, value: float) -> float:
        """Return the place of a `value`, clipped to the bounds."""
        inside = min(max(value, self.low), self.high)
        if self.logarithmic:
            return math.log(inside / self.low) / math.log(self.high / self.low)
        return (inside - self.low) / (self.high - self.low)


@dataclass(frozen=True)
class EffectSet:
    """Effects with some of their parameters free; the others keep their neutral or default values."""

    names: tuple[str, ...]
    """Names of the effects, in the order of the catalogue."""
    coordinates: tuple[Coordinate, ...]
    integral: bool = False
    """Whether the drive is assumed to have integral action that the model lacks."""

    @property
    def parameter_count(self) -> int:
        """Number of free parameters p."""
        return len(self.coordinates)

    def model(self, base: Model, unit: Sequence[float] | FloatArray) -> Model:
        """Return the `base` model with the set's effects at a place `unit`, shape (p,).

        An effect of the set takes the place of another form of its cause in the base model.
        """
        taken = {cause_of(name): name for name in self.names}
        effects = {
            name: dict(values)
            for name, values in base.effects.items()
            if taken.get(cause_of(name), name) == name
        }
        robot = base.robot
        vectors: dict[str, dict[Axis, float]] = {}
        for coordinate, place in zip(self.coordinates, unit, strict=True):
            value = coordinate.value(float(place))
            if coordinate.axis:
                vectors.setdefault(coordinate.effect, {})[coordinate.axis] = value
            elif coordinate.effect:
                effects.setdefault(coordinate.effect, {})[coordinate.parameter] = value
            else:
                robot = replace(robot, servo_integral_n_m_rad=value)
        for name, moved in vectors.items():
            effects.setdefault(name, {}).update(_size_and_angle(base, CATALOGUE[name], moved))
        return replace(base, robot=robot, effects=effects)

    def intervals(self, place: FloatArray, low: FloatArray, high: FloatArray) -> dict[str, dict[str, Bounds]]:
        """Return effect -> parameter -> value and interval, from a `place` and its ends `low` and `high`.

        The components of a vector are taken as uncorrelated: its size and angle have the half widths of the
        ellipse along and across it. If the vector may be 0, the angle may be any.
        """
        found: dict[str, dict[str, Bounds]] = {name: {} for name in self.names}
        vectors: dict[str, dict[Axis, Bounds]] = {}
        for coordinate, *ends in zip(self.coordinates, place, low, high, strict=True):
            value, first, last = (coordinate.value(float(np.clip(end, 0.0, 1.0))) for end in ends)
            if coordinate.axis:
                vectors.setdefault(coordinate.effect, {})[coordinate.axis] = value, first, last
            else:
                found.setdefault(coordinate.effect, {})[coordinate.parameter] = value, first, last
        for name, parts in vectors.items():
            if (vector := CATALOGUE[name].vector) is not None:
                found[name].update(zip(vector, _polar_bounds(parts), strict=True))
        return found

    @property
    def stepwise(self) -> tuple[bool, ...]:
        """Which free parameters have a piecewise constant response, shape (p,)."""
        return tuple(coordinate.stepwise for coordinate in self.coordinates)

    @property
    def owners(self) -> tuple[str, ...]:
        """The effect that each free parameter belongs to, "" for none, shape (p,)."""
        return tuple(coordinate.effect for coordinate in self.coordinates)

    def start(self) -> FloatArray:
        """Return the place nearest to neutral, shape (p,)."""
        return np.array([coordinate.neutral_place for coordinate in self.coordinates])

    def without(self, index: int) -> EffectSet:
        """Return the set without the parameter at `index`, which is left at neutral."""
        left = self.coordinates[:index] + self.coordinates[index + 1 :]
        return EffectSet(self.names, left, any(not c.effect for c in left))


def coordinate(base: Model, effect: Effect, parameter: Parameter, scale: float = 1.0) -> Coordinate:
    """Return a parameter of an effect as a coordinate.

    Neutral is the base model's value: that of the effect if the model has it already. `scale` is the factor
    on bounds in rpm and rpm/s, from `sysid.compare.problem.speed_scale`.
    """
    present = base.effects.get(effect.name, {})
    neutral = present.get(parameter.name, parameter.neutral_in(base))
    low, high = parameter.scaled(scale).bounds
    if parameter.largest is not None:
        high = min(high, parameter.largest(base))
    if math.isfinite(neutral):
        # A value that the model has already may lie outside of the bounds.
        low, high = min(low, neutral), max(high, neutral)
    return Coordinate(effect.name, parameter.name, low, high, neutral, parameter.stepwise)


def components(base: Model, effect: Effect, scale: float = 1.0) -> tuple[Coordinate, ...]:
    """Return the two components of an `effect`'s vector as coordinates; none if it has no vector.

    Neutral, the `base` model's value, and `scale` are as for `coordinate`.
    """
    if effect.vector is None:
        return ()
    size = next(parameter for parameter in effect.parameters if parameter.name == effect.vector[0])
    most = size.scaled(scale).bounds[1]
    x, y = _components_of(base, effect)
    axes: tuple[tuple[Axis, float], ...] = (("x", x), ("y", y))
    return tuple(
        Coordinate(effect.name, size.name, min(-most, neutral), max(most, neutral), neutral, axis=axis)
        for axis, neutral in axes
    )


def _components_of(model: Model, effect: Effect) -> tuple[float, float]:
    """Return the components of an effect's vector in a model, 0 if it has none."""
    size, angle_deg = _vector_of(model, effect)
    angle = math.radians(angle_deg)
    return size * math.cos(angle), size * math.sin(angle)


def _vector_of(model: Model, effect: Effect) -> tuple[float, float]:
    """Return the size and the angle [deg] of an effect's vector in a model, 0 if it has none."""
    values = effect.complete(model.effects.get(effect.name, {}), model)
    size, angle_deg = effect.vector or ("", "")
    return values.get(size, 0.0), values.get(angle_deg, 0.0)


def _size_and_angle(base: Model, effect: Effect, moved: Mapping[Axis, float]) -> dict[str, float]:
    """Return the parameters of an effect's vector with `moved` components, the other one as in the base."""
    x0, y0 = _components_of(base, effect)
    x, y = moved.get("x", x0), moved.get("y", y0)
    # Cosine and back rounds, and neutral must be exact.
    known = _vector_of(base, effect) if (x, y) == (x0, y0) else None
    pair = known or (math.hypot(x, y), math.degrees(math.atan2(y, x)))
    return dict(zip(effect.vector or (), pair, strict=True))


def _polar_bounds(parts: Mapping[Axis, Bounds]) -> tuple[Bounds, Bounds]:
    """Return size and angle [deg] of a vector with their intervals, from those of its components."""
    (x, left, right), (y, bottom, top) = parts["x"], parts["y"]
    size, angle = math.hypot(x, y), math.degrees(math.atan2(y, x))
    cos, sin = (x / size, y / size) if size > 0.0 else (1.0, 0.0)
    width, height = 0.5 * (right - left), 0.5 * (top - bottom)
    along, across = math.hypot(width * cos, height * sin), math.hypot(width * sin, height * cos)
    turn = 180.0 if along >= size else math.degrees(math.atan2(across, size))
    return (size, max(0.0, size - along), size + along), (angle, angle - turn, angle + turn)


def excludes_itself(names: Sequence[str], *, bench: bool) -> bool:
    """Return whether two effects of a set, by their `names`, cannot be in one model.

    They are forms of one cause or, on the `bench`, cannot be separated in any log.
    """
    causes = {cause_of(name) for name in names}
    twins = any(twin in names for name in names for twin in CATALOGUE[name].bench_twins)
    return len(causes) < len(names) or (bench and twins)


def scanned(parameter: Parameter, one: Coordinate, scale: float = 1.0) -> list[float]:
    """Return the places at which a parameter (`one`) is tried; none if its response has a gradient.

    `scale` is as for `coordinate`.
    """
    return list(dict.fromkeys(one.unit(value) for value in parameter.scaled(scale).scan or ()))


def searched_alone(effect: Effect) -> list[Parameter]:
    """Return the parameters of an `effect` that are searched, without those of its vector."""
    together = effect.vector or ()
    return [p for p in effect.parameters if p.simulated and p.searched and p.name not in together]


def effect_set(base: Model, names: Sequence[str], *, integral: bool = False, scale: float = 1.0) -> EffectSet:
    """Return the set of effects with these `names`, in any order, and all parameters free that are searched.

    `integral`: whether the drive is assumed to have integral action too, of unknown size; `scale` is as for
    `coordinate`.
    """
    ordered = tuple(name for name in CATALOGUE if name in names)
    free: list[Coordinate] = []
    for effect in map(CATALOGUE.__getitem__, ordered):
        free += [coordinate(base, effect, p, scale) for p in searched_alone(effect)]
        free += components(base, effect, scale)
    if integral:
        free.append(integral_action(base))
    return EffectSet(ordered, tuple(free), integral)


def integral_action(base: Model) -> Coordinate:
    """Return the drive's integral action as a coordinate whose neutral value is that of the `base` model."""
    return Coordinate("", "servo_integral_n_m_rad", *_INTEGRAL_BOUNDS, base.robot.servo_integral_n_m_rad)


def joined(one: EffectSet, other: EffectSet) -> EffectSet:
    """Return the set with the effects and free parameters of both."""
    names = tuple(name for name in CATALOGUE if name in (*one.names, *other.names))
    both = dict.fromkeys((*one.coordinates, *other.coordinates))
    ordered = sorted(both, key=lambda c: names.index(c.effect) if c.effect else len(names))
    return EffectSet(names, tuple(ordered), one.integral or other.integral)
