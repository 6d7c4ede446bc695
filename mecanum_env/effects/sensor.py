"""Effects of the measurement: what a log shows of a motion that is not changed itself."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mecanum_env.effects.definition import Channels, Effect, Parameter, Values
from mecanum_env.units import FloatArray


def _late(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Show each channel as it was; before the start it was as at the start."""
    then = time_s - values["delay_s"]
    return {name: np.interp(then, time_s, channel) for name, channel in channels.items()}


def _lowpass(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Filter by T y' + y = x, exact for a channel that is linear between the clock's points."""
    # Imported here, since it takes half a second and the catalogue is read to print every program's help.
    from scipy.signal import lfilter

    if time_s.size < 2:
        return dict(channels)
    ratio = (time_s[1] - time_s[0]) / values["time_constant_s"]
    pole = math.exp(-ratio)
    # Weights of the sample before and the one now in the exact response to a straight line.
    before = -math.expm1(-ratio) / ratio - pole
    now = 1.0 - pole - before
    filtered = {}
    for name, channel in channels.items():
        start = channel[0]
        # The filter starts settled at the first sample: its state is what makes the first output equal it.
        y, _ = lfilter([now, before], [1.0, -pole], channel - start, zi=[0.0])
        filtered[name] = y + start
    return filtered


_SCALED: Final = {"vx_m_s": "linear", "vy_m_s": "linear", "yaw_rate_rad_s": "yaw"}


def _scale(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    def factor(name: str) -> float:
        return values["wheel"] if name.startswith("speed_") else values.get(_SCALED.get(name, ""), 1.0)

    return {name: channel * factor(name) for name, channel in channels.items()}


def _bias(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    return {name: channel + values.get(name, 0.0) for name, channel in channels.items()}


_ANY: Final = (-math.inf, math.inf)
_FACTOR: Final = (-10.0, 10.0)

SENSOR_LATENCY: Final = Effect(
    name="sensor_latency",
    acts_on="sensor",
    parameters=(Parameter("delay_s", "s", 0.0, (0.0, 0.3), scan=(0.005, 0.02, 0.05, 0.1, 0.2)),),
    summary="All measured channels show what was this long ago.",
    signature="Everything measured moves later by the same time; values reached stay the same.",
    change_channels=_late,
)

SENSOR_LOWPASS: Final = Effect(
    name="sensor_lowpass",
    acts_on="sensor",
    parameters=(Parameter("time_constant_s", "s", 0.0, (0.0, 0.3), scan=(0.005, 0.02, 0.05, 0.1, 0.2)),),
    summary="All measured channels pass a filter of first order.",
    signature="Slower, rounder rises and falls without overshoot; values reached stay the same.",
    change_channels=_lowpass,
)

SENSOR_SCALE: Final = Effect(
    name="sensor_scale",
    acts_on="sensor",
    parameters=tuple(Parameter(name, "1", 1.0, (0.5, 1.5), _FACTOR) for name in ("wheel", "linear", "yaw")),
    summary="Measured wheel speeds, velocity (vx, vy) and yaw rate are multiples of the true ones.",
    signature="One kind of channel is off in proportion, the others are not; the pose is not scaled.",
    change_channels=_scale,
)

SENSOR_BIAS: Final = Effect(
    name="sensor_bias",
    acts_on="sensor",
    parameters=(
        Parameter("vx_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
        Parameter("vy_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
        Parameter("yaw_rate_rad_s", "rad/s", 0.0, (-0.5, 0.5), _ANY),
    ),
    summary="A constant is added to measured velocities.",
    signature="The same offset at all times, standing still included; the measured pose contradicts it.",
    absent_from=("bench",),
    change_channels=_bias,
)
