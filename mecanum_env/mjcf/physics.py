"""Physics that the three plants share: time step, integrator, solver, floor contact, wheel actuators."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, Literal

import mujoco

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.mjcf.masses import robot_masses, spin_inertia, surely_possible
from mecanum_env.model import Model, Robot
from mecanum_env.plugin import ROLLERS_PLUGIN
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, rotor_inertia, set_wheel_parameters

SIMULATION_TIMESTEP_S: Final = 1 / 480
"""Default upper bound of the physics step [s]; see `fitting_timestep`."""
TRAINING_TIMESTEP_S: Final = 1 / 240
"""Physics step of training [s], at half the cost. Over 10 s of commands like the paper's, held for 0.2 and
0.8 s, the path differs from that at 1/960 s by up to 1 %. With a new random command every 0.1 s the path on
rollers differs by 2 to 6 % (at 1/480 s by 0.4 to 1.1 %), that of the planar plant by 0.3 %."""
_CONTACT_IMPEDANCE: Final = (0.99, 0.999, 0.001, 0.5, 2.0)
"""solimp of the floor contact; MuJoCo's default bounces by 2 mm and loses a tenth of sideways motion."""

Drive = Literal["plugin", "servo"]
"""What drives a wheel.

`plugin`: ctrl is the wheel command [rpm], and the wheel law runs inside. `servo`, for engines without
plugins: ctrl is the setpoint [rad/s] of a plain velocity servo, from a law that runs outside. To feed the
wheel's inertia forward, as the plugin does, add inertia / servo times the setpoint's acceleration
(`wheel_inertia`). The servo's torque limit is MuJoCo's own clamp, with which a free or slipping wheel rings
at the step rate while the limit acts; the plugin's wheel does not.
"""


def fitting_timestep(model: Model, at_most_s: float | None = None) -> float:
    """Return the largest step up to `at_most_s` [s] of which the law's sample period is a whole multiple.

    The upper bound is `SIMULATION_TIMESTEP_S` by default.

    Raises:
        InputError: `at_most_s` is not a number above 0.
    """
    if at_most_s is None:
        at_most_s = SIMULATION_TIMESTEP_S
    if not (math.isfinite(at_most_s) and at_most_s > 0.0):
        raise InputError(f"timestep_s = {at_most_s}, must be above 0, such as {SIMULATION_TIMESTEP_S:.6g}")
    period = model.wheel.law.sample_period_s
    # The margin absorbs rounding: 1/120 over 1/480 must be 4 steps.
    return period / max(1, math.ceil(period / at_most_s - 1e-9))


def new_spec(name: str, timestep_s: float) -> mujoco.MjSpec:
    """Return an empty spec with a name and the options that were tuned for roller contact.

    The Jacobian is sparse: for a model of this size MuJoCo's "auto" picks dense, which takes twice as long.
    """
    spec = mujoco.MjSpec()
    spec.modelname = name
    spec.compiler.autolimits = True
    spec.option.timestep = timestep_s
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.solver = mujoco.mjtSolver.mjSOL_NEWTON
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_SPARSE
    return spec


def add_floor_pair(spec: mujoco.MjSpec, roller: str, friction: float) -> None:
    """Let a roller touch the floor: stiff contact, two time steps long, with Coulomb friction."""
    pair = spec.add_pair(name=f"{roller}_floor", geomname1=roller, geomname2="floor")
    pair.condim = 3
    pair.friction = [friction, friction, 0.005, 0.0001, 0.0001]
    pair.solref = [2 * spec.option.timestep, 1.0]
    pair.solimp = _CONTACT_IMPEDANCE


def prepare_drives(spec: mujoco.MjSpec, model: Model) -> None:
    """Set the defaults that every wheel's actuator shares.

    MJCF's plugin element has no bias attributes, so the default class holds them. The affine bias tells the
    implicit integrator how the servo's torque changes with speed.
    """
    spec.default.actuator.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    spec.default.actuator.biasprm = [0.0, 0.0, -model.robot.servo_n_m_s_rad] + [0.0] * 7


def add_roller_friction(
    spec: mujoco.MjSpec, base: mujoco.MjsBody, drive: Drive, numbers: tuple[float, float, float, float]
) -> None:
    """Give the planar plant's body the friction of its rollers, if there is any.

    `numbers` are those of `mecanum_env.mjcf.sideways`, and `drive` is as for `add_drive`.

    Raises:
        InputError: there is friction, and `drive` is "servo", for engines without plugins.
    """
    rub, drag, *_ = numbers
    if rub == 0.0 and drag == 0.0:
        return
    if drive == "servo":
        raise InputError(
            'effects.roller_friction needs the plugin, drive="plugin", on the planar plant; remove it from '
            'the model file for drive="servo", or take the rollers'
        )
    spec.activate_plugin(ROLLERS_PLUGIN)
    base.plugin = spec.add_plugin(name="rollers", plugin_name=ROLLERS_PLUGIN, active=True)
    spec.nuser_body = len(numbers)
    base.userdata = [float(number) for number in numbers]


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
    """Add the actuator of one wheel.

    Args:
        spec: written in place.
        model: wheel, servo, torque limit, and the effects that act in the drive.
        name: name of the actuator and, without `site_gear`, of the joint it turns.
        drive: "plugin" or "servo".
        wheel_quantum: round the wheel's command to the model's quantum.
        law_wheel: fl, fr, rl or rr for that wheel's own law; None for the common one.
        site_gear: gear (6,) on the site "base" instead of a joint; see `planar_spec`.
        torque_limit_n_m: torque limit instead of the robot's.

    Raises:
        InputError: `drive` is "servo", and the model has an effect between law and wheel.
    """
    actuator = spec.add_actuator(name=name)
    if site_gear is None:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_JOINT, name
    else:
        actuator.trntype, actuator.target = mujoco.mjtTrn.mjTRN_SITE, "base"
        actuator.gear = site_gear
    if drive == "plugin":
        quantum = None if wheel_quantum else 0.0
        inertia = wheel_inertia(model.robot)
        set_wheel_parameters(spec, actuator, model, law_wheel, quantum, torque_limit_n_m, inertia)
        if site_gear is None:
            spec.joint(name).armature += rotor_inertia(model.robot, drive_parameters(model, law_wheel))
        return
    parameters = drive_parameters(model, law_wheel)
    if parameters.load.acts or parameters.load_program:
        raise InputError(
            "effects.backlash, effects.torque_ripple, effects.coulomb_friction, effects.stiction, any "
            'answer_s and a custom load need the plugin, drive="plugin"; remove them from the model file for '
            'drive="servo"'
        )
    limit = model.robot.torque_limit_n_m if torque_limit_n_m is None else torque_limit_n_m
    actuator.gainprm = [model.robot.servo_n_m_s_rad] + [0.0] * 9
    if limit < NO_TORQUE_LIMIT:
        actuator.forcerange = [-limit, limit]


@lru_cache(maxsize=64)
def wheel_inertia(robot: Robot) -> float:
    """Return the moment of inertia [kg m^2] of a robot's free wheel about its axle, rollers included.

    Raises:
        InputError: the robot's yaw inertia is less than that of its wheels alone.
    """
    if not surely_possible(robot):
        robot_masses(robot)
    return spin_inertia(robot.mass_kg, wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel))
