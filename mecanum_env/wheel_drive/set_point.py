"""What a drive does to a single command on the way to its setpoint, as functions of numbers.

`mecanum_env.wheel_drive.shaping.shaped` applies them in order. Each takes one drive's numbers, or arrays with
those of many drives.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.arrays import exponentials, floats, namespace
from mecanum_env.units import FloatArray

MAP_KNOTS: Final = 6
"""Most knots of a static map."""
MAP_PARAMETERS: Final = tuple(f"{one}_{i}_rpm" for one in ("knot", "value") for i in range(1, MAP_KNOTS + 1))
"""Names of the knots of a static map, and then of their values."""


def warm_up_gain(share: npt.ArrayLike, time_constant_s: npt.ArrayLike, seconds: npt.ArrayLike) -> FloatArray:
    """Return the gain of a drive that warms up: 1 - share (1 - exp(-t / time constant)); shapes broadcast.

    `share` is what is lost of the gain in the end, below 0 for a gain that rises; `time_constant_s` [s] is
    above 0, and `seconds` are the times t since the start [s].
    """
    cooled = exponentials(floats(-floats(seconds) / floats(time_constant_s)))
    gain: FloatArray = floats(1.0 - floats(share) * (1.0 - cooled))
    return gain


def saturated(command_rpm: FloatArray, limit_rpm: npt.ArrayLike, softness_rpm: npt.ArrayLike) -> FloatArray:
    """Limit commands to +-limit [rpm], along a parabola from `softness_rpm` below it to as much above it.

    All shapes broadcast. A limit of 0 or infinity is none.
    """
    xp, softness = namespace(command_rpm), floats(softness_rpm)
    limit = xp.where(floats(limit_rpm) > 0.0, limit_rpm, math.inf)
    command = command_rpm
    if bool((softness > 0.0).any()):
        knee = xp.where(xp.isfinite(limit), xp.minimum(softness, limit), 0.0)
        corner = xp.where(xp.isfinite(limit), limit - knee, 0.0)
        width = xp.where(knee > 0.0, knee, 1.0)
        beyond = xp.abs(command_rpm) - corner
        on_knee = xp.minimum(xp.clip(beyond, 0.0, None), 2.0 * width)  # further out the square may overflow
        # The parabola leaves the line with slope 1 and reaches the limit with slope 0.
        bent = xp.copysign(corner + beyond - on_knee * on_knee / (4.0 * width), command_rpm)
        command = xp.where((knee > 0.0) & (beyond > 0.0) & (beyond < 2.0 * knee), bent, command_rpm)
    within: FloatArray = floats(xp.minimum(xp.maximum(command, -limit), limit))
    return within


def require_map(knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> None:
    """Refuse a static map that `mapped` cannot follow; no knots at all are no map.

    Raises:
        InputError: lists of different length, more than `MAP_KNOTS`, knots that do not increase or all lie
            below 0, values that decrease, or a mirrored map (no knot below 0) that jumps at 0.
    """
    knots, values = list(knots_rpm), list(values_rpm)
    if len(knots) != len(values) or len(knots) > MAP_KNOTS:
        raise InputError(
            f"{len(knots)} knots_rpm and {len(values)} values_rpm, must be as many, at most {MAP_KNOTS}"
        )
    if not all(math.isfinite(number) for number in (*knots, *values)):
        raise InputError(f"knots_rpm = {knots}, values_rpm = {values}, must be finite numbers")
    if any(after <= before for before, after in pairwise(knots)):
        raise InputError(f"knots_rpm = {knots}, must increase")
    if any(after < before for before, after in pairwise(values)):
        raise InputError(f"values_rpm = {values}, must not decrease")
    if knots and knots[-1] < 0.0:
        raise InputError(f"knots_rpm = {knots}, must reach 0; a last knot 0 with value 0 ends it there")
    if knots and knots[0] >= 0.0 and (values[0] < 0.0 or (knots[0] == 0.0 and values[0] != 0.0)):
        raise InputError(
            f"knots_rpm = {knots}, values_rpm = {values}: without a knot below 0 a map is mirrored, "
            "so no value may be below 0, and that at 0 must be 0"
        )


def map_numbers(knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> dict[str, float]:
    """Return a static map through knots with these values [rpm] as numbers by name, unused ones 0."""
    rows = (*knots_rpm, *[0.0] * (MAP_KNOTS - len(knots_rpm)), *values_rpm)
    numbers = dict.fromkeys(MAP_PARAMETERS, 0.0) | dict(zip(MAP_PARAMETERS, rows, strict=False))
    return {"map_knots": float(len(knots_rpm)), **numbers}


def mapped(
    command_rpm: FloatArray,
    knots_rpm: Sequence[npt.ArrayLike],
    values_rpm: Sequence[npt.ArrayLike],
    count: npt.ArrayLike | None = None,
) -> FloatArray:
    """Return commands [rpm] after a static map through knots with these values [rpm]; no knots are no map.

    `require_map` says which maps there are. A map is linear between knots and keeps its offset beyond the
    outermost ones. Without a knot below 0 it is mirrored and passes through 0. Knots and values may be arrays
    of a shape that broadcasts, of which only the first `count` are used; by default all of them.
    """
    xp, used = namespace(command_rpm), floats(len(knots_rpm) if count is None else count)
    if not bool((used > 0).any()):
        return command_rpm
    x, y = ([floats(one) for one in row] for row in (knots_rpm, values_rpm))
    mirrored = x[0] >= 0.0
    u = xp.where(mirrored, xp.abs(command_rpm), command_rpm)
    below = [(i < used) & (knot < u) for i, knot in enumerate(x)]
    # The corners to the left and to the right; beyond the outermost ones both are the same.
    left_x, left_y = xp.where(mirrored, 0.0, x[0]), xp.where(mirrored, 0.0, y[0])
    for is_below, knot, value in zip(below, x, y, strict=True):
        left_x, left_y = xp.where(is_below, knot, left_x), xp.where(is_below, value, left_y)
    right_x, right_y = left_x, left_y
    for i in reversed(range(len(x))):
        is_next = (i < used) & ~below[i]
        right_x, right_y = xp.where(is_next, x[i], right_x), xp.where(is_next, y[i], right_y)
    width = right_x - left_x
    inside = left_y + (right_y - left_y) * ((u - left_x) / xp.where(width > 0.0, width, 1.0))
    out = xp.where(width > 0.0, inside, left_y + (u - left_x))
    signed = xp.where(mirrored, xp.copysign(out, command_rpm), out)
    mapped_rpm: FloatArray = xp.where(used > 0, signed, command_rpm)
    return mapped_rpm


def unmapped(speed_rpm: FloatArray, knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> FloatArray:
    """Return commands [rpm] of which `mapped` makes these ones; of several possible ones any, 0 for 0."""
    if not knots_rpm:
        return speed_rpm
    mirrored, x, y = _corners(knots_rpm, values_rpm)
    w = np.abs(speed_rpm) if mirrored else np.asarray(speed_rpm, float)
    u = np.where(w < y[0], x[0] + (w - y[0]), np.where(w > y[-1], x[-1] + (w - y[-1]), np.interp(w, y, x)))
    at_rest = (w == 0.0) & (mapped(np.zeros(()), knots_rpm, values_rpm) == 0.0)
    return np.asarray(np.where(at_rest, 0.0, np.copysign(u, speed_rpm) if mirrored else u))


def _corners(knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> tuple[bool, FloatArray, FloatArray]:
    """Return whether a static map is mirrored, and its corners: those above 0 and 0 itself if so."""
    x, y = np.array(knots_rpm, float), np.array(values_rpm, float)
    if x[0] < 0.0:
        return False, x, y
    return True, np.append(0.0, x[x > 0.0]), np.append(0.0, y[x > 0.0])
