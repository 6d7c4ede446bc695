"""What a drive does to a command that it has latched: rounding, dead band, gains and ceiling."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.program import evaluate_sets
from mecanum_env.units import FloatArray

_ABSURD_RPM: Final = 1e10
"""Commands beyond this [rpm], and NaN, count as 0, as they do for MuJoCo's own actuators."""


def shaped(
    p: Mapping[str, npt.ArrayLike],
    command_rpm: npt.ArrayLike,
    seconds: npt.ArrayLike,
    speed_rpm: npt.ArrayLike = 0.0,
    angle_rad: npt.ArrayLike = 0.0,
) -> FloatArray:
    """Return latched commands [rpm] as the drive takes them; NaN counts as 0.

    All shapes broadcast. The parameters `p` are those of `mecanum_env.law.parameters` by name, and `seconds`
    is the time since the start at which a command takes effect [s]. `speed_rpm` and `angle_rad` are those of
    the wheel when the command is latched, which custom effects may use.
    """

    def with_custom(name: str, command: FloatArray) -> FloatArray:
        if not np.any(p[name]):
            return command
        given = {"command": command, "speed": speed_rpm, "angle": angle_rad, "time": seconds}
        return _sane(command + evaluate_sets(p[name], given))

    quantum, gain, ratio, drop = (
        np.asarray(p[name], float) for name in ("command_quantum_rpm", "gain", "reverse_ratio", "drop_per_s")
    )
    command = _sane(np.asarray(command_rpm, float))
    step = np.where(quantum > 0.0, quantum, 1.0)
    command = np.where(quantum > 0.0, np.rint(command / step) * step, command)
    command = with_custom("command_program", command)
    command = np.where(np.abs(command) < p["deadband_rpm"], 0.0, command)
    command = command * np.where(gain > 0.0, gain, 1.0)
    command = np.where((ratio > 0.0) & (command < 0.0), command * ratio, command)
    command = command * np.maximum(0.0, 1.0 - drop * np.asarray(seconds, float))
    command = with_custom("set_point_program", command)
    return saturated(command, p["saturation_rpm"], p["softness_rpm"])


def _sane(command_rpm: FloatArray) -> FloatArray:
    return np.where(np.abs(command_rpm) <= _ABSURD_RPM, command_rpm, 0.0)


def saturated(command_rpm: FloatArray, limit_rpm: npt.ArrayLike, softness_rpm: npt.ArrayLike) -> FloatArray:
    """Limit commands to +-limit [rpm], along a parabola from `softness_rpm` below it to as much above it.

    All shapes broadcast. A limit of 0 or infinity is none.
    """
    limit = np.where(np.asarray(limit_rpm) > 0.0, limit_rpm, np.inf)
    knee = np.where(np.isfinite(limit), np.minimum(softness_rpm, limit), 0.0)
    corner = np.where(np.isfinite(limit), limit - knee, 0.0)
    width = np.where(knee > 0.0, knee, 1.0)
    beyond = np.abs(command_rpm) - corner
    on_knee = np.clip(beyond, 0.0, 2.0 * width)  # further out the square may overflow
    # The parabola leaves the line with slope 1 and reaches the limit with slope 0.
    bent = np.copysign(corner + beyond - on_knee * on_knee / (4.0 * width), command_rpm)
    command = np.where((knee > 0.0) & (beyond > 0.0) & (beyond < 2.0 * knee), bent, command_rpm)
    return np.asarray(np.minimum(np.maximum(command, -limit), limit))
