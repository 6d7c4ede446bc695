"""What driving and replaying have in common in talking with a page."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.view.choices import Choice
from mecanum_env.view.picture import AROUND, Camera
from mecanum_env.view.server import Message

_DISTANCES_M: Final = (0.8, 12.0)
_ELEVATIONS_DEG: Final = (-89.0, -3.0)


def number(message: Message, name: str) -> float:
    """Return the finite number that a message holds under a name.

    Raises:
        InputError: there is none.
    """
    value = message.get(name)
    # A bool is an int in Python; an int may be too large for a float.
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e9:
        raise InputError(f"{message['type']}.{name} = {value!r}, must be a number")
    return float(value)


def clip(value: float, limit: float) -> float:
    """Return a value within +- `limit`."""
    return math.copysign(min(abs(value), limit), value)


def camera_of(message: Message, cameras: Sequence[str]) -> Camera:
    """Return the camera that a message asks for, one of these `cameras`.

    Raises:
        InputError: it asks for none of them.
    """
    if message.get("name") not in cameras:
        raise InputError(f"camera.name = {message.get('name')!r}, must be one of {', '.join(cameras)}")
    if message["name"] != AROUND:
        return Camera(message["name"])
    azimuth, elevation, distance = (number(message, name) for name in ("azimuth", "elevation", "distance"))
    (nearest, farthest), (steepest, flattest) = _DISTANCES_M, _ELEVATIONS_DEG
    return Camera(
        AROUND,
        math.remainder(azimuth, 360.0),
        min(max(elevation, steepest), flattest),
        min(max(distance, nearest), farthest),
    )


def switched(on: Collection[str], message: Message, choices: Sequence[Choice]) -> frozenset[str]:
    """Return the names of the effects that are `on` once a message has switched one of the `choices`.

    Raises:
        InputError: it names none that can be switched.
    """
    name = message.get("name")
    possible = [choice.name for choice in choices if not choice.why_not]
    if name not in possible:
        raise InputError(f"effect.name = {name!r}, must be one of {', '.join(possible)}")
    return frozenset(on) | {name} if message.get("on") is True else frozenset(on) - {name}


def camera_row(camera: Camera) -> Message:
    """Return a camera as a page knows it."""
    return {
        "name": camera.name,
        "azimuth": camera.azimuth_deg,
        "elevation": camera.elevation_deg,
        "distance": camera.distance_m,
    }


def effect_rows(choices: Sequence[Choice], on: Collection[str]) -> list[Message]:
    """Return the `choices` as a page shows them, with what is `on`, by name."""
    return [
        {
            "name": choice.name,
            "label": choice.label,
            "summary": choice.summary,
            "in_model": choice.in_model,
            "why_not": choice.why_not,
            "on": choice.name in on,
        }
        for choice in choices
    ]
