"""Objects and numbers out of parsed JSON, refused by name where they are something else."""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Mapping
from typing import Any

from mecanum_env.errors import InputError, did_you_mean


def mapping(where: str, value: Any) -> Mapping[str, Any]:
    """Return `value`, a JSON object.

    Raises:
        InputError: it is none; the message begins with `where`.
    """
    if not isinstance(value, dict):
        raise InputError(f"{where} must be a JSON object, not {type(value).__name__}")
    return value


def number(where: str, value: Any) -> float:
    """Return `value`, a number, in double precision.

    Raises:
        InputError: it is none; the message begins with `where`.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{where} = {json.dumps(value)}, must be a number")
    try:
        return float(value)
    except OverflowError as error:
        raise InputError(f"{where} is beyond double precision, must be a number") from error


def require_known(where: str, names: Collection[str], known: Collection[str]) -> None:
    """Refuse a name that is not known.

    Args:
        where: of the section; the message begins with it.
        names: that the section has.
        known: those that it may have.

    Raises:
        InputError: one of `names` is not in `known`.
    """
    for name in names:
        if name not in known:
            raise InputError(
                f"{where}.{name}: unknown name{did_you_mean(name, known)}; known: {', '.join(known)}"
            )


def numbers(where: str, value: Any, known: Collection[str], null: Collection[str] = ()) -> dict[str, float]:
    """Return the numbers of an object by name; JSON has no infinity, so null is one, for names in `null`.

    Args:
        where: of the section; the message begins with it.
        value: the object.
        known: names that it may have.
        null: those that may be infinite.

    Raises:
        InputError: no object, a name that is not in `known`, or no number.
    """
    section = mapping(where, value)
    require_known(where, section, known)
    return {
        name: math.inf if item is None and name in null else number(f"{where}.{name}", item)
        for name, item in section.items()
    }
