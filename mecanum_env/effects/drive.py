"""Effects of the motor drives: gain, limits, supply, stiffness."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Parameter, Values
from mecanum_env.kinematics import WHEELS

if TYPE_CHECKING:
    from mecanum_env.law.drive import DriveParameters
    from mecanum_env.model import Model


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


_POSITIVE: Final = (1e-6, math.inf)

SPEED_GAIN: Final = Effect(
    name="speed_gain",
    acts_on="drive",
    parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5), _POSITIVE),),
    summary="All wheels are told this multiple of their command.",
    signature="Loss or surplus in proportion to speed, the same in every direction, on wheel speeds too.",
    change_drive=_gain,
)

WHEEL_GAIN_MISMATCH: Final = Effect(
    name="wheel_gain_mismatch",
    acts_on="drive",
    parameters=tuple(Parameter(f"gain_{wheel}", "1", 1.0, (0.5, 1.5), _POSITIVE) for wheel in WHEELS),
    summary="Each wheel is told its own multiple of its command.",
    signature="One wheel's speed is off in proportion; the robot's path bends.",
    change_drive=_mismatch,
)

DIRECTION_ASYMMETRY: Final = Effect(
    name="direction_asymmetry",
    acts_on="drive",
    parameters=(Parameter("reverse_ratio", "1", 1.0, (0.5, 1.5), _POSITIVE),),
    summary="Commands to turn backwards are multiplied by this.",
    signature="Error in proportion to speed in reverse only; turning on the spot drifts.",
    change_drive=_reverse,
)

BATTERY_SAG: Final = Effect(
    name="battery_sag",
    acts_on="drive",
    parameters=(
        Parameter("drop_per_s", "1/s", 0.0, (0.0, 0.05)),
        Parameter("per_volt", "1/V", 0.0, (0.0, 0.5), simulated=False),
    ),
    summary="The drives' gain falls with time, or with the voltage where `battery_v` is logged.",
    signature="The same command gives less and less speed in the course of a run.",
    change_drive=_sag,
)

SPEED_SATURATION: Final = Effect(
    name="speed_saturation",
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
    change_drive=_saturation,
)

ACCELERATION_LIMIT: Final = Effect(
    name="acceleration_limit",
    acts_on="drive",
    parameters=(
        Parameter(
            "limit_rpm_s", "rpm/s", math.inf, (50.0, 5000.0), _POSITIVE, scan=(100, 200, 400, 800, 1600, 3200)
        ),
    ),
    summary="Each wheel's command changes no faster than this.",
    signature="Ramps instead of steps, longer for larger steps; what is reached stays the same.",
    change_drive=_acceleration,
)

WEAK_SERVO: Final = Effect(
    name="weak_servo",
    acts_on="drive",
    parameters=(Parameter("servo_n_m_s_rad", "N m s/rad", "robot.servo_n_m_s_rad", (0.02, 20.0), _POSITIVE),),
    summary="The drive holds its speed against load with this stiffness instead of the model's.",
    signature="Slower rise under load and more speed lost to friction; nothing on a free wheel by itself.",
    change_model=_servo,
)
