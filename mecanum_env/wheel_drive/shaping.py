"""What a drive does to a command that it has latched: rounding, dead bands, gains, static map and ceiling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.arrays import floats, namespace
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.program import evaluate_sets
from mecanum_env.wheel_drive.set_point import MAP_KNOTS, MAP_PARAMETERS, mapped, saturated, warm_up_gain

_ABSURD_RPM: Final = 1e10
"""Commands beyond this [rpm], and NaN, count as 0, as they do for MuJoCo's own actuators."""


def rounded(command_rpm: npt.ArrayLike, quantum_rpm: npt.ArrayLike) -> FloatArray:
    """Return commands rounded to a quantum [rpm], halves to even; 0: not rounded. NaN counts as 0."""
    command, quantum = floats(command_rpm), floats(quantum_rpm)
    xp, command = namespace(command), _sane(command)
    step = xp.where(quantum > 0.0, quantum, 1.0)
    whole: FloatArray = xp.where(quantum > 0.0, xp.round(command / step) * step, command)
    return whole


def shaped(
    p: Mapping[str, Any],
    command_rpm: npt.ArrayLike,
    seconds: npt.ArrayLike,
    speed_rpm: npt.ArrayLike = 0.0,
    angle_rad: npt.ArrayLike = 0.0,
    lost_v: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return rounded commands [rpm] as the drive takes them.

    All shapes broadcast; arrays may be of either kind of `mecanum_env.law.arrays`. The parameters `p` are
    those of `mecanum_env.wheel_drive.parameters` by name, and `seconds` is the time since the start at which
    a command takes effect [s]. `speed_rpm` and `angle_rad` are those of the wheel when the command is
    latched, which custom effects may use, and `lost_v` [V] is how far the supply is then below its voltage at
    the start.
    """

    def with_custom(name: str, command: FloatArray) -> FloatArray:
        if not np.any(p[name]):
            return command
        given = {"command": command, "speed": speed_rpm, "angle": angle_rad, "time": seconds}
        given["voltage"] = lost_v
        return _sane(command + evaluate_sets(p[name], given))

    gain, ratio, drop, lost, warm_up_s = (
        floats(p[name]) for name in ("gain", "reverse_ratio", "drop_per_s", "subtracted_rpm", "warm_up_s")
    )
    command = floats(command_rpm)
    xp = namespace(command)
    command = with_custom("command_program", command)
    command = xp.where(xp.abs(command) < p["deadband_rpm"], 0.0, command)
    if bool((lost > 0.0).any()):
        beyond = xp.where(xp.abs(command) > lost, command - xp.copysign(lost, command), 0.0)
        command = xp.where(lost > 0.0, beyond, command)
    command = command * xp.where(gain > 0.0, gain, 1.0)
    command = xp.where((ratio > 0.0) & (command < 0.0), command * ratio, command)
    command = command * xp.clip(1.0 - drop * floats(seconds), 0.0, None)
    command = command * xp.clip(1.0 - floats(p["gain_per_volt"]) * floats(lost_v), 0.0, None)
    warms_up = (warm_up_s > 0.0) & (floats(p["warm_up_share"]) != 0.0)
    if bool(warms_up.any()):
        warm = warm_up_gain(p["warm_up_share"], xp.where(warms_up, warm_up_s, 1.0), seconds)
        command = xp.where(warms_up, command * warm, command)
    numbers = [p[name] for name in MAP_PARAMETERS]
    command = mapped(command, numbers[:MAP_KNOTS], numbers[MAP_KNOTS:], p["map_knots"])
    command = with_custom("set_point_program", command)
    return saturated(command, p["saturation_rpm"], p["softness_rpm"])


def _sane(command_rpm: FloatArray) -> FloatArray:
    xp = namespace(command_rpm)
    sane: FloatArray = xp.where(xp.abs(command_rpm) <= _ABSURD_RPM, command_rpm, 0.0)
    return sane
