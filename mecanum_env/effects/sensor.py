"""Effects of the measurement: what a log shows of a motion that is not changed itself."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from mecanum_env.effects.command import TIME_STAMPS
from mecanum_env.effects.definition import ChangeChannels, Channels, Effect, Parameter, PlantKind, Values
from mecanum_env.kinematics import POSE, TWIST, WHEEL_SPEEDS
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

_SPEEDS: Final = ("speed_rpm", *WHEEL_SPEEDS)
_SCALED: Final = dict(zip(TWIST, ("linear", "linear", "yaw"), strict=True))
_SENSORS: Final[Mapping[str, tuple[str, tuple[str, ...], tuple[PlantKind, ...]]]] = {
    "wheels": ("wheel speeds", _SPEEDS, ()),
    "body": ("velocity and yaw rate", TWIST, ("bench",)),
    "pose": ("pose", POSE, ("bench",)),
}
"""Form of sensor_latency -> what is late, its channels, and the plants without them."""
_VELOCITY: Final = ("vx_m_s", "vy_m_s")
_PATH: Final = ("x_m", "y_m")
_MOUNTED: Final[Mapping[str, tuple[str, str, tuple[str, str]]]] = {
    "body": ("sensor of velocity", "measured velocity", _VELOCITY),
    "pose": ("sensor of the pose", "measured path", _PATH),
}
"""Form of mount_yaw -> which sensor is turned, what it shows, and the channels of that."""
_ANGLE: Final = Parameter("angle_deg", "deg", 0.0, (-30.0, 30.0), (-360.0, 360.0))
_ANY: Final = (-math.inf, math.inf)
_FACTOR: Final = (-10.0, 10.0)
_TIMES_S: Final = (0.005, 0.02, 0.05, 0.1, 0.2, 0.4)
_FILTER: Final = "the sensor's filter, in its settings or data sheet"
_AT_REST: Final = "the sensor while the robot stands still"
_BIASES: Final = (
    Parameter("vx_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
    Parameter("vy_m_s", "m/s", 0.0, (-0.2, 0.2), _ANY),
    Parameter("yaw_rate_rad_s", "rad/s", 0.0, (-0.5, 0.5), _ANY),
)


def _late(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Show each channel as it was; before the start it was as at the start."""
    then = time_s - values["delay_s"]
    return {name: np.interp(then, time_s, channel) for name, channel in channels.items()}


def _late_only(names: tuple[str, ...]) -> ChangeChannels:
    """Return a function that shows the named channels as `_late` does, and the others as they are."""

    def change(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
        own = {name: channel for name, channel in channels.items() if name in names}
        return {**channels, **_late(time_s, own, values)}

    return change


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


def _window(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Take the mean of the last `window_s`, exact for a channel that is linear between the clock's points."""
    if time_s.size < 2:
        return dict(channels)
    steps = values["window_s"] / (time_s[1] - time_s[0])
    whole = min(int(steps), time_s.size)
    part = min(steps - whole, 1.0)
    # Trapezia over the whole steps; the window begins within the step before them.
    weights = np.zeros(whole + 2)
    weights[:whole] += 0.5
    weights[1 : whole + 1] += 0.5
    weights[whole:] += part - 0.5 * part**2, 0.5 * part**2
    weights /= steps
    shown = {}
    for name, channel in channels.items():
        # Before the start it was as at the start.
        start = channel[0]
        shown[name] = start + np.convolve(channel - start, weights)[: channel.size]
    return shown


def _eccentric(time_s: FloatArray, channels: Channels, values: Values) -> dict[str, FloatArray]:
    """Multiply each wheel's speed by 1 + share sin(per_turn angle + phase), with the angle it has turned."""
    step, phase = np.diff(time_s), math.radians(values["phase_deg"])
    shown = dict(channels)
    for name in filter(channels.__contains__, _SPEEDS):
        speed = channels[name]
        angle = np.zeros(speed.shape)
        np.cumsum(0.5 * RAD_S_PER_RPM * (speed[1:] + speed[:-1]) * step, out=angle[1:])
        shown[name] = speed * (1.0 + values["share"] * np.sin(values["per_turn"] * angle + phase))
    return shown


def _drift(time_s: FloatArray, values: Values) -> dict[str, FloatArray]:
    """Return the bias of each velocity at the times (n,), which grows with the time since the start."""
    grown = 1.0 + values["per_s"] * time_s
    return {name: values[name] * grown for name in TWIST}


def _factor(name: str, values: Values) -> float:
    return values["wheel"] if name.startswith("speed_") else values.get(_SCALED.get(name, ""), 1.0)


def _in_turned_frame(
    channels: Channels, angle_deg: float, pairs: tuple[tuple[str, str], ...] = (_VELOCITY, _PATH)
) -> dict[str, FloatArray]:
    """Turn velocity and path, which keeps the measured pose the integral of the measured velocity.

    With one of the `pairs` of channels only that is turned.
    """
    angle = math.radians(angle_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    shown = dict(channels)
    for x, y in pairs:
        if x in channels:
            shown[x] = cos * channels[x] + sin * channels[y]
            shown[y] = cos * channels[y] - sin * channels[x]
    return shown


def _latencies() -> Iterator[Effect]:
    """Yield the forms of sensor_latency in which one kind of sensor is late and the others are not."""
    for form, (what, names, absent_from) in _SENSORS.items():
        yield Effect(
            name=f"sensor_latency/{form}",
            station="sensor",
            acts_on="sensor",
            exact=True,
            parameters=(Parameter("delay_s", "s", 0.0, (0.0, 0.5), scan=_TIMES_S),),
            summary=f"Only the channels of {what} show the values of this long ago.",
            signature=f"The channels of {what} come later than the others.",
            direct_check=TIME_STAMPS,
            absent_from=absent_from,
            shifts_time=True,
            # A bench log has no other channels, so that it is the first form there.
            unsearched_on=("bench",) if form == "wheels" else (),
            # Controllers do not observe wheel speeds.
            undone_by=None if form == "wheels" else "observation",
            change_channels=_late_only(names),
        )


def _turning(pair: tuple[str, str], sign: float) -> ChangeChannels:
    """Return a function that turns one pair of channels by the angle times a sign."""
    return lambda _, channels, values: _in_turned_frame(channels, sign * values["angle_deg"], (pair,))


def _mounts() -> Iterator[Effect]:
    """Yield the forms of mount_yaw in which one sensor is turned and the other is not."""
    for form, (sensor, shown, pair) in _MOUNTED.items():
        yield Effect(
            name=f"mount_yaw/{form}",
            station="sensor",
            acts_on="geometry",
            exact=True,
            parameters=(_ANGLE,),
            summary=f"Only the {sensor} is turned on the body by this angle, counter-clockwise positive.",
            signature=f"The {shown} of straight commands has a sideways part that other sensors do not show.",
            direct_check=f"the angle between the {sensor} and the chassis",
            absent_from=("bench",),
            undone_by="observation",
            restore_channels=_turning(pair, -1.0),
            change_channels=_turning(pair, 1.0),
        )


EFFECTS: Final = (
    Effect(
        name="mount_yaw",
        first_form="all",
        station="sensor",
        acts_on="geometry",
        exact=True,
        parameters=(_ANGLE,),
        summary="The measured frame is turned on the body by this angle, counter-clockwise positive.",
        signature="Straight commands show a sideways part in proportion to speed; rotation is unchanged.",
        direct_check="the angle between sensor and chassis",
        realistic=lambda _: {"angle_deg": 5.0},
        absent_from=("bench",),
        undone_by="observation",
        restore_channels=lambda _, channels, values: _in_turned_frame(channels, -values["angle_deg"]),
        change_channels=lambda _, channels, values: _in_turned_frame(channels, values["angle_deg"]),
    ),
    *_mounts(),
    Effect(
        name="encoder_eccentricity",
        first_form="sensor",
        station="sensor",
        acts_on="encoder",
        parameters=(
            Parameter("per_turn", "1", None, (0.5, 30.0), default=1.0, searched=False),
            Parameter("share", "1", 0.0, (0.0, 0.5), (0.0, 1.0), scan=(0.01, 0.03, 0.1)),
            Parameter("phase_deg", "deg", None, (-180.0, 180.0), _ANY, searched=False),
        ),
        summary="Measured wheel speeds swing by this share of the speed, so often in each turn of the wheel.",
        signature="A ripple whose size and frequency go with the speed; "
        "whole turns take the right time, and the body's motion does not show it.",
        direct_check="a wheel's speed with a second sensor, or the run-out of the encoder's disk",
        realistic=lambda _: {"per_turn": 1.0, "share": 0.05},
        change_channels=_eccentric,
    ),
    Effect(
        name="sensor_latency",
        first_form="all",
        station="sensor",
        acts_on="sensor",
        exact=True,
        parameters=(Parameter("delay_s", "s", 0.0, (0.0, 0.5), scan=_TIMES_S),),
        summary="All measured channels show the values of this long ago.",
        signature="Everything measured comes later by the same time; the values reached are unchanged.",
        direct_check=TIME_STAMPS,
        realistic=lambda _: {"delay_s": 0.05},
        shifts_time=True,
        undone_by="observation",
        change_channels=_late,
    ),
    *_latencies(),
    Effect(
        name="sensor_lowpass",
        first_form="lag",
        station="sensor",
        acts_on="sensor",
        parameters=(Parameter("time_constant_s", "s", 0.0, (0.0, 0.5), scan=_TIMES_S),),
        summary="All measured channels pass a first-order filter.",
        signature="Slower, rounder rises and falls without overshoot; the values reached are unchanged.",
        direct_check=_FILTER,
        realistic=lambda _: {"time_constant_s": 0.1},
        shifts_time=True,
        undone_by="observation",
        change_channels=_lowpass,
    ),
    Effect(
        name="sensor_lowpass/window",
        station="sensor",
        acts_on="sensor",
        parameters=(
            Parameter("window_s", "s", 0.0, (0.0, 1.0), scan=tuple(2.0 * time for time in _TIMES_S)),
        ),
        summary="All measured channels are means of this long until now, as an encoder's counter gives them.",
        signature="A jump becomes a straight ramp of this length, with corners; "
        "the values reached are unchanged.",
        direct_check=_FILTER,
        shifts_time=True,
        undone_by="observation",
        change_channels=_window,
    ),
    Effect(
        name="sensor_scale",
        station="sensor",
        acts_on="sensor",
        exact=True,
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
        first_form="constant",
        station="sensor",
        acts_on="sensor",
        parameters=_BIASES,
        summary="A constant is added to measured velocities.",
        signature="The same offset at all times, also at rest; the measured pose contradicts it.",
        direct_check=_AT_REST,
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
    Effect(
        name="sensor_bias/drift",
        station="sensor",
        acts_on="sensor",
        parameters=(*_BIASES, Parameter("per_s", "1/s", None, (-0.5, 0.5), _ANY)),
        summary="What is added to measured velocities grows: these values times 1 + per_s times the time.",
        signature="An offset, also at rest, that changes steadily from the start of each run.",
        direct_check=_AT_REST,
        absent_from=("bench",),
        undone_by="observation",
        restore_channels=lambda time_s, channels, values: {
            **channels,
            **{n: channels[n] - bias for n, bias in _drift(time_s, values).items() if n in channels},
        },
        change_channels=lambda time_s, channels, values: {
            **channels,
            **{n: channels[n] + bias for n, bias in _drift(time_s, values).items() if n in channels},
        },
    ),
)
