"""What a drive does to a single command on the way to its setpoint, as functions of numbers.

`mecanum_env.law.drive.received_command` applies them in order.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

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
