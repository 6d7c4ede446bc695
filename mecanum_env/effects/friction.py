"""Effects of the wheel's bearing: friction, for good or until the drive's integral action makes up for it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from mecanum_env.effects.definition import (
    ChangeDrive,
    Effect,
    Load,
    Parameter,
    PlanarBody,
    PlantKind,
    Values,
    usual_ceiling_rpm,
)
from mecanum_env.effects.drive import FADING
from mecanum_env.effects.integral_action import ANSWER, WASHOUT, answering, washed_out
from mecanum_env.kinematics import WHEELS
from mecanum_env.model import Model, Robot, cause_of
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.drive import DriveParameters

if TYPE_CHECKING:
    import mujoco

_WHEEL_JOINTS: Final = tuple(f"wheel_{wheel}" for wheel in WHEELS)
_CURRENT: Final = "the motor's current at several steady speeds and at break-away"
_TORQUE: Final = Parameter("torque_n_m", "N m", 0.0, (0.0, 1.2), relative=True)
_BREAKAWAY: Final = Parameter(
    "breakaway_n_m", "N m", 0.0, (0.0, 1.2), scan=(0.02, 0.05, 0.1, 0.25, 0.6), relative=True
)
_STRIBECK: Final = Parameter("stribeck_rpm", "rpm", None, (0.5, 30.0), (1e-3, 1e6), default=5.0)
_DAMPING: Final = Parameter("damping_n_m_s_rad", "N m s/rad", 0.0, (0.0, 2.4), relative=True)
_WARMING: Final = Parameter(
    "time_constant_s", "s", None, (0.1, 300.0), (1e-3, 1e6), default=10.0, scan=(0.5, 3, 20, 120)
)
_COLD_AND_WARM: Final = "the motor's current at one speed, cold and warm"
_NO_FRICTION: Final = 1e-300
"""Friction that is none, by which 0 may be divided."""

COULOMB: Final = "coulomb_friction"
DEAD_ZONE_LIKE_IT: Final = "command_deadband/subtract"
"""A dead zone that takes the same speed from a wheel that turns as Coulomb friction does on a drive without
integral action. Every motor rubs, and floors and loads change that; a dead zone is a number in a drive."""
_TORQUES: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "coulomb_friction": ("torque_n_m",),
        "stiction": ("breakaway_n_m",),
        "viscous_friction": (_DAMPING.name,),
        "torque_ripple": ("torque_n_m",),
        "warm_up/cold_friction": ("torque_n_m", _DAMPING.name),
    }
)
"""Cause, or form of one, that is a torque on the wheel -> its parameters that say how large."""


def torques_of(name: str) -> tuple[str, ...]:
    """Return the parameters of an effect, in any form, that are torques; none if it is no torque."""
    return _TORQUES.get(name) or _TORQUES.get(cause_of(name), ())


def droop_rpm(name: str, values: Values, model: Model, speed_rpm: float | None = None) -> float:
    """Return the speed [rpm] that a torque takes from a drive of the model without integral action.

    It is torque / servo, at a wheel speed that counts for damping only, by default the usual highest one.
    `name` is one of an effect with `torques_of`, in any form, and `values` are its parameters. Breakaway
    counts as at rest, a ripple with its amplitude, a cold bearing with its torque and damping at the start.
    """
    speed = usual_ceiling_rpm(model) if speed_rpm is None else speed_rpm
    factors = {_DAMPING.name: speed * RAD_S_PER_RPM}
    torque = sum(factors.get(key, 1.0) * values.get(key, 0.0) for key in torques_of(name))
    weak = model.effects.get("weak_servo", {})
    servo = weak.get("servo_n_m_s_rad", model.robot.servo_n_m_s_rad)
    return torque / servo / RAD_S_PER_RPM


def stiffness_is_known(model: Model) -> bool:
    """Return whether a torque of the model means something in N m: its servo's stiffness was given or fitted.

    A model that says nothing has the packaged robot's stiffness, to which only ratios are known.
    """
    fitted = "servo_n_m_s_rad" in (model.uncertainty.get("robot") or {})
    return fitted or "weak_servo" in model.effects or model.robot.servo_n_m_s_rad != Robot.servo_n_m_s_rad


def _damped_joints(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    damping = values["damping_n_m_s_rad"]
    for joint in spec.joints:
        if joint.name in ("wheel", *_WHEEL_JOINTS):
            joint.damping[0] += damping
    if plant == "planar":
        # This plant has no wheel joints. The gears of its actuators are the rows of the matrix G from body
        # velocity to wheel speeds, so four dampers d dissipate like d G'G on the body, which has no cross
        # terms. The joints lie along the world's axes: forward and sideways share their mean.
        gears = [spec.actuator(name).gear for name in _WHEEL_JOINTS]
        rows = np.array([[gear[0], gear[1], gear[5]] for gear in gears])
        forward, sideways, yaw = damping * np.diag(rows.T @ rows)
        mean = (forward + sideways) / 2
        for name, share in (("base_x", mean), ("base_y", mean), ("base_yaw", yaw)):
            spec.joint(name).damping[0] += float(share)


def _damped_body(body: PlanarBody, values: Values) -> PlanarBody:
    damping = body.wheel_damping_n_m_s_rad + values["damping_n_m_s_rad"]
    return replace(body, wheel_damping_n_m_s_rad=damping)


def _loads(numbers_of: Callable[[Values], Mapping[str, float]]) -> ChangeDrive:
    """Return the change of a drive by a friction, given the numbers of its load that are the friction's."""

    def change(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
        numbers: dict[str, Any] = dict(numbers_of(values))
        return answering(replace(drive, load=replace(drive.load, **numbers)), values)

    return change


def _coulomb(values: Values) -> dict[str, float]:
    return {"coulomb_n_m": values["torque_n_m"]}


def _stiction(values: Values) -> dict[str, float]:
    speed = values["stribeck_rpm"] * RAD_S_PER_RPM
    return {"breakaway_n_m": values["breakaway_n_m"], "stribeck_rad_s": speed}


def _viscous(values: Values) -> dict[str, float]:
    return {"viscous_n_m_s_rad": values["damping_n_m_s_rad"]}


def _warm(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    return replace(
        drive,
        load=replace(
            drive.load,
            friction_warm_share=values["share"],
            viscous_warm_share=values["share"],
            friction_warm_s=values["time_constant_s"],
        ),
    )


def _cold(drive: DriveParameters, values: Values, _wheel: str | None) -> DriveParameters:
    """Return a drive whose bearing begins with more friction than its own, and comes down to that.

    T + more exp(-t / T_c) = (T + more) (1 - s (1 - exp(-t / T_c))) with s = more / (T + more): a larger
    friction that falls as it warms up, which the plugin has. Coulomb friction and stiction grow alike.
    """
    load, more, damping = drive.load, values["torque_n_m"], values["damping_n_m_s_rad"]
    # Without branches, as the numbers may be those of many robots.
    dry = load.coulomb_n_m + load.breakaway_n_m
    sticking = load.breakaway_n_m / np.maximum(dry, _NO_FRICTION)
    viscous = load.viscous_n_m_s_rad + damping
    return replace(
        drive,
        load=replace(
            load,
            breakaway_n_m=load.breakaway_n_m + sticking * more,
            coulomb_n_m=load.coulomb_n_m + (1.0 - sticking) * more,
            viscous_n_m_s_rad=viscous,
            friction_warm_share=more / np.maximum(dry + more, _NO_FRICTION),
            viscous_warm_share=damping / np.maximum(viscous, _NO_FRICTION),
            friction_warm_s=values["time_constant_s"],
        ),
    )


EFFECTS: Final = (
    Effect(
        name="warm_up/friction",
        station="load",
        acts_on="wheel joint",
        parameters=(Parameter("share", "1", 0.0, (0.0, 0.98), (0.0, 1.0)), _WARMING),
        summary="The bearing's frictions fall by this share of themselves while it warms up; a model without "
        "friction has none to lose.",
        signature="The loss in speed and the hold at rest fade from the start of the run on.",
        direct_check=_COLD_AND_WARM,
        undone_by="command",
        change_drive=_warm,
    ),
    Effect(
        name="coulomb_friction",
        first_form="droop",
        station="load",
        acts_on="wheel joint",
        parameters=(_TORQUE, ANSWER),
        summary="A constant torque against the wheel's motion, which holds a wheel at rest.",
        signature="The same loss in rpm at every speed (torque / servo), so the relative loss falls with "
        "speed; with integral action in the drive it shows only at starts and reversals.",
        direct_check=_CURRENT,
        realistic=lambda _: {"torque_n_m": 0.3},
        undone_by="command",
        load=lambda values: Load(coulomb_n_m=values["torque_n_m"]),
        change_drive=_loads(_coulomb),
    ),
    Effect(
        name="coulomb_friction/washed_out",
        station="load",
        acts_on="wheel joint",
        parameters=(_TORQUE, ANSWER, WASHOUT),
        summary="The same torque, on a drive whose integral action makes up for it within the wash-out time.",
        signature="A loss after each start and reversal that fades; steady speeds are reached.",
        direct_check=_CURRENT,
        load=lambda values: Load(coulomb_n_m=values["torque_n_m"]),
        change_model=washed_out,
        change_drive=_loads(_coulomb),
    ),
    Effect(
        name="stiction",
        first_form="droop",
        station="load",
        acts_on="wheel joint",
        parameters=(_BREAKAWAY, _STRIBECK, ANSWER),
        summary="Friction near rest beyond coulomb_friction: breakaway exp(-(speed / stribeck)^2).",
        signature="Small commands do not start the wheel; large ones are reached as without it.",
        direct_check=_CURRENT,
        realistic=lambda _: {"breakaway_n_m": 0.3},
        undone_by="command",
        change_drive=_loads(_stiction),
    ),
    Effect(
        name="stiction/washed_out",
        station="load",
        acts_on="wheel joint",
        parameters=(_BREAKAWAY, _STRIBECK, ANSWER, WASHOUT),
        summary="The same friction, on a drive whose integral action breaks the wheel loose at last.",
        signature="The wheel starts late at small commands, with a jerk, and reaches them.",
        direct_check=_CURRENT,
        change_model=washed_out,
        change_drive=_loads(_stiction),
    ),
    Effect(
        name="viscous_friction",
        first_form="droop",
        station="load",
        acts_on="wheel joint",
        parameters=(_DAMPING, ANSWER),
        summary="A torque against the wheel's motion in proportion to its speed.",
        signature="The same relative loss at every speed; none with integral action in the drive.",
        direct_check=_CURRENT,
        realistic=lambda _: {"damping_n_m_s_rad": 0.05},
        undone_by="command",
        load=lambda values: Load(damping_n_m_s_rad=values["damping_n_m_s_rad"]),
        change_drive=_loads(_viscous),
        change_spec=_damped_joints,
        change_planar=_damped_body,
        damps_joint=True,
    ),
    Effect(
        name="viscous_friction/washed_out",
        station="load",
        acts_on="wheel joint",
        parameters=(_DAMPING, ANSWER, WASHOUT),
        summary="The same torque, on a drive whose integral action makes up for it within the wash-out time.",
        signature="A loss in proportion to the last change of speed, which fades; steady speeds are reached.",
        direct_check=_CURRENT,
        load=lambda values: Load(damping_n_m_s_rad=values["damping_n_m_s_rad"]),
        change_model=washed_out,
        change_drive=_loads(_viscous),
        change_spec=_damped_joints,
        change_planar=_damped_body,
        damps_joint=True,
    ),
    Effect(
        name="warm_up/cold_friction",
        station="load",
        acts_on="wheel joint",
        parameters=(_TORQUE, _DAMPING, FADING),
        summary="A bearing starts cold, and the model is that of a warm one: at the start this torque and "
        "this damping are added to its frictions, of which it may have none, and fade. Coulomb friction and "
        "stiction share the torque as the model has them.",
        signature="The loss in speed and the hold at rest are larger at the start of a run only.",
        direct_check=_COLD_AND_WARM,
        undone_by="command",
        change_drive=_cold,
        change_spec=_damped_joints,
        change_planar=_damped_body,
        damps_joint=True,
    ),
)
