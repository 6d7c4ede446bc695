"""Effects on the command, between the robot's latch and the drives."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Parameter, Values
from mecanum_env.units import FloatArray

if TYPE_CHECKING:
    from mecanum_env.law.drive import DriveParameters


def _delay(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, delay_s=values["delay_s"])


def _deadband(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, deadband_rpm=values["threshold_rpm"])


def _limit_speed(
    body: FloatArray,
    previous: FloatArray,
    values: Values,
    seconds: float,
) -> tuple[FloatArray, FloatArray]:
    limited = body.copy()
    speed = math.hypot(body[0], body[1])
    if speed > values["v_rpm"]:
        limited[:2] *= values["v_rpm"] / speed
    limited[2] = min(max(body[2], -values["vc_rpm"]), values["vc_rpm"])
    return limited, limited


def _limit_acceleration(
    body: FloatArray, previous: FloatArray, values: Values, seconds: float
) -> tuple[FloatArray, FloatArray]:
    change = body - previous
    end, mean = body.copy(), body.copy()
    for part, rate in ((slice(0, 2), values["v_rpm_s"]), (slice(2, 3), values["vc_rpm_s"])):
        length, most = math.hypot(*change[part]), rate * seconds
        if length > 0.0:
            share = min(1.0, most / length)
            # A straight ramp until the end is reached, as far as the limit goes.
            end[part] = previous[part] + share * change[part] if share < 1.0 else body[part]
            mean[part] = end[part] - 0.5 * share * min(1.0, length / most) * change[part]
    return end, mean


_LIMIT: Final = (1e-6, math.inf)

COMMAND_LATENCY: Final = Effect(
    name="command_latency",
    acts_on="command",
    parameters=(Parameter("delay_s", "s", 0.0, (0.0, 0.3), scan=(0.005, 0.02, 0.05, 0.1, 0.2)),),
    summary="A latched command acts later.",
    signature="Every rise and fall moves later by the same time; speeds reached stay the same. On a bench "
    "log the same as sensor_latency.",
    change_drive=_delay,
)

COMMAND_DEADBAND: Final = Effect(
    name="command_deadband",
    acts_on="command",
    parameters=(
        Parameter("threshold_rpm", "rpm", 0.0, (0.0, 40.0), scan=(2, 4, 7, 11, 16, 24, 40), stepwise=True),
    ),
    summary="Wheel commands below a threshold do nothing; those above are not changed.",
    signature="No motion for small commands, no error for large ones; a diagonal loses its slow wheels.",
    change_drive=_deadband,
)

BODY_SPEED_LIMIT: Final = Effect(
    name="body_speed_limit",
    acts_on="command, on V and VC",
    parameters=(
        Parameter("v_rpm", "rpm", math.inf, (5.0, 200.0), _LIMIT, scan=(20, 40, 60, 80, 100, 120, 150)),
        Parameter("vc_rpm", "rpm", math.inf, (5.0, 200.0), _LIMIT, scan=(20, 40, 60, 80, 100, 120, 150)),
    ),
    summary="V and VC are limited each, before the kinematics.",
    signature="All wheels stop rising together, in the ratio of the command; the direction is kept.",
    absent_from=("bench",),
    limit_body=_limit_speed,
)

BODY_ACCELERATION_LIMIT: Final = Effect(
    name="body_acceleration_limit",
    acts_on="command, on V and VC",
    parameters=(
        Parameter("v_rpm_s", "rpm/s", math.inf, (20.0, 3000.0), _LIMIT, scan=(50, 100, 200, 400, 800, 1600)),
        Parameter("vc_rpm_s", "rpm/s", math.inf, (20.0, 3000.0), _LIMIT, scan=(50, 100, 200, 400, 800, 1600)),
    ),
    summary="V (as a vector) and VC change no faster than this, before the kinematics.",
    signature="Ramps instead of steps, on all wheels together; what is reached stays the same.",
    absent_from=("bench",),
    limit_body=_limit_acceleration,
)
