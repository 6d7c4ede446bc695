"""The robot on its rollers: a free base, a rocker front axle, four wheels of many rollers each."""

from __future__ import annotations

import mujoco

from mecanum_env.effects.apply import change_spec, changed_model
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.chassis import dress_robot
from mecanum_env.mjcf.drive import Drive, add_drive, prepare_drives
from mecanum_env.mjcf.geometry import wheel_geometry, wheel_position
from mecanum_env.mjcf.masses import base_offset, robot_masses
from mecanum_env.mjcf.physics import add_floor_pair, fitting_timestep, new_spec
from mecanum_env.mjcf.scene import add_scene, add_views
from mecanum_env.mjcf.sensors import add_sensors
from mecanum_env.mjcf.wheel import add_wheel, set_inertia
from mecanum_env.model import Model

ROCKER_LIMIT_RAD = 0.2


def robot_spec(
    model: Model,
    timestep_s: float | None = None,
    *,
    drive: Drive = "plugin",
    wheel_quantum: bool = True,
    visuals: bool = True,
) -> mujoco.MjSpec:
    """Return the robot with roller wheels on its field.

    Four wheels on a rigid frame are statically indeterminate: which three carry the load would be decided by
    micrometres. The front wheels therefore sit on a rocker that turns about the long axis.

    Names: body, free joint and site "base" (its origin is at axle height, midway between the wheels); bodies,
    joints and actuators "wheel_fl" .. "wheel_rr"; rollers "wheel_fl_roller_0" ..; joint "rocker"; geom
    "floor"; sensors as in `mecanum_env.mjcf.sensors`; cameras "track", "overview", "side", "top".

    Args:
        model: the identified wheel and its robot.
        timestep_s: upper bound of the physics step [s], 1/480 s by default (`TRAINING_TIMESTEP_S` for
            training); made smaller until the law's sample period is a whole multiple.
        drive: `plugin` takes rpm, `servo` takes rad/s; see `mecanum_env.mjcf.drive`.
        wheel_quantum: round each wheel command to the model's quantum; False where the program has already
            rounded V, theta and VC, as the robot itself does.
        visuals: include what is only seen.

    Raises:
        InputError: an effect that is not simulated, or a yaw inertia that the wheels alone exceed.
    """
    model = changed_model(model, "rollers")
    timestep_s = fitting_timestep(model, timestep_s)
    robot = model.robot
    spec = new_spec("mecanum robot", timestep_s)
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    masses = robot_masses(robot)
    add_scene(spec, visuals=visuals)

    base = spec.worldbody.add_body(name="base", pos=[0, 0, robot.wheel_radius_m])
    base.add_joint(name="base", type=mujoco.mjtJoint.mjJNT_FREE)
    base.add_site(name="base", group=4)
    height = 0.6 * robot.wheel_radius_m
    set_inertia(base, masses.base, (base_offset(robot), 0.0, height))

    rocker = base.add_body(name="rocker", pos=[robot.half_wheelbase_m, 0, 0])
    set_inertia(rocker, masses.rocker)
    rocker.add_joint(
        name="rocker",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[1, 0, 0],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[-ROCKER_LIMIT_RAD, ROCKER_LIMIT_RAD],
    )
    prepare_drives(spec, model)
    for wheel in WHEELS:
        x, y = wheel_position(robot, wheel)
        name = f"wheel_{wheel}"
        parent, place = (rocker, (0.0, y, 0.0)) if wheel[0] == "f" else (base, (x, y, 0.0))
        for roller in add_wheel(parent, wheel, place, geometry, masses, visuals=visuals):
            add_floor_pair(spec, roller, robot.friction, timestep_s)
        add_drive(spec, model, name, drive, wheel_quantum, wheel)
    add_sensors(spec)
    change_spec(spec, model, "rollers")
    if visuals:
        dress_robot(base, rocker, robot, geometry)
        add_views(spec, base, robot)
    return spec
