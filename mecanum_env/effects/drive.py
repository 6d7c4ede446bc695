"""Effects of the motor drives: gain, limits, supply, stiffness."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import Effect, Parameter, Values, usual_ceiling_rpm
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.drive import DriveParameters
from mecanum_env.model import Model

_POSITIVE: Final = (1e-6, math.inf)


def _servo(model: Model, values: Values) -> Model:
    return replace(model, robot=replace(model.robot, servo_n_m_s_rad=values["servo_n_m_s_rad"]))


def _gain(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, gain=drive.gain * values["gain"])


def _mismatch(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return drive if wheel is None else replace(drive, gain=drive.gain * values[f"gain_{wheel}"])


def _reverse(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, reverse_ratio=values["reverse_ratio"])


def _sag(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, drop_per_s=values["drop_per_s"])


def _saturation(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, saturation_rpm=values["limit_rpm"], softness_rpm=values["softness_rpm"])


def _acceleration(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, acceleration_rpm_s=values["limit_rpm_s"])


EFFECTS: Final = (
    Effect(
        name="speed_gain",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5), _POSITIVE),),
        summary="All wheels are told this multiple of their command.",
        signature="Loss or surplus in proportion to speed, the same in every direction, on wheel speeds too.",
        direct_check="a wheel's true speed, with a tachometer or by counting its turns",
        realistic=lambda _: {"gain": 0.9},
        bench_twins=("sensor_scale",),
        undone_by="command",
        change_drive=_gain,
    ),
    Effect(
        name="wheel_gain_mismatch",
        station="set_point",
        acts_on="drive",
        parameters=tuple(Parameter(f"gain_{wheel}", "1", 1.0, (0.5, 1.5), _POSITIVE) for wheel in WHEELS),
        summary="Each wheel is told its own multiple of its command.",
        signature="One wheel's speed is off in proportion; the robot's path bends.",
        direct_check="each wheel's true speed, with a tachometer",
        realistic=lambda _: {"gain_fl": 0.92, "gain_rr": 1.05},
        undone_by="command",
        change_drive=_mismatch,
    ),
    Effect(
        name="direction_asymmetry",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("reverse_ratio", "1", 1.0, (0.5, 1.5), _POSITIVE),),
        summary="Commands to turn backwards are multiplied by this.",
        signature="Error in proportion to speed in reverse only; turning on the spot drifts.",
        direct_check="a wheel's true speed both ways, with a tachometer",
        realistic=lambda _: {"reverse_ratio": 0.9},
        undone_by="command",
        change_drive=_reverse,
    ),
    Effect(
        name="battery_sag",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("drop_per_s", "1/s", 0.0, (0.0, 0.05)),
            Parameter("per_volt", "1/V", 0.0, (0.0, 0.5), simulated=False),
        ),
        summary="The drives' gain falls with time, or with the voltage where `battery_v` is logged.",
        signature="The same command gives less and less speed in the course of a run.",
        direct_check="the battery's voltage, logged as battery_v",
        realistic=lambda _: {"drop_per_s": 0.01},
        undone_by="command",
        change_drive=_sag,
    ),
    Effect(
        name="speed_saturation",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter(
                "limit_rpm",
                "rpm",
                "wheel.saturation_rpm",
                (10.0, 200.0),
                _POSITIVE,
                scan=(40, 60, 80, 100, 120, 150),
            ),
            Parameter("softness_rpm", "rpm", 0.0, (0.0, 60.0)),
        ),
        summary="Each wheel's command ends at a limit; with softness it bends towards it that far below.",
        signature="Error at high speed only, wheel by wheel: the direction of motion bends.",
        direct_check="the motor's voltage at full speed",
        realistic=lambda model: {"limit_rpm": 0.8 * usual_ceiling_rpm(model), "softness_rpm": 20.0},
        undone_by="command",
        change_drive=_saturation,
    ),
    Effect(
        name="acceleration_limit",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter(
                "limit_rpm_s",
                "rpm/s",
                math.inf,
                (50.0, 5000.0),
                _POSITIVE,
                scan=(100, 200, 400, 800, 1600, 3200),
            ),
        ),
        summary="Each wheel's command changes no faster than this.",
        signature="Ramps instead of steps, longer for larger steps; what is reached stays the same.",
        direct_check="the setpoint in the drive's own log",
        realistic=lambda _: {"limit_rpm_s": 600.0},
        change_drive=_acceleration,
    ),
    Effect(
        name="weak_servo",
        station="load",
        acts_on="drive",
        parameters=(
            Parameter("servo_n_m_s_rad", "N m s/rad", "robot.servo_n_m_s_rad", (0.02, 20.0), _POSITIVE),
        ),
        summary="The drive holds its speed against load with this stiffness instead of the model's.",
        signature="Slower rise under load and more speed lost to friction; "
        "nothing on a free wheel by itself.",
        direct_check="how much a wheel slows down under a known torque",
        realistic=lambda model: {"servo_n_m_s_rad": 0.2 * model.robot.servo_n_m_s_rad},
        understated_by=("planar",),
        undone_by="command",
        change_model=_servo,
    ),
)
