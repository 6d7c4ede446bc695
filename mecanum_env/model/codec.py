"""The JSON object of a model: section 2 of FORMATS.md, format "mecanum-model/1"."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, Final

from mecanum_env.effects import EFFECT_PARAMETERS
from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.law.coefficients import COEFFICIENTS, WheelLaw
from mecanum_env.model.records import Model, Robot, Wheel

FORMAT: Final = "mecanum-model/1"


def model_to_dict(model: Model) -> dict[str, Any]:
    """Return the JSON object of a model."""
    wheel = model.wheel
    value: dict[str, Any] = {
        "format": FORMAT,
        "wheel": {
            **_coefficients(wheel.law),
            "sample_period_s": wheel.law.sample_period_s,
            **{name: _infinite_as_null(getattr(wheel, name)) for name in _WHEEL_FIELDS},
            **model.extra.get("wheel", {}),
        },
        "robot": {
            **{name: getattr(model.robot, name) for name in _ROBOT_FIELDS},
            **model.extra.get("robot", {}),
        },
        "effects": {
            name: {key: _infinite_as_null(number) for key, number in parameters.items()}
            for name, parameters in model.effects.items()
        },
        "uncertainty": dict(model.uncertainty),
        "provenance": dict(model.provenance),
        **{name: item for name, item in model.extra.items() if name not in _SECTIONS},
    }
    if model.wheels:
        value["wheels"] = {name: _coefficients(law) for name, law in model.wheels.items()}
    return value


def model_from_dict(value: Any) -> Model:
    """Build a model from a JSON object `value`; the messages name the field.

    Raises:
        InputError: a missing, misspelt, non-finite or impossible value.
        UnstableLawError: a wheel law is unstable.
    """
    top = _mapping("the file", value)
    if top.get("format") != FORMAT:
        raise InputError(f'"format" is {top.get("format")!r}, must be "{FORMAT}"')
    if "wheel" not in top:
        raise InputError('"wheel" is missing; it holds A..F and sample_period_s')
    wheel_section, wheel_extra = _split("wheel", top["wheel"], (*_LAW_FIELDS, *_WHEEL_FIELDS))
    robot_section, robot_extra = _split("robot", top.get("robot", {}), _ROBOT_FIELDS)
    extra = {name: item for name, item in top.items() if name not in _SECTIONS}
    numbers = _numbers("wheel", wheel_section, (*_LAW_FIELDS, *_WHEEL_FIELDS), null=("saturation_rpm",))
    law = _law("wheel", {name: numbers.pop(name) for name in _LAW_FIELDS if name in numbers})
    return Model(
        wheel=Wheel(law, **numbers),
        robot=robot_from_dict(robot_section),
        effects={
            name: _effect(name, parameters)
            for name, parameters in _mapping("effects", top.get("effects", {})).items()
        },
        uncertainty=dict(_mapping("uncertainty", top.get("uncertainty", {}))),
        provenance=dict(_mapping("provenance", top.get("provenance", {}))),
        extra=extra | {k: v for k, v in (("wheel", wheel_extra), ("robot", robot_extra)) if v},
        wheels={
            name: _law(
                f"wheels.{name}",
                {
                    **_numbers(f"wheels.{name}", coefficients, COEFFICIENTS),
                    "sample_period_s": law.sample_period_s,
                },
            )
            for name, coefficients in _mapping("wheels", top.get("wheels", {})).items()
        },
    )


def robot_from_dict(value: Any) -> Robot:
    """Build the robot from a partial JSON object `value`; packaged values fill in what is absent.

    What is packaged is the packaged robot's. Of another whose mass, wheelbase and track are all given, the
    yaw inertia of a solid plate stands until it is measured or fitted; and where mass and wheel radius are,
    the torque limit is no less than accelerates it as hard as the packaged robot's does that.

    Raises:
        InputError: an unknown name, or a value out of range.
    """
    numbers: dict[str, Any] = dict(_numbers("robot", value, _ROBOT_FIELDS))
    if numbers.get("rollers_per_wheel", math.nan).is_integer():
        numbers["rollers_per_wheel"] = int(numbers["rollers_per_wheel"])
    robot = Robot(**numbers)
    if "torque_limit_n_m" not in numbers and all(name in numbers for name in _FORCE):
        larger = robot.mass_kg * robot.wheel_radius_m / (Robot.mass_kg * Robot.wheel_radius_m)
        robot = replace(robot, torque_limit_n_m=max(1.0, larger) * Robot.torque_limit_n_m)
    if "yaw_inertia_kg_m2" not in numbers and all(name in numbers for name in _PLATE):
        robot = replace(robot, yaw_inertia_kg_m2=robot.plate_yaw_inertia_kg_m2)
    return robot


_LAW_FIELDS: Final = (*COEFFICIENTS, "sample_period_s")
_WHEEL_FIELDS: Final = ("command_period_s", "command_quantum_rpm", "saturation_rpm")
_ROBOT_FIELDS: Final = tuple(f.name for f in fields(Robot))
_PLATE: Final = ("mass_kg", "half_wheelbase_m", "half_track_m")
_FORCE: Final = ("mass_kg", "wheel_radius_m")
_SECTIONS: Final = ("format", "wheel", "wheels", "robot", "effects", "uncertainty", "provenance")


def _coefficients(law: WheelLaw) -> dict[str, float]:
    return {name: getattr(law, name) for name in COEFFICIENTS}


def _law(where: str, numbers: Mapping[str, float]) -> WheelLaw:
    missing = [name for name in _LAW_FIELDS if name not in numbers]
    if missing:
        raise InputError(f'"{where}" lacks {", ".join(missing)}')
    try:
        return WheelLaw(**numbers).require_stable()
    except InputError as error:
        raise type(error)(f'"{where}": {error}') from error


def _effect(name: str, parameters: Any) -> Mapping[str, float]:
    """Read an effect's parameters; a name that is not known is left for `Model` to refuse."""
    known = EFFECT_PARAMETERS.get(name)
    where = f"effects.{name}"
    return (
        dict(_mapping(where, parameters)) if known is None else _numbers(where, parameters, known, null=known)
    )


def _mapping(where: str, value: Any) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a JSON object, not {type(value).__name__}")
    return value


def _split(where: str, value: Any, known: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a section into our names (misspelt ones too, to be refused) and those of other programs."""
    section = _mapping(where, value)
    ours = {name: item for name, item in section.items() if name in known or did_you_mean(name, known)}
    return ours, {name: item for name, item in section.items() if name not in ours}


def _numbers(where: str, value: Any, known: tuple[str, ...], null: tuple[str, ...] = ()) -> dict[str, float]:
    """Read numbers; JSON has no infinity, so null is one, for the names in `null`."""
    numbers: dict[str, float] = {}
    for name, number in _mapping(where, value).items():
        if name not in known:
            raise InputError(
                f"{where}.{name}: unknown name{did_you_mean(name, known)}; known: {', '.join(known)}"
            )
        if number is None and name in null:
            numbers[name] = math.inf
        elif isinstance(number, bool) or not isinstance(number, int | float):
            raise InputError(f"{where}.{name} = {json.dumps(number)}, must be a number")
        else:
            try:
                numbers[name] = float(number)
            except OverflowError as error:
                raise InputError(f"{where}.{name} is beyond double precision, must be a number") from error
    return numbers


def _infinite_as_null(value: float) -> float | None:
    return None if math.isinf(value) else value
