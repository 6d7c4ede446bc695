"""Effects of the motor: how its torque, its supply and the inertia at the wheel change what the law does."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.effects.definition import Effect, Parameter, Values
from mecanum_env.effects.drive import BRAKE, LIMIT, LIMITS_RPM, PER_VOLT, POSITIVE
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.motor_bounds import loaded_law

WINDUP: Final = Parameter("windup", "1", None, (0.0, 1.0), (0.0, 1.0), scan=(0.0, 1.0))
"""Share of what the law asks beyond its motor's bounds that it asks for again, where the model's own
`wheel.windup` is less: nothing says that before a bound acts."""
_RATIO: Final = (Parameter("ratio", "1", 1.0, (1.0, 40.0), (1e-3, 1e3)),)
_WHAT_IT_CARRIES: Final = (
    "what the wheel carries: whether the robot stood on it, or which parts were mounted; if that has not "
    "changed, the gains of the drive's controller"
)


def _heavier(drive: DriveParameters, values: Values, *, integral: bool) -> DriveParameters:
    """Return a drive with more inertia at its wheel, whose speed all torques, limited or not, change less."""
    ratio = values["ratio"]
    return replace(
        drive,
        law=loaded_law(drive.law, ratio, integral=integral),
        drive_acceleration_rpm_s=drive.drive_acceleration_rpm_s / ratio,
        drive_brake_rpm_s=drive.drive_brake_rpm_s / ratio,
        supply_s=drive.supply_s * ratio,
    )


EFFECTS: Final = (
    Effect(
        name="speed_saturation/supply",
        station="law",
        acts_on="drive",
        parameters=(
            Parameter("limit_rpm", "rpm", math.inf, (10.0, 200.0), POSITIVE, scan=LIMITS_RPM),
            Parameter("motor_s", "s", None, (0.0, 0.5), searched=False),
            Parameter("per_volt", "1/V", None, PER_VOLT, searched=False),
            WINDUP,
        ),
        summary="The motor is at full voltage: its torque falls with speed, to nothing at this limit, "
        "which it approaches with the time constant `motor_s` (0: as fast as the law ever moves), and which "
        "loses the share `per_volt` with each volt of `battery_v` below its first sample. The integral of a "
        "controller without anti-windup goes on meanwhile (`windup` 1).",
        signature="An error at high speed only, which grows with the load; the end of the rise is slower.",
        direct_check="the motor's voltage at full speed, with and without load",
        understated_by=("planar",),
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive,
            supply_rpm=values["limit_rpm"],
            supply_s=values["motor_s"],
            supply_per_volt=values["per_volt"],
            windup=np.maximum(drive.windup, values["windup"]),
        ),
    ),
    Effect(
        name="acceleration_limit/drive",
        station="law",
        acts_on="drive",
        parameters=(
            LIMIT,
            BRAKE,
            WINDUP,
        ),
        summary="The motor's torque or current is limited, and so the wheel's own acceleration; braking has "
        "the same limit, or one of its own. The integral of a controller without anti-windup goes on "
        "meanwhile (`windup` 1).",
        signature="Straight rises that end where the setpoint is met; small steps and the speeds reached are "
        "unchanged.",
        direct_check="the motor's current during a large step",
        change_drive=lambda drive, values, _: replace(
            drive,
            drive_acceleration_rpm_s=values["limit_rpm_s"],
            drive_brake_rpm_s=values["brake_rpm_s"],
            windup=np.maximum(drive.windup, values["windup"]),
        ),
    ),
    Effect(
        name="load_inertia",
        station="law",
        acts_on="drive",
        parameters=_RATIO,
        summary="The moment of inertia at the wheel, over that of the wheel whose law was identified, on a "
        "drive that answers the difference of command and speed.",
        signature="Slower starts and stops, which may overshoot; the speeds reached are unchanged.",
        direct_check=_WHAT_IT_CARRIES,
        realistic=lambda _: {"ratio": 2.0},
        change_drive=lambda drive, values, _: _heavier(drive, values, integral=False),
    ),
    Effect(
        name="load_inertia/integral",
        station="law",
        acts_on="drive",
        parameters=_RATIO,
        summary="The same, on a drive with integral action that answers command and speed separately.",
        signature="Slower starts and stops, which may overshoot; the speeds reached are unchanged.",
        direct_check=_WHAT_IT_CARRIES,
        realistic=lambda _: {"ratio": 2.0},
        change_drive=lambda drive, values, _: _heavier(drive, values, integral=True),
    ),
)
