"""Effects of drives and wheel bearings: gain, limits, supply, stiffness, backlash, friction."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from mecanum_env.effects.definition import Effect, Load, Parameter, PlantKind, Values, usual_ceiling_rpm
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.drive import DriveParameters
from mecanum_env.model import Model
from mecanum_env.model.static_map import MAP, MAP_PARAMETERS, map_parameters, map_points
from mecanum_env.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    import mujoco

_POSITIVE: Final = (1e-6, math.inf)
_ANY: Final = (-math.inf, math.inf)
_LIMITS_RPM: Final = (40, 60, 80, 100, 120, 150)
_RATES_RPM_S: Final = (100, 200, 400, 800, 1600, 3200)
_JERKS_RPM_S2: Final = (500, 1500, 5000, 15_000, 50_000)
_BRAKE: Final = Parameter("brake_rpm_s", "rpm/s", None, (0.0, 5000.0), searched=False)
"""Limit of a speed that falls in size; 0: that of one that grows."""
_WHEELS: Final = tuple(f"wheel_{wheel}" for wheel in WHEELS)
_CURRENT: Final = "the motor's current at several steady speeds and at break-away"


def _viscous(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    damping = values["damping_n_m_s_rad"]
    for joint in spec.joints:
        if joint.name in ("wheel", *_WHEELS):
            joint.damping[0] += damping
    if plant == "planar":
        # This plant has no wheel joints. The gears of its actuators are the rows of the matrix G from body
        # velocity to wheel speeds, so four dampers d dissipate like d G'G on the body, which has no cross
        # terms. The joints lie along the world's axes: forward and sideways share their mean.
        gears = [spec.actuator(name).gear for name in _WHEELS]
        rows = np.array([[gear[0], gear[1], gear[5]] for gear in gears])
        forward, sideways, yaw = damping * np.diag(rows.T @ rows)
        mean = (forward + sideways) / 2
        for name, share in (("base_x", mean), ("base_y", mean), ("base_yaw", yaw)):
            spec.joint(name).damping[0] += float(share)


def _stiction(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    speed = values["stribeck_rpm"] * RAD_S_PER_RPM
    return replace(drive, breakaway_n_m=values["breakaway_n_m"], stribeck_rad_s=speed)


def _static_map(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    knots, mapped = map_points(values)
    return replace(drive, knots_rpm=knots, values_rpm=mapped)


EFFECTS: Final = (
    Effect(
        name="speed_gain",
        station="set_point",
        acts_on="drive",
        parameters=(Parameter("gain", "1", 1.0, (0.5, 1.5), _POSITIVE),),
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
        parameters=tuple(Parameter(f"gain_{wheel}", "1", 1.0, (0.5, 1.5), _POSITIVE) for wheel in WHEELS),
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
        parameters=(Parameter("reverse_ratio", "1", 1.0, (0.5, 1.5), _POSITIVE),),
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
        name="warm_up",
        first_form="gain",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("share", "1", 0.0, (-0.5, 0.5), (-0.99, 0.99)),
            Parameter(
                "time_constant_s",
                "s",
                None,
                (1.0, 600.0),
                _POSITIVE,
                default=60.0,
                scan=(3, 10, 30, 100, 300),
            ),
        ),
        summary="As the drives warm up, their gain loses this share, most of it within the time constant; "
        "below 0 it rises.",
        signature="The same command gives less and less speed from the start of a run on, "
        "and after some time the same lower one.",
        direct_check="the speed at one command in a cold and in a warm drive",
        realistic=lambda _: {"share": 0.1, "time_constant_s": 30.0},
        undone_by="command",
        change_drive=lambda drive, values, _: replace(
            drive, warm_up_share=values["share"], warm_up_s=values["time_constant_s"]
        ),
    ),
    Effect(
        name=MAP,
        first_form="curve",
        station="set_point",
        acts_on="drive",
        parameters=tuple(Parameter(name, "rpm", 0.0, (-150.0, 150.0), _ANY) for name in MAP_PARAMETERS),
        summary="Each wheel's command follows a curve through up to 6 knots, linear in between; "
        "in a file these are the lists `knots_rpm` and `values_rpm`.",
        signature="An error that depends on the command alone, but unlike a gain, a dead band or a limit.",
        direct_check="the settled speed at many commands, both ways",
        realistic=lambda model: map_parameters(
            [share * usual_ceiling_rpm(model) for share in (0.1, 0.3, 0.8)],
            [share * usual_ceiling_rpm(model) for share in (0.04, 0.25, 0.8)],
        ),
        searched=False,
        undone_by="command",
        change_drive=_static_map,
    ),
    Effect(
        name="speed_saturation",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("limit_rpm", "rpm", "wheel.saturation_rpm", (10.0, 200.0), _POSITIVE, scan=_LIMITS_RPM),
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
        parameters=(
            Parameter("limit_rpm_s", "rpm/s", math.inf, (50.0, 5000.0), _POSITIVE, scan=_RATES_RPM_S),
            _BRAKE,
        ),
        summary="Each wheel's command changes no faster than this, "
        "or than `brake_rpm_s` while it falls in size.",
        signature="Ramps instead of steps, longer for larger steps; the speeds reached are unchanged.",
        direct_check="the setpoint in the drive's own log",
        realistic=lambda _: {"limit_rpm_s": 600.0},
        change_drive=lambda drive, values, _: replace(
            drive, acceleration_rpm_s=values["limit_rpm_s"], brake_rpm_s=values["brake_rpm_s"]
        ),
    ),
    Effect(
        name="acceleration_limit/s_curve",
        station="set_point",
        acts_on="drive",
        parameters=(
            Parameter("limit_rpm_s", "rpm/s", math.inf, (50.0, 5000.0), _POSITIVE, scan=_RATES_RPM_S),
            Parameter("jerk_rpm_s2", "rpm/s2", math.inf, (300.0, 1e5), _POSITIVE, scan=_JERKS_RPM_S2),
            _BRAKE,
        ),
        summary="Each wheel's command changes no faster than this, and its rate of change no faster than "
        "`jerk_rpm_s2`: an S-curve, which ends at the command without overshoot.",
        signature="Ramps with round beginnings and ends; the speeds reached are unchanged.",
        direct_check="the setpoint in the drive's own log",
        change_drive=lambda drive, values, _: replace(
            drive,
            acceleration_rpm_s=values["limit_rpm_s"],
            jerk_rpm_s2=values["jerk_rpm_s2"],
            brake_rpm_s=values["brake_rpm_s"],
        ),
    ),
    Effect(
        name="weak_servo",
        station="load",
        acts_on="drive",
        parameters=(
            Parameter("servo_n_m_s_rad", "N m s/rad", "robot.servo_n_m_s_rad", (0.02, 20.0), _POSITIVE),
        ),
        summary="The drive holds its speed under load with this stiffness instead of the model's.",
        signature="A slower rise under load and more speed lost to friction; "
        "nothing on a free wheel by itself.",
        direct_check="how much a wheel slows down under a known torque",
        realistic=lambda model: {"servo_n_m_s_rad": 0.2 * model.robot.servo_n_m_s_rad},
        understated_by=("planar",),
        undone_by="command",
        change_model=lambda model, values: replace(
            model, robot=replace(model.robot, servo_n_m_s_rad=values["servo_n_m_s_rad"])
        ),
    ),
    Effect(
        name="backlash",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(Parameter("gap_deg", "deg", 0.0, (0.0, 20.0), scan=(0.5, 1, 2, 4, 8, 16)),),
        summary="The motor turns through a gap before it drives the wheel in the other direction.",
        signature="A dead time after each reversal of the torque; steady motion is unchanged.",
        direct_check="how far a wheel turns by hand while its motor is held",
        realistic=lambda _: {"gap_deg": 4.0},
        change_drive=lambda drive, values, _: replace(drive, gap_rad=math.radians(values["gap_deg"])),
    ),
    Effect(
        name="coulomb_friction",
        station="load",
        acts_on="wheel joint",
        parameters=(Parameter("torque_n_m", "N m", 0.0, (0.0, 1.0)),),
        summary="A constant torque against the wheel's motion, which holds a wheel at rest.",
        signature="The same loss in rpm at every speed (torque / servo), so the relative loss falls with "
        "speed; with integral action in the drive it shows only at starts and reversals.",
        direct_check=_CURRENT,
        realistic=lambda _: {"torque_n_m": 0.3},
        depends_on_integral=True,
        undone_by="command",
        load=lambda values: Load(coulomb_n_m=values["torque_n_m"]),
        change_drive=lambda drive, values, _: replace(drive, coulomb_n_m=values["torque_n_m"]),
    ),
    Effect(
        name="stiction",
        station="load",
        acts_on="wheel joint",
        parameters=(
            Parameter("breakaway_n_m", "N m", 0.0, (0.0, 1.0), scan=(0.05, 0.1, 0.2, 0.4, 0.8)),
            Parameter("stribeck_rpm", "rpm", None, (0.5, 30.0), (1e-3, 1e6), default=5.0),
        ),
        summary="Friction near rest beyond coulomb_friction: breakaway exp(-(speed / stribeck)^2).",
        signature="Small commands do not start the wheel; large ones are reached as without it.",
        direct_check=_CURRENT,
        realistic=lambda _: {"breakaway_n_m": 0.3},
        depends_on_integral=True,
        change_drive=_stiction,
    ),
    Effect(
        name="viscous_friction",
        station="load",
        acts_on="wheel joint",
        parameters=(Parameter("damping_n_m_s_rad", "N m s/rad", 0.0, (0.0, 0.5)),),
        summary="A torque against the wheel's motion in proportion to its speed.",
        signature="The same relative loss at every speed; none with integral action in the drive.",
        direct_check=_CURRENT,
        realistic=lambda _: {"damping_n_m_s_rad": 0.05},
        depends_on_integral=True,
        undone_by="command",
        load=lambda values: Load(damping_n_m_s_rad=values["damping_n_m_s_rad"]),
        change_spec=_viscous,
    ),
)
