"""What a drive does to a command that it has latched: rounding, dead bands, gains, static map and ceiling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.program import evaluate_sets
from mecanum_env.law.set_point import MAP_KNOTS, MAP_PARAMETERS, mapped, saturated, warm_up_gain
from mecanum_env.units import FloatArray

_ABSURD_RPM: Final = 1e10
"""Commands beyond this [rpm], and NaN, count as 0, as they do for MuJoCo's own actuators."""


def rounded(command_rpm: npt.ArrayLike, quantum_rpm: npt.ArrayLike) -> FloatArray:
    """Return commands rounded to a quantum [rpm], halves to even; 0: not rounded. NaN counts as 0."""
    command, quantum = np.asarray(command_rpm, float), np.asarray(quantum_rpm, float)
    command = _sane(command)
    step = np.where(quantum > 0.0, quantum, 1.0)
    return np.where(quantum > 0.0, np.rint(command / step) * step, command)


def shaped(
    p: Mapping[str, Any],
    command_rpm: npt.ArrayLike,
    seconds: npt.ArrayLike,
    speed_rpm: npt.ArrayLike = 0.0,
    angle_rad: npt.ArrayLike = 0.0,
    lost_v: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return rounded commands [rpm] as the drive takes them.

    All shapes broadcast. The parameters `p` are those of `mecanum_env.law.parameters` by name, and `seconds`
    is the time since the start at which a command takes effect [s]. `speed_rpm` and `angle_rad` are those of
    the wheel when the command is latched, which custom effects may use, and `lost_v` [V] is how far the
    supply is then below its voltage at the start.
    """

    def with_custom(name: str, command: FloatArray) -> FloatArray:
        if not np.any(p[name]):
            return command
        given = {"command": command, "speed": speed_rpm, "angle": angle_rad, "time": seconds}
        given["voltage"] = lost_v
        return _sane(command + evaluate_sets(p[name], given))

    gain, ratio, drop, lost, warm_up_s = (
        np.asarray(p[name], float)
        for name in ("gain", "reverse_ratio", "drop_per_s", "subtracted_rpm", "warm_up_s")
    )
    command = np.asarray(command_rpm, float)
    command = with_custom("command_program", command)
    command = np.where(np.abs(command) < p["deadband_rpm"], 0.0, command)
    if np.any(lost > 0.0):
        beyond = np.where(np.abs(command) > lost, command - np.copysign(lost, command), 0.0)
        command = np.where(lost > 0.0, beyond, command)
    command = command * np.where(gain > 0.0, gain, 1.0)
    command = np.where((ratio > 0.0) & (command < 0.0), command * ratio, command)
    command = command * np.maximum(0.0, 1.0 - drop * np.asarray(seconds, float))
    command = command * np.maximum(0.0, 1.0 - p["gain_per_volt"] * np.asarray(lost_v, float))
    warms_up = (warm_up_s > 0.0) & (np.asarray(p["warm_up_share"]) != 0.0)
    if np.any(warms_up):
        warm = warm_up_gain(p["warm_up_share"], np.where(warms_up, warm_up_s, 1.0), seconds)
        command = np.where(warms_up, command * warm, command)
    numbers = [p[name] for name in MAP_PARAMETERS]
    command = mapped(command, numbers[:MAP_KNOTS], numbers[MAP_KNOTS:], p["map_knots"])
    command = with_custom("set_point_program", command)
    return saturated(command, p["saturation_rpm"], p["softness_rpm"])


def _sane(command_rpm: FloatArray) -> FloatArray:
    return np.where(np.abs(command_rpm) <= _ABSURD_RPM, command_rpm, 0.0)
