"""Robots drawn from the uncertainty of the identification, one for each episode.

- `"none"`: every episode has the model as it is.
- `"posterior"`: the wheel's coefficients A-F are normal with the covariance of the fit (unstable laws are
  drawn again), fitted parameters of the robot are normal with their standard errors, parameters of effects
  are uniform in the intervals that the gap workflow found.
- a mapping: each named parameter is uniform between two ends, such as
  `{"robot.mass_kg": (18, 24), "effects.speed_gain.gain": (0.9, 1.0)}`.
- a tuple of models: every episode has one of them, all equally probable.

The posterior is in the model file: `uncertainty.wheel.covariance`, `uncertainty.robot.NAME`, and
`uncertainty.effects.EFFECT.PARAMETER` with `low` and `high`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from mecanum_env.batch import LAW
from mecanum_env.effects import CATALOGUE
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model import EFFECT_PARAMETERS, ROBOT_NUMBERS, Model
from mecanum_env.model.effect_names import cause_of
from mecanum_env.units import FloatArray

Range = tuple[float, float]
Randomize = Literal["none", "posterior"] | Mapping[str, Range] | tuple[Model, ...]
_TRIES = 1000


@dataclass(frozen=True)
class Sampler:
    """Draws variations of a model."""

    model: Model
    """The model; what is not drawn stays as it is here."""
    ranges: Mapping[str, Range]
    """Ends of a uniform draw by name, such as "robot.mass_kg" or "effects.speed_gain.gain"."""
    spread: FloatArray | None = None
    """A matrix L, shape (6, 6), with L L^T the covariance of A-F; None: the law is not drawn."""
    robot_errors: Mapping[str, float] | None = None
    """Standard errors of fitted parameters of the robot by name."""

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the numbers that are drawn, in the order in which they are."""
        robot = (f"robot.{name}" for name in self.robot_errors or {})
        return (*(() if self.spread is None else LAW), *robot, *self.ranges)

    def numbers(self, rng: np.random.Generator) -> FloatArray:
        """Return the numbers with the `names` of one robot, drawn with the generator `rng`, shape (k,).

        Raises:
            InputError: nearly every drawn law is unstable.
        """
        drawn = [] if self.spread is None else self._draw_change(self.spread, rng)
        for name, error in (self.robot_errors or {}).items():
            value = getattr(self.model.robot, name)
            # Friction, stiffness and inertia must stay positive.
            drawn.append(max(value + error * rng.standard_normal(), 0.1 * value))
        drawn += [low + (high - low) * rng.random() for low, high in self.ranges.values()]
        return np.array(drawn)

    def model_of(self, numbers: FloatArray) -> Model:
        """Return the model with these `numbers`, shape (k,).

        Raises:
            InputError: a number that the model cannot have.
        """
        given, model = dict(zip(self.names, numbers.tolist(), strict=True)), self.model
        if self.spread is not None:
            change = [given.pop(name) for name in LAW]
            wheel = replace(model.wheel, law=model.wheel.law.moved(change))
            wheels = {name: own.moved(change) for name, own in model.wheels.items()}
            model = replace(model, wheel=wheel, wheels=wheels)
        return _with_numbers(model, given)

    def draw(self, rng: np.random.Generator) -> Model:
        """Return a model drawn with the generator `rng`.

        Raises:
            InputError: nearly every drawn law is unstable.
        """
        return self.model_of(self.numbers(rng))

    def edges(self) -> tuple[Model, Model]:
        """Return the models with all ranges at their lower and at their upper ends; nothing else is changed.

        Raises:
            InputError: a value that the model cannot have.
        """
        lowest = {name: low for name, (low, _) in self.ranges.items()}
        highest = {name: high for name, (_, high) in self.ranges.items()}
        return _with_numbers(self.model, lowest), _with_numbers(self.model, highest)

    def ends(self) -> tuple[FloatArray, FloatArray]:
        """Return the numbers with the `names` of the two models in `edges`, shape (k,) each."""
        numbers = [0.0] * (0 if self.spread is None else len(LAW))
        numbers += [getattr(self.model.robot, name) for name in self.robot_errors or {}]
        lowest, highest = zip(*self.ranges.values(), strict=True) if self.ranges else ((), ())
        return np.array([*numbers, *lowest]), np.array([*numbers, *highest])

    def _draw_change(self, spread: FloatArray, rng: np.random.Generator) -> list[float]:
        """Return what is added to the coefficients of all laws, six numbers."""
        laws = (self.model.wheel.law, *self.model.wheels.values())
        for _ in range(_TRIES):
            change: list[float] = (spread @ rng.standard_normal(spread.shape[1])).tolist()
            if all(law.moved(change).is_stable for law in laws):
                return change
        raise InputError(
            f"uncertainty.wheel.covariance: {_TRIES} laws drawn from it are unstable; fit more logs"
        )


@dataclass(frozen=True)
class Pool:
    """Robots of which every episode has one, all equally probable."""

    models: tuple[Model, ...]

    def draw(self, rng: np.random.Generator) -> Model:
        """Return one of the models, drawn with the generator `rng`."""
        return self.models[int(rng.integers(len(self.models)))]

    def edges(self) -> tuple[Model, ...]:
        """Return all models that may be drawn."""
        return self.models


def sampler_for(randomize: Randomize, model: Model) -> Sampler | Pool | None:
    """Return the sampler that draws the robot of each episode; None for `randomize` = "none".

    Raises:
        InputError: no such choice or parameter, an invalid range, or a model without uncertainty.
    """
    if isinstance(randomize, tuple):
        if not randomize or not all(isinstance(one, Model) for one in randomize):
            raise InputError("randomize: a tuple must hold one or more mecanum_env.model.Model")
        return Pool(randomize)
    if isinstance(randomize, Mapping):
        return Sampler(model, {name: _range(name, ends) for name, ends in sorted(randomize.items())})
    if randomize == "none":
        return None
    if randomize != "posterior":
        raise InputError(f'randomize = {randomize!r}, must be "none", "posterior", ranges by name or models')
    known = model.uncertainty
    covariance = known.get("wheel", {}).get("covariance")
    errors = {name: float(error) for name, error in sorted(known.get("robot", {}).items())}
    ranges = {
        f"effects.{effect}.{name}": (float(ends["low"]), float(ends["high"]))
        for effect, parameters in sorted(known.get("effects", {}).items())
        for name, ends in sorted(parameters.items())
    }
    if covariance is None and not errors and not ranges:
        raise InputError(
            'randomize = "posterior": the model holds no uncertainty; make one with `python -m sysid.fit '
            'LOGS`, or give ranges, such as {"robot.mass_kg": (18, 24)}'
        )
    spread = None if covariance is None else _factor(np.array(covariance, float))
    return Sampler(model, {name: _range(name, ends) for name, ends in ranges.items()}, spread, errors)


def _factor(covariance: FloatArray) -> FloatArray:
    """Return L with L L^T the covariance, whose rank is only 5 if the fit keeps the law's gain at one."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))


def _range(name: str, ends: Any) -> Range:
    _check_name(name)
    try:
        low, high = (float(end) for end in ends)
    except (TypeError, ValueError) as error:
        raise InputError(f"randomize: {name} = {ends!r}, must be two numbers: low, high") from error
    if not (np.isfinite(low) and np.isfinite(high) and low <= high):
        raise InputError(f"randomize: {name} = {ends!r}, must be two finite numbers, the lower number first")
    section, *rest = name.split(".")
    if section == "effects":
        least, most = next(one for one in CATALOGUE[rest[0]].parameters if one.name == rest[1]).valid
        if low < least or high > most:
            raise InputError(f"randomize: {name} = {ends!r}, must lie within {least:g} .. {most:g}")
    return low, high


def _check_name(name: str) -> None:
    robot = [f"robot.{one}" for one in ROBOT_NUMBERS if one != "rollers_per_wheel"]
    effects = [f"effects.{effect}.{one}" for effect, known in EFFECT_PARAMETERS.items() for one in known]
    known = ["wheel.saturation_rpm", *robot, *effects]
    if name not in known:
        raise InputError(
            f"randomize: no number {name!r}{did_you_mean(name, known)}; known are wheel.saturation_rpm, "
            "robot.NAME and effects.EFFECT.PARAMETER, as in a model file"
        )


def _with_numbers(model: Model, numbers: Mapping[str, float]) -> Model:
    """Return a model with some `numbers` by name; all at once, since each model that is made is checked."""
    parts: dict[str, dict[str, float]] = {"robot": {}, "wheel": {}}
    effects = dict(model.effects)
    for name, number in numbers.items():
        section, *rest = name.split(".")
        if section in parts:
            parts[section][rest[0]] = number
            continue
        effect, parameter = rest
        if effect not in effects:
            # A model has one form of a cause.
            effects = {kept: own for kept, own in effects.items() if cause_of(kept) != cause_of(effect)}
        effects[effect] = {**effects.get(effect, {}), parameter: number}
    changed = {section: replace(getattr(model, section), **own) for section, own in parts.items() if own}
    return replace(model, **changed, effects=effects)
