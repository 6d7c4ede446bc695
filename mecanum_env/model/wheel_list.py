"""The list of omni wheels in the "robot" section of a file, to and from JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Final

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.model.json_checks import mapping, number
from mecanum_env.omni import OmniWheel

_FIELDS: Final = tuple(one.name for one in fields(OmniWheel))
_REQUIRED: Final = ("angle_deg", "distance_m", "radius_m")


def wheels_from_json(value: Any) -> tuple[OmniWheel, ...]:
    """Return the wheels of the list `value`; a wheel without a name is called by its place: "1", "2" ...

    Raises:
        InputError: no list, an unknown or missing name, or a value out of range; the message names the wheel.
    """
    if not isinstance(value, list) or not value:
        raise InputError(
            "robot.wheels must be a list of wheels: objects with angle_deg, distance_m, radius_m"
        )
    return tuple(_wheel(f"robot.wheels[{index}]", str(index + 1), one) for index, one in enumerate(value))


def wheels_to_json(wheels: Sequence[OmniWheel]) -> list[dict[str, Any]]:
    """Return the JSON list of `wheels`; what is at its default of None is left out."""
    return [
        {name: getattr(wheel, name) for name in _FIELDS if getattr(wheel, name) is not None}
        for wheel in wheels
    ]


def _wheel(where: str, name: str, value: Any) -> OmniWheel:
    section = dict(mapping(where, value))
    for key in section:
        if key not in _FIELDS:
            raise InputError(
                f"{where}.{key}: unknown name{did_you_mean(key, _FIELDS)}; known: {', '.join(_FIELDS)}"
            )
    missing = [key for key in _REQUIRED if key not in section]
    if missing:
        raise InputError(f"{where} lacks {', '.join(missing)}")
    stated = section.pop("name", name)
    if not isinstance(stated, str) or (not stated.isidentifier() and not stated.isalnum()):
        raise InputError(f"{where}.name = {stated!r}, must be letters, digits and underscores")
    try:
        return OmniWheel(stated, **{key: number(f"{where}.{key}", item) for key, item in section.items()})
    except InputError as error:
        raise InputError(f"{where}: {error}" if not str(error).startswith(where) else str(error)) from error
