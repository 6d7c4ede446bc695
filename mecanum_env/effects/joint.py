"""Effects between motor and wheel, and in the wheel's bearing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Parameter, PlantKind, Values
from mecanum_env.kinematics import WHEELS
from mecanum_env.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    import mujoco

    from mecanum_env.law.drive import DriveParameters
    from mecanum_env.model import Model

_WHEEL_JOINTS: Final = ("wheel", *(f"wheel_{wheel}" for wheel in WHEELS))


def _coulomb(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, coulomb_n_m=values["torque_n_m"])


def _viscous(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    damping = values["damping_n_m_s_rad"]
    if plant == "planar":
        # The wheels have no joints here: their damping as the body feels it through the kinematics.
        from mecanum_env.mjcf.geometry import wheels_on_body

        translation, rotation = wheels_on_body(model.robot, damping)
        for name, share in (("base_x", translation), ("base_y", translation), ("base_yaw", rotation)):
            spec.joint(name).damping[0] += share
        return
    for joint in spec.joints:
        if joint.name in _WHEEL_JOINTS:
            joint.damping[0] += damping


def _stiction(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    speed = values["stribeck_rpm"] * RAD_S_PER_RPM
    return replace(drive, breakaway_n_m=values["breakaway_n_m"], stribeck_rad_s=speed)


def _backlash(drive: DriveParameters, values: Values, wheel: str | None) -> DriveParameters:
    return replace(drive, gap_rad=math.radians(values["gap_deg"]))


COULOMB_FRICTION: Final = Effect(
    name="coulomb_friction",
    acts_on="wheel joint",
    parameters=(Parameter("torque_n_m", "N m", 0.0, (0.0, 1.0)),),
    summary="A constant torque against the wheel's motion, which holds a wheel at rest.",
    signature="The same rpm lost at every speed (torque / servo), so the relative loss falls with speed; "
    "with an integrating drive only at starts and reversals.",
    change_drive=_coulomb,
)

STICTION: Final = Effect(
    name="stiction",
    acts_on="wheel joint",
    parameters=(
        Parameter("breakaway_n_m", "N m", 0.0, (0.0, 1.0), scan=(0.05, 0.1, 0.2, 0.4, 0.8)),
        Parameter("stribeck_rpm", "rpm", None, (0.5, 30.0), (1e-3, 1e6), default=5.0),
    ),
    summary="Friction beyond coulomb_friction near rest: breakaway exp(-(speed / stribeck)^2).",
    signature="Small commands do not start the wheel; large ones are reached as without it.",
    change_drive=_stiction,
)

VISCOUS_FRICTION: Final = Effect(
    name="viscous_friction",
    acts_on="wheel joint",
    parameters=(Parameter("damping_n_m_s_rad", "N m s/rad", 0.0, (0.0, 0.5)),),
    summary="A torque against the wheel's motion in proportion to its speed.",
    signature="The same relative loss at every speed; with an integrating drive none.",
    change_spec=_viscous,
)

BACKLASH: Final = Effect(
    name="backlash",
    acts_on="between motor and wheel",
    parameters=(Parameter("gap_deg", "deg", 0.0, (0.0, 20.0), scan=(0.5, 1, 2, 4, 8, 16)),),
    summary="The motor turns through a gap before it drives the wheel the other way.",
    signature="A dead time after each reversal of the torque; steady motion is not changed.",
    change_drive=_backlash,
)
