"""Checks of a model's "uncertainty": what its readers use is of the right shape, whatever else is there."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import fields
from typing import Any, Final

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model.effect_schema import EFFECT_PARAMETERS
from mecanum_env.model.json_fields import mapping, number, require_known
from mecanum_env.model.model import Robot

_ERRORS: Final = ("settled", "transient", "correlation_s")
_SIZE: Final = len(COEFFICIENTS)


def uncertainty_from_dict(value: Any) -> Mapping[str, Any]:
    """Return the section as it is, if its known parts can be used; keys of other programs are kept.

    - `wheel.covariance`: of A-F, 6 rows of 6 numbers, or null; `wheel.names`: a list;
    - `robot.NAME`: the standard error of a number of the robot;
    - `effects.EFFECT.PARAMETER`: `low` and `high`;
    - `model_error.channels.CHANNEL`: `settled`, `transient`, `correlation_s`, or null (see
      `sysid.compare.model_error`).

    Raises:
        InputError: one of these is something else; the message names the field.
    """
    section = mapping("uncertainty", value)
    _check_wheel("uncertainty.wheel", mapping("uncertainty.wheel", section.get("wheel", {})))
    _check_robot("uncertainty.robot", mapping("uncertainty.robot", section.get("robot", {})))
    _check_effects("uncertainty.effects", mapping("uncertainty.effects", section.get("effects", {})))
    if section.get("model_error") is not None:
        _check_model_error("uncertainty.model_error", section["model_error"])
    return section


def _check_wheel(where: str, wheel: Mapping[str, Any]) -> None:
    names, covariance = wheel.get("names", []), wheel.get("covariance")
    if not isinstance(names, list):
        raise InputError(f"{where}.names = {json.dumps(names)}, must be {json.dumps(COEFFICIENTS)}")
    if covariance is None:
        return
    rows = covariance if isinstance(covariance, list) else []
    if [len(row) if isinstance(row, list) else 0 for row in rows] != [_SIZE] * _SIZE:
        raise InputError(
            f"{where}.covariance must be {_SIZE} rows of {_SIZE} numbers, for {', '.join(COEFFICIENTS)}; "
            "make one with `python -m sysid.fit LOGS`, or leave it out"
        )
    for i, row in enumerate(rows):
        for j, item in enumerate(row):
            _finite(f"{where}.covariance[{i}][{j}]", item)


def _check_robot(where: str, errors: Mapping[str, Any]) -> None:
    require_known(where, errors, [one.name for one in fields(Robot) if one.name != "rollers_per_wheel"])
    for name, error in errors.items():
        _not_negative(f"{where}.{name}", error)


def _check_effects(where: str, effects: Mapping[str, Any]) -> None:
    require_known(where, effects, EFFECT_PARAMETERS)
    for effect, value in effects.items():
        parameters = mapping(f"{where}.{effect}", value)
        require_known(f"{where}.{effect}", parameters, EFFECT_PARAMETERS[effect])
        for name, ends in parameters.items():
            place = f"{where}.{effect}.{name}"
            low, high = (_finite(f"{place}.{end}", mapping(place, ends).get(end)) for end in ("low", "high"))
            if low > high:
                raise InputError(f"{place}.low = {low:g}, must be at most high = {high:g}")


def _check_model_error(where: str, value: Any) -> None:
    channels = mapping(f"{where}.channels", mapping(where, value).get("channels"))
    for name, errors in channels.items():
        place = f"{where}.channels.{name}"
        for key in _ERRORS:
            _not_negative(f"{place}.{key}", mapping(place, errors).get(key))


def _finite(where: str, value: Any) -> float:
    found = number(where, value)
    if not math.isfinite(found):
        raise InputError(f"{where} = {found}, must be a finite number")
    return found


def _not_negative(where: str, value: Any) -> None:
    if _finite(where, value) < 0.0:
        raise InputError(f"{where} = {value}, must not be negative")
