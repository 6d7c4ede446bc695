"""The planar plant: the same robot without rollers, three degrees of freedom, for training."""

from __future__ import annotations

import mujoco

from mecanum_env.effects.apply import change_spec, changed_model
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.chassis import dress_robot
from mecanum_env.mjcf.drive import Drive, add_drive, prepare_drives, wheel_inertia
from mecanum_env.mjcf.geometry import no_slip_rows, wheel_geometry, wheels_on_body
from mecanum_env.mjcf.masses import Inertia
from mecanum_env.mjcf.physics import fitting_timestep, new_spec
from mecanum_env.mjcf.scene import add_scene, add_views
from mecanum_env.mjcf.sensors import add_sensors
from mecanum_env.mjcf.wheel import set_inertia
from mecanum_env.mjcf.wheel_look import add_still_wheels
from mecanum_env.model import Model, Robot


def planar_spec(
    model: Model,
    timestep_s: float | None = None,
    *,
    drive: Drive = "plugin",
    wheel_quantum: bool = True,
    visuals: bool = True,
) -> mujoco.MjSpec:
    """Return the robot that slides on the plane and whose wheels never slip.

    The four actuators act on the site "base" with the rows of `no_slip_rows` as their gear: an actuator's
    speed is the wheel speed that the body's motion asks for, and its torque acts as the matching force and
    moment. The wheels' own inertia is joint armature (`wheel_armature`). Joints "base_x", "base_y" (world
    axes) and "base_yaw"; everything else is named as in `robot_spec`.

    Args:
        model: the identified wheel and its robot.
        timestep_s: upper bound of the physics step [s]; see `fitting_timestep`.
        drive: `plugin` takes rpm, `servo` takes rad/s; see `mecanum_env.mjcf.drive`.
        wheel_quantum: round each wheel command to the model's quantum; see `robot_spec`.
        visuals: include what is only seen.

    Raises:
        InputError: an effect that is not simulated, or a yaw inertia that the wheels alone exceed.
    """
    model = changed_model(model, "planar")
    timestep_s = fitting_timestep(model, timestep_s)
    robot = model.robot
    spec = new_spec("mecanum robot, planar", timestep_s)
    # Three joints: a dense matrix of 3 by 3 beats any bookkeeping.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    add_scene(spec, visuals=visuals)
    base = spec.worldbody.add_body(name="base", pos=[0, 0, robot.wheel_radius_m])
    # Roll and pitch do not move; half and half is the flat body's own.
    yaw = robot.yaw_inertia_kg_m2
    set_inertia(base, Inertia(robot.mass_kg, (yaw / 2, yaw / 2, yaw)))
    translation, rotation = wheel_armature(robot)
    for name, kind, axis, armature in (
        ("base_x", mujoco.mjtJoint.mjJNT_SLIDE, [1, 0, 0], translation),
        ("base_y", mujoco.mjtJoint.mjJNT_SLIDE, [0, 1, 0], translation),
        ("base_yaw", mujoco.mjtJoint.mjJNT_HINGE, [0, 0, 1], rotation),
    ):
        base.add_joint(name=name, type=kind, axis=axis, armature=armature)
    base.add_site(name="base", group=4)
    prepare_drives(spec, model)
    for wheel, (x, y, turn) in zip(WHEELS, no_slip_rows(robot), strict=True):
        gear = [float(x), float(y), 0.0, 0.0, 0.0, float(turn)]
        add_drive(spec, model, f"wheel_{wheel}", drive, wheel_quantum, wheel, gear)
    add_sensors(spec)
    change_spec(spec, model, "planar")
    if visuals:
        geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
        dress_robot(base, base, robot, geometry)
        add_views(spec, base, robot)
        add_still_wheels(base, robot, geometry)
    return spec


def wheel_armature(robot: Robot) -> tuple[float, float]:
    """Return what the turning wheels add to the body's mass [kg] and yaw inertia [kg m^2]."""
    return wheels_on_body(robot, wheel_inertia(robot))
