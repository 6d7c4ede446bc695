"""The static map of a drive as a model holds it: lists of knots and values in a file, numbered in an effect.

    {"static_map": {"knots_rpm": [15, 80], "values_rpm": [0, 80]}}
    model.with_effect("static_map", **map_parameters([15, 80], [0, 80]))

`mecanum_env.wheel_drive.set_point.mapped` is what it does.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import takewhile
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.wheel_drive.set_point import MAP_KNOTS, MAP_PARAMETERS, require_map

MAP: Final = "static_map"
"""Name of the effect."""
LISTS: Final = ("knots_rpm", "values_rpm")
"""Names of the two lists in a model file."""
_KNOTS, _VALUES = MAP_PARAMETERS[:MAP_KNOTS], MAP_PARAMETERS[MAP_KNOTS:]


def map_parameters(knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> dict[str, float]:
    """Return the parameters of the effect for a map through knots with these values [rpm].

    Raises:
        InputError: no such map is possible, see `require_map`.
    """
    require_map(knots_rpm, values_rpm)
    return {**dict(zip(_KNOTS, knots_rpm, strict=False)), **dict(zip(_VALUES, values_rpm, strict=False))}


def map_lists(parameters: Mapping[str, float]) -> dict[str, list[float]] | None:
    """Return the two lists of a model file for the parameters of the effect.

    None if the lists would not give back the same parameters, as where a knot lacks its value or is not used.
    """
    knots, values = (
        [parameters[name] for name in takewhile(parameters.__contains__, names)]
        for names in (_KNOTS, _VALUES)
    )
    try:
        same = map_parameters(knots, values).keys() == parameters.keys()
    except InputError:
        same = False
    return dict(zip(LISTS, (knots, values), strict=True)) if same else None


def map_points(parameters: Mapping[str, float]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the knots that a map uses, and their values [rpm], given all parameters of the effect.

    Knots are used as long as they increase; the others are 0, and so are their values.

    Raises:
        InputError: a knot that is not above the one before it, nor unused.
    """
    points = [(parameters[knot], parameters[value]) for knot, value in zip(_KNOTS, _VALUES, strict=True)]
    used = 1
    while used < len(points) and points[used][0] > points[used - 1][0]:
        used += 1
    for index, point in enumerate(points[used:], used):
        if point != (0.0, 0.0):
            raise InputError(
                f"{_KNOTS[index]} = {point[0]:g}, must be above {_KNOTS[index - 1]} = "
                f"{points[index - 1][0]:g}, or 0 with value 0 where it is not used"
            )
    knots, values = zip(*points[:used], strict=True)
    return knots, values
