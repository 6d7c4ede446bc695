"""Effects of what loads a drive, and of the gear to its wheel: stiffness, backlash, torque ripple."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from mecanum_env.effects.definition import ChangeDrive, Effect, Parameter, Values
from mecanum_env.effects.drive import POSITIVE
from mecanum_env.wheel_drive.drive import DriveParameters

_PLAY: Final = "how far a wheel turns by hand while its motor is held"
_GAPS_DEG: Final = (0.5, 1, 2, 4, 8, 16, 32)


def _backlash(kind: str) -> ChangeDrive:
    def change(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
        gap = math.radians(values["gap_deg"])
        return replace(drive, load=replace(drive.load, gap_rad=gap, gap_kind=kind))

    return change


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
        realistic=lambda _: {"gap_deg": 4.0},
        change_drive=_backlash("coast"),
    ),
    Effect(
        name="backlash/rest",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(Parameter("gap_deg", "deg", 0.0, (0.0, 45.0), scan=_GAPS_DEG),),
        summary="The motor turns through a gap at each reversal; friction holds the wheel at rest meanwhile.",
        signature="The wheel stands still for a while at each reversal and at the first start.",
        direct_check=_PLAY,
        change_drive=_backlash("rest"),
    ),
    Effect(
        name="backlash/spring",
        station="transmission",
        acts_on="between motor and wheel",
        parameters=(Parameter("gap_deg", "deg", 0.0, (0.0, 45.0), scan=_GAPS_DEG),),
        summary="The gap has an elastic filling: the drive's hold on the wheel grows from nothing in its "
        "middle to all of it at the ends.",
        signature="A soft start after each reversal of the torque; steady motion is unchanged.",
        direct_check=_PLAY,
        change_drive=_backlash("spring"),
    ),
    Effect(
        name="torque_ripple",
        first_form="load",
        station="load",
        acts_on="wheel joint",
        parameters=(
            Parameter("per_turn", "1", None, (0.5, 30.0), default=1.0, searched=False),
            Parameter("share", "1", 0.0, (0.0, 0.5), (0.0, 1.0), scan=(0.02, 0.1)),
            Parameter("torque_n_m", "N m", 0.0, (0.0, 0.6), scan=(0.01, 0.05), relative=True),
            Parameter("phase_deg", "deg", None, (-180.0, 180.0), (-math.inf, math.inf), searched=False),
        ),
        summary="A torque that swings with the wheel's angle: constant, or one that makes the speed swing by "
        "this share of itself (cogging, an eccentric gear).",
        signature="The speed swings a whole number of times per turn, at a frequency that grows with speed.",
        direct_check="the speed against the wheel's angle at a slow steady command",
        realistic=lambda model: {"per_turn": 6.0, "torque_n_m": 0.02 * model.robot.servo_n_m_s_rad},
        change_drive=_ripple,
    ),
)
