"""The actuators: the identified wheel drive (the plugin), or a plain velocity servo for other engines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

import mujoco

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.model import Model

Drive = Literal["plugin", "servo"]
"""What ctrl means. `plugin`: the wheel command [rpm], and the law runs inside. `servo`: the setpoint [rad/s],
from a law that runs outside, for engines without plugins."""

USER_SIZE = 16
EFFECTS_HERE = ("command_latency",)


def check_effects(model: Model) -> None:
    """Refuse a model with an effect that the generated physics would leave out.

    Raises:
        InputError: the model names such an effect.
    """
    for name in model.effects:
        if name not in EFFECTS_HERE:
            raise InputError(
                f"effects.{name}: not simulated yet (simulated: {', '.join(EFFECTS_HERE)}); "
                "remove it from the model file to simulate without it"
            )


def prepare_drives(spec: mujoco.MjSpec, model: Model, drive: Drive) -> None:
    """Set the defaults that every wheel's actuator shares.

    The plugin element of MJCF has no bias attributes, so they come from the default class. The affine bias
    tells the implicit integrator how the servo's torque changes with speed.
    """
    check_effects(model)
    spec.nuser_actuator = USER_SIZE
    spec.default.actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    spec.default.actuator.biasprm = [0.0, 0.0, -model.robot.servo_n_m_s_rad] + [0.0] * 7
    if drive == "plugin":
        spec.activate_plugin("mecanum.wheel")


def add_drive(
    spec: mujoco.MjSpec,
    model: Model,
    name: str,
    drive: Drive,
    wheel_quantum: bool,
    law: WheelLaw,
    site_gear: Sequence[float] | None = None,
) -> None:
    """Add the actuator `name` with a wheel's law, on the joint `name` or (`site_gear`) on the site "base".

    With `site_gear` the actuator's speed is gear . (site velocity): the wheel speed that the body's motion
    asks for, and its torque acts on the body as the matching force and moment.
    """
    actuator = spec.add_actuator(name=name)
    if site_gear is None:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, name
    else:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_SITE, "base"
        actuator.gear = site_gear
    limit = model.robot.torque_limit_n_m
    actuator.forcerange = [-limit, limit]
    if drive == "servo":
        actuator.gainprm = [model.robot.servo_n_m_s_rad] + [0.0] * 9
        return
    wheel = model.wheel
    saturation = 0.0 if math.isinf(wheel.saturation_rpm) else wheel.saturation_rpm
    quantum = wheel.command_quantum_rpm if wheel_quantum else 0.0
    actuator.plugin.plugin_name = "mecanum.wheel"
    actuator.plugin.active = True
    actuator.dynprm = [
        *law.coefficients,
        law.sample_period_s,
        wheel.command_period_s,
        quantum,
        saturation,
    ]
    delay = model.effects.get("command_latency", {}).get("delay_s", 0.0)
    user = [0.0] * USER_SIZE
    user[0] = model.robot.servo_integral_n_m_rad
    user[1] = delay
    actuator.userdata = user
