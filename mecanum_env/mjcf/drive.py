"""The actuators: the identified wheel drive (the plugin), or a plain velocity servo for other engines."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import mujoco

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import Model, Robot
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, set_wheel_parameters

Drive = Literal["plugin", "servo"]
"""What ctrl means. `plugin`: the wheel command [rpm], and the law runs inside. `servo`: the setpoint [rad/s],
from a law that runs outside, for engines without plugins. To feed the wheel's inertia forward, as the plugin
does, tell it setpoint + inertia / servo times the setpoint's acceleration (`wheel_inertia`). Its torque limit
is MuJoCo's own clamp, with which a free or slipping wheel rings at the step rate while the limit acts; the
plugin's does not."""


def prepare_drives(spec: mujoco.MjSpec, model: Model) -> None:
    """Set the defaults that every wheel's actuator shares.

    The plugin element of MJCF has no bias attributes, so they come from the default class. The affine bias
    tells the implicit integrator how the servo's torque changes with speed.
    """
    spec.default.actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    spec.default.actuator.biasprm = [0.0, 0.0, -model.robot.servo_n_m_s_rad] + [0.0] * 7


def add_drive(
    spec: mujoco.MjSpec,
    model: Model,
    name: str,
    drive: Drive,
    wheel_quantum: bool,
    law_wheel: str | None,
    site_gear: Sequence[float] | None = None,
    *,
    torque_limit_n_m: float | None = None,
) -> None:
    """Add the actuator `name` on the joint `name` or (`site_gear`) on the site "base".

    `law_wheel` (fl .. rr, or None for the common law) says whose law it runs. With `site_gear` the actuator's
    speed is gear . (site velocity), the wheel speed that the body's motion asks for, and its torque acts on
    the body as the matching force and moment. `torque_limit_n_m` replaces the robot's limit. `drive` and
    `wheel_quantum` are those of `robot_spec`.

    Raises:
        InputError: `drive` is "servo" and the model has an effect between law and wheel.
    """
    actuator = spec.add_actuator(name=name)
    if site_gear is None:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, name
    else:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_SITE, "base"
        actuator.gear = site_gear
    if drive == "servo":
        behind = drive_parameters(model, law_wheel)
        if behind.gap_rad > 0.0 or behind.coulomb_n_m > 0.0 or behind.breakaway_n_m > 0.0:
            raise InputError(
                "effects.backlash, effects.coulomb_friction and effects.stiction need the plugin, "
                'drive="plugin"; remove them from the model file for drive="servo"'
            )
        limit = model.robot.torque_limit_n_m if torque_limit_n_m is None else torque_limit_n_m
        actuator.gainprm = [model.robot.servo_n_m_s_rad] + [0.0] * 9
        if limit < NO_TORQUE_LIMIT:
            actuator.forcerange = [-limit, limit]
        return
    quantum = None if wheel_quantum else 0.0
    inertia = wheel_inertia(model.robot)
    set_wheel_parameters(spec, actuator, model, law_wheel, quantum, torque_limit_n_m, inertia)


def wheel_inertia(robot: Robot) -> float:
    """Return the moment of inertia [kg m^2] of a free wheel of a robot about its axle, rollers included."""
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    return robot_masses(robot).wheel_spin_inertia(geometry)
