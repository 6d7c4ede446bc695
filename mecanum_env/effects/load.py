"""Effects of what loads a drive, and of the gear to its wheel: stiffness, backlash, torque ripple."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import Effect, Parameter, Values
from mecanum_env.effects.drive import POSITIVE
from mecanum_env.effects.integral_action import ANSWER, WASHOUT, answering, washed_out
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.drive import DriveParameters

_PLAY: Final = "how far a wheel turns by hand while its motor is held"
_GAPS_DEG: Final = (0.5, 1, 2, 4, 8, 16, 32)
_FEW_GAPS_DEG: Final = (0.5, 2, 8, 32)
_ELASTIC_GAPS_DEG: Final = (4, 32)
_SWINGS_HZ: Final = tuple(1.4 * 2.0 ** (i / 8) for i in range(25))
"""So near each other, 9 %, that a swing between two of them is in step with one for five periods."""
_RIPPLE: Final = (
    Parameter("per_turn", "1", None, (0.5, 30.0), default=1.0, searched=False),
    Parameter("share", "1", 0.0, (0.0, 0.5), (0.0, 1.0), scan=(0.02, 0.1)),
    Parameter("torque_n_m", "N m", 0.0, (0.0, 0.6), scan=(0.01, 0.05), relative=True),
    Parameter("phase_deg", "deg", None, (-180.0, 180.0), (-math.inf, math.inf), searched=False),
)


def _coasting(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    return replace(drive, load=replace(drive.load, gap_rad=math.radians(values["gap_deg"])))


def _slowed(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    load = replace(
        drive.load,
        gap_rad=math.radians(values["gap_deg"]),
        gap_kind="light",
        gap_slowing_rad_s2=values["slowing_rpm_s"] * RAD_S_PER_RPM,
    )
    return replace(drive, load=load)


def _elastic(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    swing = 2.0 * math.pi * values["swing_hz"]
    load = replace(
        drive.load,
        gap_rad=math.radians(values["gap_deg"]),
        gap_kind="light",
        gap_swing_rad_s=swing,
        gap_damping=values["damping"],
        gap_slowing_rad_s2=swing**2 * math.radians(values["friction_deg"]),
    )
    return replace(drive, load=load)


def _ripple(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    load = replace(
        drive.load,
        ripple_n_m=values["torque_n_m"],
        ripple_share=values["share"],
        ripple_per_turn=values["per_turn"],
        ripple_phase_rad=math.radians(values["phase_deg"]),
    )
    return replace(drive, load=load)


EFFECTS: Final = (
    Effect(
        name="weak_servo",
        station="load",
        acts_on="drive",
        parameters=(
            Parameter("servo_n_m_s_rad", "N m s/rad", "robot.servo_n_m_s_rad", (0.02, 20.0), POSITIVE),
        ),
        summary="The drive holds its speed under load with this stiffness instead of the model's.",
        signature="A slower rise under load and more speed lost to friction; "
        "nothing on a free wheel by itself.",
        direct_check="how much a wheel slows down under a known torque",
        realistic=lambda model: {"servo_n_m_s_rad": 0.2 * model.robot.servo_n_m_s_rad},
        understated_by=("planar",),
        # What friction takes from a free wheel is torque over stiffness: it is told as friction there.
        unsearched_on=("bench",),
        undone_by="command",
        change_model=lambda model, values: replace(
            model, robot=replace(model.robot, servo_n_m_s_rad=values["servo_n_m_s_rad"])
        ),
    ),
    Effect(
        name="backlash",
        first_form="coast",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(Parameter("gap_deg", "deg", 0.0, (0.0, 45.0), scan=_GAPS_DEG),),
        summary="The motor turns through a gap before it drives the wheel in the other direction; "
        "meanwhile the wheel runs on.",
        signature="A dead time after each reversal of the torque; steady motion is unchanged.",
        direct_check=_PLAY,
        needs_falling_command=True,
        realistic=lambda _: {"gap_deg": 4.0},
        change_drive=_coasting,
    ),
    Effect(
        name="backlash/rest",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(
            Parameter("gap_deg", "deg", 0.0, (0.0, 45.0), scan=_FEW_GAPS_DEG),
            Parameter(
                "slowing_rpm_s",
                "rpm/s",
                None,
                (5.0, 1e5),
                (1.0, 1e7),
                default=1e5,
                scan=(30, 250, 1000, 4000, 1e5),
            ),
        ),
        summary="The motor turns through a gap at each reversal; meanwhile friction slows the wheel at this "
        "rate, and holds it at rest.",
        signature="The wheel slows down by itself and then stands still for a while, at each reversal and "
        "hard brake; it does not move at once at the first start.",
        direct_check=_PLAY,
        needs_falling_command=True,
        change_drive=_slowed,
    ),
    Effect(
        name="backlash/spring",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(
            Parameter("gap_deg", "deg", 0.0, (0.0, 45.0), scan=_ELASTIC_GAPS_DEG),
            Parameter("swing_hz", "Hz", None, (1.0, 15.0), (0.1, 50.0), default=4.0, scan=_SWINGS_HZ),
            Parameter("damping", "1", None, (0.0, 1.0), (0.0, 1.0), default=0.1),
            Parameter("friction_deg", "deg", None, (0.0, 10.0), (0.0, 45.0)),
        ),
        summary="The gap has an elastic filling, on which the wheel swings behind the motor with this "
        "frequency and damping ratio; its bearing's friction twists it so far before the wheel turns.",
        signature="The speed lags and then rings after each change of command; steady motion is unchanged.",
        direct_check=_PLAY,
        change_drive=_elastic,
    ),
    Effect(
        name="torque_ripple",
        first_form="load",
        station="load",
        acts_on="wheel joint",
        parameters=_RIPPLE,
        summary="A torque that swings with the wheel's angle: constant, or one that makes the speed swing by "
        "this share of itself (cogging, an eccentric gear).",
        signature="The speed swings a whole number of times per turn, at a frequency that grows with speed.",
        direct_check="the speed against the wheel's angle at a slow steady command",
        realistic=lambda model: {"per_turn": 6.0, "torque_n_m": 0.02 * model.robot.servo_n_m_s_rad},
        change_drive=_ripple,
    ),
    Effect(
        name="torque_ripple/washed_out",
        station="load",
        acts_on="wheel joint",
        parameters=(*_RIPPLE, ANSWER, WASHOUT),
        summary="The same torque, on a drive whose integral action works against it: slow swings vanish, and "
        "those about as fast as the drive answers may grow.",
        signature="The speed swings a whole number of times per turn, hardly at slow speeds.",
        direct_check="the speed against the wheel's angle at several steady commands",
        change_model=washed_out,
        change_drive=lambda drive, values, wheel: answering(_ripple(drive, values, wheel), values),
    ),
)
