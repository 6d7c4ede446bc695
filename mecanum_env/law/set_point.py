"""What a drive does to a single command on the way to its setpoint, as functions of numbers.

`mecanum_env.law.drive.received_command` applies them in order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray


def warm_up_gain(share: float, time_constant_s: float, seconds: npt.ArrayLike) -> FloatArray:
    """Return the gain of a drive that warms up: 1 - share (1 - exp(-t / time constant)), of the shape of t.

    `share` is what is lost of the gain in the end, below 0 for a gain that rises; `time_constant_s` [s] is
    above 0, and `seconds` are the times t since the start [s].
    """
    # The exponential is that of the C library, which the plugin calls: numpy's own differs in the last bit.
    cooled = np.vectorize(math.exp, otypes=[float])(-np.asarray(seconds, float) / time_constant_s)
    return np.asarray(1.0 - share * (1.0 - cooled))


def saturated(command_rpm: FloatArray, limit_rpm: float, softness_rpm: float) -> FloatArray:
    """Limit commands to +-limit [rpm], along a parabola from `softness_rpm` below it to as much above it."""
    command, knee = command_rpm, min(softness_rpm, limit_rpm)
    if knee > 0.0 and math.isfinite(limit_rpm):
        beyond = np.abs(command) - (limit_rpm - knee)
        on_knee = np.clip(beyond, 0.0, 2.0 * knee)  # further out the square may overflow
        bent = np.copysign(limit_rpm - knee + beyond - on_knee * on_knee / (4.0 * knee), command)
        command = np.where((beyond > 0.0) & (beyond < 2.0 * knee), bent, command)
    return np.asarray(np.minimum(np.maximum(command, -limit_rpm), limit_rpm))


MAP_KNOTS: Final = 6
"""Most knots of a static map."""


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


def mapped(command_rpm: FloatArray, knots_rpm: Sequence[float], values_rpm: Sequence[float]) -> FloatArray:
    """Return commands [rpm] after a static map through knots with these values [rpm]; no knots are no map.

    `require_map` says which maps there are. A map is linear between knots and keeps its offset beyond the
    outermost ones. Without a knot below 0 it is mirrored and passes through 0.
    """
    if not knots_rpm:
        return command_rpm
    mirrored, x, y = _corners(knots_rpm, values_rpm)
    u = np.abs(command_rpm) if mirrored else np.asarray(command_rpm, float)
    above = np.searchsorted(x, u, side="left")  # the first corner that is not below u
    left, right = np.maximum(above - 1, 0), np.minimum(above, x.size - 1)
    width = x[right] - x[left]
    # Beyond the outermost corners both neighbours are the same one.
    along = np.where(width > 0.0, (u - x[left]) / np.where(width > 0.0, width, 1.0), 0.0)
    inside = y[left] + (y[right] - y[left]) * along
    out = np.where(width > 0.0, inside, y[left] + (u - x[left]))
    return np.asarray(np.copysign(out, command_rpm) if mirrored else out)


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
