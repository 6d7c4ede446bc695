"""Checks of parsed JSON: objects, numbers and names, and the "uncertainty" section of a model file.

Each message begins with the place of what is wrong, such as "robot.mass_kg".
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.model.effect_names import EFFECT_PARAMETERS
from mecanum_env.model.model import ROBOT_NUMBERS

_SIZE: Final = len(COEFFICIENTS)


def mapping(where: str, value: Any) -> Mapping[str, Any]:
    """Return `value` if it is a JSON object.

    Raises:
        InputError: it is something else; the message begins with `where`.
    """
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a JSON object, not {type(value).__name__}")
    return value


def number(where: str, value: Any) -> float:
    """Return `value` in double precision if it is a number.

    Raises:
        InputError: it is something else; the message begins with `where`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} = {json.dumps(value)}, must be a number")
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(f"{where} is beyond double precision, must be a number") from error


def number_list(where: str, value: Any) -> list[float]:
    """Return `value` in double precision if it is a list of numbers.

    Raises:
        InputError: it is something else; the message begins with `where`.
    """
    if not isinstance(value, list):
        raise InputError(f"{where} = {json.dumps(value)}, must be a list of numbers")
    return [number(f"{where}[{index}]", item) for index, item in enumerate(value)]


def numbers(where: str, value: Any, known: Collection[str], null: Collection[str] = ()) -> dict[str, float]:
    """Return the numbers of the JSON object `value` by name; `where` is its place in the file.

    It may have the names `known`; those in `null` may be null, which stands for infinity (JSON has none).

    Raises:
        InputError: `value` is no object, has a name that is not known, or a value that is no number.
    """
    section = mapping(where, value)
    _require_known(where, section, known)
    return {
        name: math.inf if item is None and name in null else number(f"{where}.{name}", item)
        for name, item in section.items()
    }


def uncertainty_from_dict(value: Any) -> Mapping[str, Any]:
    """Return the "uncertainty" section unchanged if its known parts are valid; other keys are kept.

    - `wheel.covariance`: covariance of A-F, 6 rows of 6 numbers, or null; `wheel.names`: a list;
    - `robot.NAME`: standard error of a number of the robot;
    - `effects.EFFECT.PARAMETER`: `low` and `high` of its interval;
    - `joint.covariance`: covariance of what `joint.names` lists, A-F and "EFFECT.PARAMETER", a row for each;
    - `adopted.covariance`: the same of parameters of effects that studies added, and `adopted.new`, a list of
      those effects that are newer than the logs of the fit;
    - `model_error.channels.CHANNEL`: `settled`, `transient`, `correlation_s`, or null (see
      `sysid.compare.model_error`);
    - `commands_between_rows.late_s`: see `sysid.compare.links`.

    Raises:
        InputError: the section or one of these values is something else; the message names the field.
    """
    section = mapping("uncertainty", value)
    _check_wheel("uncertainty.wheel", mapping("uncertainty.wheel", section.get("wheel", {})))
    _check_robot("uncertainty.robot", mapping("uncertainty.robot", section.get("robot", {})))
    _check_effects("uncertainty.effects", mapping("uncertainty.effects", section.get("effects", {})))
    for key in ("joint", "adopted"):
        if section.get(key) is not None:
            _check_joint(f"uncertainty.{key}", mapping(f"uncertainty.{key}", section[key]))
    if section.get("model_error") is not None:
        where = "uncertainty.model_error"
        channels = mapping(f"{where}.channels", mapping(where, section["model_error"]).get("channels"))
        for name, errors in channels.items():
            place = f"{where}.channels.{name}"
            for key in ("settled", "transient", "correlation_s"):
                _not_negative(f"{place}.{key}", mapping(place, errors).get(key))
    if section.get("commands_between_rows") is not None:
        where = "uncertainty.commands_between_rows"
        _not_negative(f"{where}.late_s", mapping(where, section["commands_between_rows"]).get("late_s"))
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


def _check_joint(where: str, joint: Mapping[str, Any]) -> None:
    names, rows = joint.get("names"), joint.get("covariance")
    if not isinstance(names, list):
        raise InputError(f"{where}.names = {json.dumps(names)}, must be a list of names")
    known = [*COEFFICIENTS, *(f"{name}.{p}" for name, values in EFFECT_PARAMETERS.items() for p in values)]
    _require_known(f"{where}.names", names, known)
    sizes = [len(row) if isinstance(row, list) else 0 for row in rows] if isinstance(rows, list) else []
    if not isinstance(rows, list) or sizes != [len(names)] * len(names):
        raise InputError(f"{where}.covariance must be {len(names)} rows of {len(names)} numbers")
    for i, row in enumerate(rows):
        for j, item in enumerate(row):
            _finite(f"{where}.covariance[{i}][{j}]", item)
    if not isinstance(new := joint.get("new", []), list):
        raise InputError(f"{where}.new = {json.dumps(new)}, must be a list of names")
    _require_known(f"{where}.new", new, EFFECT_PARAMETERS)


def _check_robot(where: str, errors: Mapping[str, Any]) -> None:
    _require_known(where, errors, [one for one in ROBOT_NUMBERS if one != "rollers_per_wheel"])
    for name, error in errors.items():
        _not_negative(f"{where}.{name}", error)


def _check_effects(where: str, effects: Mapping[str, Any]) -> None:
    _require_known(where, effects, EFFECT_PARAMETERS)
    for effect, value in effects.items():
        parameters = mapping(f"{where}.{effect}", value)
        _require_known(f"{where}.{effect}", parameters, EFFECT_PARAMETERS[effect])
        for name, ends in parameters.items():
            place = f"{where}.{effect}.{name}"
            low, high = (_finite(f"{place}.{end}", mapping(place, ends).get(end)) for end in ("low", "high"))
            if low > high:
                raise InputError(f"{place}.low = {low:g}, must be at most high = {high:g}")


def _require_known(where: str, names: Collection[str], known: Collection[str]) -> None:
    for name in names:
        if name not in known:
            raise InputError(
                f"{where}.{name}: unknown name{did_you_mean(name, known)}; known: {', '.join(known)}"
            )


def _finite(where: str, value: Any) -> float:
    found = number(where, value)
    if not math.isfinite(found):
        raise InputError(f"{where} = {found}, must be a finite number")
    return found


def _not_negative(where: str, value: Any) -> None:
    if _finite(where, value) < 0.0:
        raise InputError(f"{where} = {value}, must not be negative")
