"""Sensors that every robot model has, by the same names in the roller model and the planar plant.

The robot on its rollers: a free base, a rocker front axle, four wheels of many rollers each.

The planar plant: the same robot without rollers, three degrees of freedom, for training.

The bench: one wheel off the floor, as when its response is measured.
"""

from __future__ import annotations

import mujoco

from mecanum_env.effects.apply import change_spec, changed_model
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.chassis import dress_robot
from mecanum_env.mjcf.drive import Drive, add_drive, prepare_drives, wheel_inertia
from mecanum_env.mjcf.geometry import no_slip_rows, wheel_geometry, wheel_position, wheels_on_body
from mecanum_env.mjcf.masses import Inertia, base_offset, robot_masses
from mecanum_env.mjcf.physics import add_floor_pair, fitting_timestep, new_spec
from mecanum_env.mjcf.scene import add_appearance, add_bench_view, add_scene, add_views
from mecanum_env.mjcf.wheel import add_still_wheels, add_wheel, dress_bench, set_inertia
from mecanum_env.model import Model, Robot
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT

_SITE = mujoco.mjtObj.mjOBJ_SITE


def add_sensors(spec: mujoco.MjSpec) -> None:
    """Add wheel speeds and the motion of the site "base".

    | sensor | value |
    |---|---|
    | `wheel_fl_speed` .. `wheel_rr_speed` | wheel speed [rad/s] |
    | `base_velocity` | velocity in the body's frame [m/s] |
    | `base_gyro` | angular velocity in the body's frame [rad/s] |
    | `base_accelerometer` | acceleration in the body's frame, gravity included [m/s^2] |
    | `base_position`, `base_orientation` | pose in the world [m, quaternion] |
    """
    for wheel in WHEELS:
        spec.add_sensor(
            name=f"wheel_{wheel}_speed",
            type=mujoco.mjtSensor.mjSENS_ACTUATORVEL,
            objtype=mujoco.mjtObj.mjOBJ_ACTUATOR,
            objname=f"wheel_{wheel}",
        )
    for name, kind in (
        ("base_velocity", mujoco.mjtSensor.mjSENS_VELOCIMETER),
        ("base_gyro", mujoco.mjtSensor.mjSENS_GYRO),
        ("base_accelerometer", mujoco.mjtSensor.mjSENS_ACCELEROMETER),
        ("base_position", mujoco.mjtSensor.mjSENS_FRAMEPOS),
        ("base_orientation", mujoco.mjtSensor.mjSENS_FRAMEQUAT),
    ):
        spec.add_sensor(name=name, type=kind, objtype=_SITE, objname="base")


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
    "floor"; sensors as in `mecanum_env.mjcf.plants`; cameras "track", "overview", "side", "top".

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


def bench_spec(
    model: Model,
    timestep_s: float | None = None,
    *,
    wheel: str | None = None,
    drive: Drive = "plugin",
    wheel_quantum: bool = True,
    visuals: bool = True,
) -> mujoco.MjSpec:
    """Return one free wheel on a stand: joint and actuator "wheel", sensor "wheel_speed" [rad/s].

    The torque has no limit here: the law is what the drive does without load, its motor's limits included.
    The rollers are fixed to the hub (nothing turns them here), so the wheel has one degree of freedom and
    the moment of inertia of hub and rollers together.

    Args:
        model: the identified wheel and its robot.
        timestep_s: upper bound of the physics step [s], 1/480 s by default (`TRAINING_TIMESTEP_S` for
            training); made smaller until the law's sample period is a whole multiple.
        wheel: fl, fr, rl or rr to put that wheel's own law on the bench; by default the common one.
        drive: `plugin` takes rpm, `servo` takes rad/s; see `mecanum_env.mjcf.drive`.
        wheel_quantum: round each wheel command to the model's quantum, as the drive electronics do.
        visuals: include what is only seen.

    Raises:
        InputError: an effect that is not simulated, or an impossible inertia.
    """
    model = changed_model(model, "bench")
    timestep_s = fitting_timestep(model, timestep_s)
    spec = new_spec("mecanum wheel bench", timestep_s)
    geometry = wheel_geometry(model.robot.wheel_radius_m, model.robot.rollers_per_wheel)
    masses = robot_masses(model.robot)
    spin = masses.wheel_spin_inertia(geometry)
    mass = masses.hub.mass + geometry.rollers * masses.roller.mass
    # About the other two axes nothing moves; anything that makes a possible body will do.
    body = spec.worldbody.add_body(name="wheel", pos=[0, 0, 2 * geometry.radius])
    set_inertia(body, Inertia(mass, (spin, spin, spin)))
    body.add_joint(name="wheel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    prepare_drives(spec, model)
    # The identified law is what the drive does without load, whatever its motor could or could not.
    add_drive(spec, model, "wheel", drive, wheel_quantum, wheel, torque_limit_n_m=NO_TORQUE_LIMIT)
    spec.add_sensor(
        name="wheel_speed",
        type=mujoco.mjtSensor.mjSENS_JOINTVEL,
        objtype=mujoco.mjtObj.mjOBJ_JOINT,
        objname="wheel",
    )
    change_spec(spec, model, "bench")
    if visuals:
        add_appearance(spec)
        dress_bench(spec.worldbody, body, geometry)
        add_bench_view(spec, geometry.radius)
    return spec
