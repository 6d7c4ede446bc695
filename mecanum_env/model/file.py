"""Model files, format "mecanum-model/1": model to JSON object and back, read and written whole or not at all.

docs/model-file.md lists the fields.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.files import asset_path, write_json
from mecanum_env.law.coefficients import COEFFICIENTS, WheelLaw
from mecanum_env.model.custom_file import custom_from_json, custom_to_json
from mecanum_env.model.effect_names import EFFECT_PARAMETERS, cause_of, effect_named, form_of
from mecanum_env.model.json_checks import mapping, number_list, numbers, uncertainty_from_dict
from mecanum_env.model.model import ROBOT_NUMBERS, Model, Robot, Wheel
from mecanum_env.model.static_map import LISTS, MAP, map_lists, map_parameters
from mecanum_env.model.wheel_list import wheels_from_json, wheels_to_json
from mecanum_env.outputs import require_whole
from mecanum_env.reading import read_json

FORMAT: Final = "mecanum-model/1"
_SECTIONS: Final = ("format", "wheel", "wheels", "robot", "effects", "custom", "uncertainty", "provenance")
_LAW_FIELDS: Final = (*COEFFICIENTS, "sample_period_s")
_WHEEL_FIELDS: Final = tuple(f.name for f in fields(Wheel) if f.name != "law")
_ROBOT_FIELDS: Final = (*ROBOT_NUMBERS, "wheels")
_WINDUPS: Final = ("windup", "servo_windup")
"""Numbers of the wheel and the robot that are left out where they are 0."""


def model_to_dict(model: Model) -> dict[str, Any]:
    """Return the JSON object of a model."""
    wheel = model.wheel
    value: dict[str, Any] = {
        "format": FORMAT,
        "wheel": {
            **{name: getattr(wheel.law, name) for name in _LAW_FIELDS},
            **{n: _infinite_as_null(getattr(wheel, n)) for n in _WHEEL_FIELDS if _is_written(n, wheel)},
            **model.extra.get("wheel", {}),
        },
        "robot": {
            **{n: getattr(model.robot, n) for n in ROBOT_NUMBERS if _is_written(n, model.robot)},
            **({"wheels": wheels_to_json(model.robot.wheels)} if model.robot.wheels else {}),
            **model.extra.get("robot", {}),
        },
        "effects": {cause_of(name): _effect_to_dict(name, values) for name, values in model.effects.items()},
        "uncertainty": dict(model.uncertainty),
        "provenance": dict(model.provenance),
        **{name: item for name, item in model.extra.items() if name not in _SECTIONS},
    }
    if model.custom:
        value["custom"] = custom_to_json(model.custom)
    if model.wheels:
        value["wheels"] = {
            wheel: {name: getattr(law, name) for name in COEFFICIENTS} for wheel, law in model.wheels.items()
        }
    return value


def _is_written(name: str, section: Wheel | Robot) -> bool:
    """Return whether the file has a number of a section; those from before the windups stay the same."""
    return name not in _WINDUPS or getattr(section, name) > 0.0


def model_from_dict(value: Any) -> Model:
    """Build a model from a JSON object `value`; the messages name the field.

    Raises:
        InputError: a missing, misspelt, non-finite or impossible value.
        UnstableLawError: a wheel law is unstable.
    """
    top = mapping("the file", value)
    if top.get("format") != FORMAT:
        raise InputError(
            f'"format" is {top.get("format")!r}, must be "{FORMAT}"; a model file is what '
            "`python -m sysid.fit LOGS` writes: fit again with this version"
        )
    if "wheel" not in top:
        raise InputError('"wheel" is missing; it holds A..F and sample_period_s')
    wheel_section, wheel_extra = _split("wheel", top["wheel"], (*_LAW_FIELDS, *_WHEEL_FIELDS))
    robot_section, robot_extra = _split("robot", top.get("robot", {}), _ROBOT_FIELDS)
    extra = {name: item for name, item in top.items() if name not in _SECTIONS}
    values = numbers("wheel", wheel_section, (*_LAW_FIELDS, *_WHEEL_FIELDS), null=("saturation_rpm",))
    law = _law("wheel", {name: values.pop(name) for name in _LAW_FIELDS if name in values})
    wheels = {}
    for name, section in mapping("wheels", top.get("wheels", {})).items():
        coefficients = numbers(f"wheels.{name}", section, COEFFICIENTS)
        wheels[name] = _law(f"wheels.{name}", {**coefficients, "sample_period_s": law.sample_period_s})
    return Model(
        wheel=Wheel(law, **values),
        robot=robot_from_dict(robot_section),
        effects=dict(_effect(*item) for item in mapping("effects", top.get("effects", {})).items()),
        uncertainty=dict(uncertainty_from_dict(top.get("uncertainty", {}))),
        provenance=dict(mapping("provenance", top.get("provenance", {}))),
        extra=extra | {k: v for k, v in (("wheel", wheel_extra), ("robot", robot_extra)) if v},
        wheels=wheels,
        custom=custom_from_json(top.get("custom", [])),
    )


def robot_from_dict(value: Any) -> Robot:
    """Build a robot from a partial JSON object `value`; the packaged robot's values fill in what is absent.

    Some of them are adapted to another robot. If mass, wheelbase and track are given, the yaw inertia is
    that of a solid plate. If mass and wheel radius are given, the torque limit is raised so that the robot
    accelerates at least as hard as the packaged one, and the servo is so stiff that the load m R^2 / 4 lags
    as far behind it as the packaged one's: on rollers a much stiffer servo rings against the floor's contacts
    at the step rate, and throws a light robot about. With a list of omni wheels and no radius, that of the
    first wheel is taken.

    Raises:
        InputError: an unknown name, or a value out of range.
    """
    section = dict(mapping("robot", value))
    wheels = wheels_from_json(section.pop("wheels")) if "wheels" in section else ()
    given: dict[str, Any] = dict(numbers("robot", section, ROBOT_NUMBERS))
    if given.get("rollers_per_wheel", math.nan).is_integer():
        given["rollers_per_wheel"] = int(given["rollers_per_wheel"])
    if wheels:
        given.setdefault("wheel_radius_m", wheels[0].radius_m)
    robot = Robot(**given, wheels=wheels)
    if "torque_limit_n_m" not in given and {"mass_kg", "wheel_radius_m"} <= given.keys():
        larger = robot.mass_kg * robot.wheel_radius_m / (Robot.mass_kg * Robot.wheel_radius_m)
        robot = replace(robot, torque_limit_n_m=max(1.0, larger) * Robot.torque_limit_n_m)
    if "servo_n_m_s_rad" not in given and {"mass_kg", "wheel_radius_m"} <= given.keys():
        load = robot.mass_kg * robot.wheel_radius_m**2 / (Robot.mass_kg * Robot.wheel_radius_m**2)
        robot = replace(robot, servo_n_m_s_rad=load * Robot.servo_n_m_s_rad)
    plate = {"mass_kg", "half_wheelbase_m", "half_track_m"}
    if "yaw_inertia_kg_m2" not in given and plate <= given.keys():
        robot = replace(robot, yaw_inertia_kg_m2=robot.plate_yaw_inertia_kg_m2)
    return robot


def read_model(path: str | os.PathLike[str]) -> Model:
    """Read a `model.json` from a path.

    Raises:
        InputError: no such file, not JSON, another format, a missing, misspelt or impossible value.
        UnstableLawError: the wheel law is unstable; the message lists the poles.
    """
    require_whole(path)
    inside = Path(path) / "model.json"
    if os.path.isfile(inside):
        raise InputError(f"{path}: is a folder, must be a file; did you mean {inside}?")
    value = read_json(path, "make a model with `python -m sysid.fit LOGS`")
    try:
        return model_from_dict(value)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def read_robot(path: str | os.PathLike[str]) -> Robot:
    """Read a robot from a JSON file at `path` with any of the keys of a model's "robot" section.

    Raises:
        InputError: no such file, not JSON, an unknown name or an impossible value.
    """
    value = read_json(path, "it holds any keys of a model's robot section, such as wheel_radius_m")
    try:
        return robot_from_dict(value)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error


def write_model(model: Model, path: str | os.PathLike[str]) -> None:
    """Write a model to a path in full precision, whole or not at all: `read_model` returns it unchanged.

    Raises:
        UnstableLawError: a law is unstable, and `read_model` would refuse it.
        InputError: the path cannot be written, or `uncertainty`, `provenance`, `extra` hold NaN or infinity.
    """
    for law in (model.wheel.law, *model.wheels.values()):
        law.require_stable()
    write_json(path, model_to_dict(model))


def model_sha256(model: Model) -> str:
    """Return the checksum of a model with its history, by which records name it."""
    return hashlib.sha256(json.dumps(model_to_dict(model), sort_keys=True).encode()).hexdigest()


def paper_model() -> Model:
    """Return the packaged model of the paper (coefficients renormalised; sample period inferred)."""
    return read_model(asset_path("models/paper.json"))


def _law(where: str, numbers: Mapping[str, float]) -> WheelLaw:
    missing = [name for name in _LAW_FIELDS if name not in numbers]
    if missing:
        raise InputError(f'"{where}" lacks {", ".join(missing)}')
    try:
        return WheelLaw(**numbers).require_stable()
    except InputError as error:
        raise type(error)(f'"{where}": {error}') from error


def _effect(cause: str, section: Any) -> tuple[str, Mapping[str, float]]:
    """Read an effect and its parameters; an unknown name is left for `Model` to refuse."""
    where = f"effects.{cause}"
    parameters = dict(mapping(where, section))
    form = parameters.pop("form", None)
    if form is not None and not isinstance(form, str):
        raise InputError(f"{where}.form = {form!r}, must be the name of a form")
    name = effect_named(cause, form)
    known = EFFECT_PARAMETERS.get(name)
    if name == MAP and any(one in parameters for one in LISTS):
        return name, _static_map(where, parameters)
    return name, parameters if known is None else numbers(where, parameters, known, null=known)


def _static_map(where: str, parameters: Mapping[str, Any]) -> dict[str, float]:
    """Read the lists of a static map."""
    rows = {one: number_list(f"{where}.{one}", parameters[one]) for one in LISTS if one in parameters}
    if rows.keys() != parameters.keys() or len(rows) < len(LISTS):
        raise InputError(f"{where} has {', '.join(parameters)}; must be {' and '.join(LISTS)}")
    try:
        return map_parameters(*(rows[one] for one in LISTS))
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def _effect_to_dict(name: str, values: Mapping[str, float]) -> dict[str, Any]:
    """Return the section of an effect; the first form of a cause is not mentioned."""
    if name == MAP and (lists := map_lists(values)) is not None:
        return dict(lists)
    numbers = {key: _infinite_as_null(number) for key, number in values.items()}
    return {"form": form_of(name), **numbers} if name != cause_of(name) else numbers


def _split(where: str, value: Any, known: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Split a section into known names (misspelt ones too, to be refused) and those of other programs."""
    section = mapping(where, value)
    ours = {name: item for name, item in section.items() if name in known or did_you_mean(name, known)}
    return ours, {name: item for name, item in section.items() if name not in ours}


def _infinite_as_null(value: float) -> float | None:
    return None if math.isinf(value) else value
