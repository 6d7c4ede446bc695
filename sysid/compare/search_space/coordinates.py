"""A set of effects as a vector: each free parameter on a scale from 0 to 1 between its bounds.

A size with a direction, such as a slope and its heading, has two components instead: at size 0 the angle
would change nothing, and a search that starts there could not find it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np

from mecanum_env.effects import CATALOGUE, Effect, Parameter
from mecanum_env.effects.definition import Values
from mecanum_env.effects.scale import REFERENCE, Scale
from mecanum_env.model import Model, cause_of
from mecanum_env.units import FloatArray

_LOGARITHMIC: Final = 20.0
"""Ratio of the bounds above which a parameter is searched in the logarithm."""
Axis = Literal["", "x", "y"]
Bounds = tuple[float, float, float]
"""Value, lower and upper end of its interval."""


@dataclass(frozen=True)
class Coordinate:
    """One free parameter."""

    effect: str
    """Name in the catalogue."""
    parameter: str
    low: float
    high: float
    neutral: float
    """Value in the base model; may be infinite."""
    like: str = ""
    """The parameter of the same effect, with the same bounds, that it equals as long as it is neutral."""
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
    def has_neutral(self) -> bool:
        """Whether the effect does nothing where the parameter has some value."""
        known = CATALOGUE[self.effect].parameters
        return any(p.name == self.parameter and p.neutral is not None for p in known)

    @property
    def logarithmic(self) -> bool:
        """Whether equal steps of the place are equal ratios of the value."""
        return self.low > 0.0 and self.high > _LOGARITHMIC * self.low

    @property
    def reaches_neutral(self) -> bool:
        """Whether the neutral value is in the range, so that the effect vanishes where the place nears it."""
        return self.low <= self.neutral <= self.high

    @cached_property
    def neutral_place(self) -> float:
        """Place of the neutral value; 1 if it is infinite."""
        return self.unit(self.neutral) if math.isfinite(self.neutral) else 1.0

    def value(self, unit: float) -> float:
        """Return the parameter at a place `unit`, 0 .. 1; a neutral value beyond a bound lies at that end."""
        if (unit >= 1.0 and self.neutral > self.high) or (unit <= 0.0 and self.neutral < self.low):
            return self.neutral
        if math.isfinite(self.neutral) and unit == self.neutral_place:
            # A logarithm and back rounds, and neutral must be exact.
            return self.neutral
        if self.logarithmic:
            return self.low * math.exp(unit * math.log(self.high / self.low))
        return self.low + unit * (self.high - self.low)

    def beyond(self, unit: float) -> float:
        """Return the parameter at a place `unit`, also outside of 0 .. 1 if that can be simulated.

        The search ends at its bounds, and what it finds there may be larger.
        """
        if 0.0 <= unit <= 1.0 or not math.isfinite(value := self.value(unit)):
            return self.value(unit)
        known = CATALOGUE[self.effect].parameters
        least, most = next(p.valid for p in known if p.name == self.parameter)
        return value if self.axis else min(max(value, least), most)

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
    fixed: tuple[tuple[str, str, float], ...] = ()
    """Effect, parameter and value where an effect does not start from the values of the base model."""

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
        for name, parameter, value in self.fixed:
            effects.setdefault(name, {})[parameter] = value
        vectors: dict[str, dict[Axis, float]] = {}
        for coordinate, place in zip(self.coordinates, unit, strict=True):
            value = coordinate.value(float(place))
            if coordinate.axis:
                vectors.setdefault(coordinate.effect, {})[coordinate.axis] = value
            else:
                effects.setdefault(coordinate.effect, {})[coordinate.parameter] = value
        for name, moved in vectors.items():
            effects.setdefault(name, {}).update(_size_and_angle(base, CATALOGUE[name], moved))
        return replace(base, effects=effects)

    def intervals(self, place: FloatArray, low: FloatArray, high: FloatArray) -> dict[str, dict[str, Bounds]]:
        """Return effect -> parameter -> value and interval, from a `place` and its ends `low` and `high`.

        The components of a vector are taken as uncorrelated: its size and angle have the half widths of the
        ellipse along and across it. If the vector may be 0, the angle may be any.
        """
        found: dict[str, dict[str, Bounds]] = {name: {} for name in self.names}
        vectors: dict[str, dict[Axis, Bounds]] = {}
        for coordinate, *ends in zip(self.coordinates, place, low, high, strict=True):
            value, first, last = (coordinate.beyond(float(end)) for end in ends)
            if coordinate.axis:
                vectors.setdefault(coordinate.effect, {})[coordinate.axis] = value, first, last
            else:
                found[coordinate.effect][coordinate.parameter] = value, first, last
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
        """The effect that each free parameter belongs to, shape (p,)."""
        return tuple(coordinate.effect for coordinate in self.coordinates)

    def decisive(self, base: Model) -> tuple[bool, ...]:
        """Return which free parameters say by themselves that an effect acts, shape (p,).

        A parameter without a neutral value, such as a time constant, says how an effect acts and not that it
        does; only of an effect that the `base` model has already it says that something changed.
        """
        return tuple(c.effect in base.effects or c.has_neutral for c in self.coordinates)

    def start(self) -> FloatArray:
        """Return the place nearest to neutral, shape (p,)."""
        return np.array([coordinate.neutral_place for coordinate in self.coordinates])

    def without(self, index: int) -> EffectSet:
        """Return the set without the parameter at `index`, which is left at neutral."""
        return replace(self, coordinates=self.coordinates[:index] + self.coordinates[index + 1 :])

    def only(self, names: Sequence[str]) -> EffectSet:
        """Return the set with those of its effects that have these `names`."""
        return EffectSet(
            tuple(name for name in self.names if name in names),
            tuple(c for c in self.coordinates if c.effect in names),
            tuple(value for value in self.fixed if value[0] in names),
        )

    def needless_at(self, unit: Sequence[float] | FloatArray) -> FloatArray:
        """Return where each parameter would change nothing if the others stay at a place `unit`, (p,)."""
        at = {(c.effect, c.parameter): float(x) for c, x in zip(self.coordinates, unit, strict=True)}
        return np.array([at.get((c.effect, c.like), c.neutral_place) for c in self.coordinates])


def coordinate(base: Model, effect: Effect, parameter: Parameter, scale: Scale = REFERENCE) -> Coordinate:
    """Return a parameter of an effect as a coordinate.

    Neutral is the base model's value: that of the effect if the model has it already. `scale` is
    that of the drive and the logs, from `sysid.compare.search_space.scale`.
    """
    present = base.effects.get(effect.name) or _search_from(effect, scale)
    neutral = present.get(parameter.name, parameter.neutral_in(base))
    low, high = parameter.scaled(scale).bounds
    like = effect.parameters[0].name if parameter.multiples and parameter.name not in present else ""
    if parameter.largest is not None:
        high = min(high, parameter.largest(base))
    if math.isfinite(neutral) and not like:
        # A value that the model has already may lie outside of the bounds.
        low, high = min(low, neutral), max(high, neutral)
    return Coordinate(effect.name, parameter.name, low, high, neutral, like, parameter.stepwise)


def components(base: Model, effect: Effect, scale: Scale = REFERENCE) -> tuple[Coordinate, ...]:
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

    They are forms of one cause or, on the `bench`, cannot be separated in any log. A map stands alone: beside
    others its values only take up what those leave, and would lend them a name.
    """
    if len(names) > 1 and any(CATALOGUE[name].search_from is not None for name in names):
        return True
    causes = {cause_of(name) for name in names}
    twins = any(twin in names for name in names for twin in CATALOGUE[name].bench_twins)
    return len(causes) < len(names) or (bench and twins)


def scanned(parameter: Parameter, one: Coordinate, scale: Scale = REFERENCE) -> list[float]:
    """Return the places at which a parameter (`one`) is tried; none if its response has a gradient.

    `scale` is as for `coordinate`.
    """
    return list(dict.fromkeys(one.unit(value) for value in parameter.scaled(scale).scan or ()))


def searched_alone(effect: Effect) -> list[Parameter]:
    """Return the parameters of an `effect` that are searched, without those of its vector."""
    together = effect.vector or ()
    return [p for p in effect.parameters if p.searched and p.name not in together]


def effect_set(base: Model, names: Sequence[str], *, scale: Scale = REFERENCE) -> EffectSet:
    """Return the set of effects with these `names`, in any order, and all parameters free that are searched.

    Those that equal another one as long as they are neutral are left at that. `scale` is as for `coordinate`.
    """
    ordered = tuple(name for name in CATALOGUE if name in names)
    free: list[Coordinate] = []
    fixed: list[tuple[str, str, float]] = []
    for name in ordered:
        effect, present = CATALOGUE[name], base.effects.get(name, {})
        known = [p for p in searched_alone(effect) if not p.multiples or p.name in present]
        free += [coordinate(base, effect, p, scale) for p in known]
        free += components(base, effect, scale)
        if name not in base.effects:
            fixed += [(name, parameter, value) for parameter, value in _search_from(effect, scale).items()]
    return EffectSet(ordered, tuple(free), tuple(fixed))


def _search_from(effect: Effect, scale: Scale) -> Values:
    return {} if effect.search_from is None else effect.search_from(scale)


def joined(one: EffectSet, other: EffectSet) -> EffectSet:
    """Return the set with the effects and free parameters of both."""
    names = tuple(name for name in CATALOGUE if name in (*one.names, *other.names))
    both = dict.fromkeys((*one.coordinates, *other.coordinates))
    fixed = tuple(dict.fromkeys((*one.fixed, *other.fixed)))
    return EffectSet(names, tuple(sorted(both, key=lambda c: names.index(c.effect))), fixed)
