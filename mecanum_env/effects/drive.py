"""Effects on the setpoint of each wheel: gains, supply, limits."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import Effect, Parameter, usual_ceiling_rpm
from mecanum_env.kinematics import WHEELS

POSITIVE: Final = (1e-6, math.inf)
LIMITS_RPM: Final = (40, 60, 80, 100, 120, 150)
RATES_RPM_S: Final = (100, 200, 400, 800, 1600, 3200)

EFFECTS: Final = (
    Effect(
        name="speed_gain",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5), POSITIVE),),
        summary="Every wheel command is multiplied by this.",
        signature="A loss or surplus in proportion to speed, alike in every direction, also in wheel speeds.",
        direct_check="a wheel's true speed, with a tachometer or by counting its turns",
        realistic=lambda _: {"gain": 0.9},
        bench_twins=("sensor_scale",),
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, gain=drive.gain * values["gain"]),
    ),
    Effect(
        name="wheel_gain_mismatch",
        station="set_point",
        acts_on="drive",
        parameters=tuple(Parameter(f"gain_{wheel}", "1", 1.0, (0.5, 1.5), POSITIVE) for wheel in WHEELS),
        summary="Each wheel's command is multiplied by its own factor.",
        signature="One wheel's speed is off in proportion; the robot's path bends.",
        direct_check="each wheel's true speed, with a tachometer",
        realistic=lambda _: {"gain_fl": 0.92, "gain_rr": 1.05},
        undone_by="command",
        change_drive=lambda drive, values, wheel: (
            drive if wheel is None else replace(drive, gain=drive.gain * values[f"gain_{wheel}"])
        ),
    ),
    Effect(
        name="direction_asymmetry",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("reverse_ratio", "1", 1.0, (0.5, 1.5), POSITIVE),),
        summary="Negative wheel commands are multiplied by this.",
        signature="An error in proportion to speed in reverse only; turning on the spot drifts.",
        direct_check="a wheel's true speed both ways, with a tachometer",
        realistic=lambda _: {"reverse_ratio": 0.9},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, reverse_ratio=values["reverse_ratio"]),
    ),
    Effect(
        name="battery_sag",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("drop_per_s", "1/s", 0.0, (0.0, 0.05)),
            Parameter("per_volt", "1/V", 0.0, (0.0, 0.5), simulated=False),
        ),
        summary="The drives' gain falls with time, or with the voltage if `battery_v` is logged.",
        signature="The same command gives less and less speed during a run.",
        direct_check="the battery's voltage, logged as battery_v",
        realistic=lambda _: {"drop_per_s": 0.01},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(drive, drop_per_s=values["drop_per_s"]),
    ),
    Effect(
        name="speed_saturation",
        first_form="clip",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("limit_rpm", "rpm", "wheel.saturation_rpm", (10.0, 200.0), POSITIVE, scan=LIMITS_RPM),
            Parameter("softness_rpm", "rpm", 0.0, (0.0, 60.0)),
        ),
        summary="Each wheel's command is clipped; a soft knee begins this far below the limit.",
        signature="An error at high speed only, wheel by wheel, so that the direction of motion changes.",
        direct_check="the motor's voltage at full speed",
        realistic=lambda model: {"limit_rpm": 0.8 * usual_ceiling_rpm(model), "softness_rpm": 20.0},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive, saturation_rpm=values["limit_rpm"], softness_rpm=values["softness_rpm"]
        ),
    ),
    Effect(
        name="acceleration_limit",
        first_form="set_point",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("limit_rpm_s", "rpm/s", math.inf, (50.0, 5000.0), POSITIVE, scan=RATES_RPM_S),),
        summary="Each wheel's command changes no faster than this.",
        signature="Ramps instead of steps, longer for larger steps; the speeds reached are unchanged.",
        direct_check="the setpoint in the drive's own log",
        realistic=lambda _: {"limit_rpm_s": 600.0},
        change_drive=lambda drive, values, _: replace(drive, acceleration_rpm_s=values["limit_rpm_s"]),
    ),
)
