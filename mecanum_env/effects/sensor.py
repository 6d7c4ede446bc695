"""Effects of the measurement: what a log shows of a motion that is not changed itself."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mecanum_env.effects.command import TIME_STAMPS
from mecanum_env.effects.definition import Channels, Effect, Parameter, Values
from mecanum_env.units import FloatArray

_SCALED: Final = {"vx_m_s": "linear", "vy_m_s": "linear", "yaw_rate_rad_s": "yaw"}
_ANY: Final = (-math.inf, math.inf)
_FACTOR: Final = (-10.0, 10.0)
_TIMES_S: Final = (0.005, 0.02, 0.05, 0.1, 0.2)


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
    # Weights of the previous and the present sample in the exact response to a straight line.
    before = -math.expm1(-ratio) / ratio - pole
    now = 1.0 - pole - before
    filtered = {}
    for name, channel in channels.items():
        start = channel[0]
        # The filter starts settled at the first sample.
        y, _ = lfilter([now, before], [1.0, -pole], channel - start, zi=[0.0])
        filtered[name] = y + start
    return filtered


def _factor(name: str, values: Values) -> float:
    return values["wheel"] if name.startswith("speed_") else values.get(_SCALED.get(name, ""), 1.0)


def _in_turned_frame(channels: Channels, angle_deg: float) -> dict[str, FloatArray]:
    """Turn velocity and path, which keeps the measured pose the integral of the measured velocity."""
    angle = math.radians(angle_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    shown = dict(channels)
    for x, y in (("vx_m_s", "vy_m_s"), ("x_m", "y_m")):
        if x in channels:
            shown[x] = cos * channels[x] + sin * channels[y]
            shown[y] = cos * channels[y] - sin * channels[x]
    return shown


EFFECTS: Final = (
    Effect(
        name="mount_yaw",
        station="sensor",
        acts_on="geometry",
        parameters=(Parameter("angle_deg", "deg", 0.0, (-30.0, 30.0), (-360.0, 360.0)),),
        summary="The measured frame is turned on the body by this angle, counter-clockwise positive.",
        signature="Straight commands show a sideways part in proportion to speed; rotation is unchanged.",
        direct_check="the angle between sensor and chassis",
        realistic=lambda _: {"angle_deg": 5.0},
        absent_from=("bench",),
        undone_by="observation",
        restore_channels=lambda _, channels, values: _in_turned_frame(channels, -values["angle_deg"]),
        change_channels=lambda _, channels, values: _in_turned_frame(channels, values["angle_deg"]),
    ),
    Effect(
        name="sensor_latency",
        station="sensor",
        acts_on="sensor",
        parameters=(Parameter("delay_s", "s", 0.0, (0.0, 0.3), scan=_TIMES_S),),
        summary="All measured channels show the values of this long ago.",
        signature="Everything measured comes later by the same time; the values reached are unchanged.",
        direct_check=TIME_STAMPS,
        realistic=lambda _: {"delay_s": 0.05},
        shifts_time=True,
        undone_by="observation",
        change_channels=_late,
    ),
    Effect(
        name="sensor_lowpass",
        station="sensor",
        acts_on="sensor",
        parameters=(Parameter("time_constant_s", "s", 0.0, (0.0, 0.3), scan=_TIMES_S),),
        summary="All measured channels pass a first-order filter.",
        signature="Slower, rounder rises and falls without overshoot; the values reached are unchanged.",
        direct_check="the sensor's filter, in its settings or data sheet",
        realistic=lambda _: {"time_constant_s": 0.1},
        shifts_time=True,
        undone_by="observation",
        change_channels=_lowpass,
    ),
    Effect(
        name="sensor_scale",
        station="sensor",
        acts_on="sensor",
        parameters=tuple(
            Parameter(name, "1", 1.0, (0.5, 1.5), _FACTOR) for name in ("wheel", "linear", "yaw")
        ),
        summary="Measured wheel speeds, velocity (vx, vy) and yaw rate are multiples of the true ones.",
        signature="One kind of channel is off in proportion, the others are not; the pose is not scaled.",
        direct_check="the sensor against another: a tachometer, a tape, full turns by hand",
        realistic=lambda _: {"linear": 0.9, "yaw": 0.9},
        undone_by="observation",
        # A scale of 0 leaves nothing to restore.
        restore_channels=lambda _, channels, values: {
            name: channel / (_factor(name, values) or 1.0) for name, channel in channels.items()
        },
        change_channels=lambda _, channels, values: {
            name: channel * _factor(name, values) for name, channel in channels.items()
        },
    ),
    Effect(
        name="sensor_bias",
        station="sensor",
        acts_on="sensor",
        parameters=(
            Parameter("vx_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
            Parameter("vy_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
            Parameter("yaw_rate_rad_s", "rad/s", 0.0, (-0.5, 0.5), _ANY),
        ),
        summary="A constant is added to measured velocities.",
        signature="The same offset at all times, also at rest; the measured pose contradicts it.",
        direct_check="the sensor while the robot stands still",
        realistic=lambda _: {"vx_m_s": 0.05, "vy_m_s": 0.05, "yaw_rate_rad_s": 0.1},
        absent_from=("bench",),
        undone_by="observation",
        restore_channels=lambda _, channels, values: {
            name: channel - values.get(name, 0.0) for name, channel in channels.items()
        },
        change_channels=lambda _, channels, values: {
            name: channel + values.get(name, 0.0) for name, channel in channels.items()
        },
    ),
)
