"""Effects between motor and wheel, and in the wheel's bearing."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np

from mecanum_env.effects.definition import Effect, Load, Parameter, PlantKind, Values
from mecanum_env.kinematics import WHEELS
from mecanum_env.law.drive import DriveParameters
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM

if TYPE_CHECKING:
    import mujoco

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


EFFECTS: Final = (
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
