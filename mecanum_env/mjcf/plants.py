"""The three plants of a model: the robot on its rollers, the planar plant, and the bench.

As MuJoCo specs, and as MJCF files that any MuJoCo program opens once this package is installed.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final, NamedTuple

import mujoco

from mecanum_env.effects.apply import (
    active_effects,
    change_spec,
    changed_model,
    drive_parameters,
    planar_body,
)
from mecanum_env.effects.definition import PlantKind, RobotPlant
from mecanum_env.errors import EffectRefusedError
from mecanum_env.files import write_text
from mecanum_env.kinematics import WHEELS, require_mecanum
from mecanum_env.mjcf.chassis import dress_robot
from mecanum_env.mjcf.geometry import no_slip_rows, wheel_geometry, wheel_position, wheels_on_body
from mecanum_env.mjcf.masses import Inertia, base_offset, robot_masses
from mecanum_env.mjcf.physics import (
    Drive,
    add_drive,
    add_floor_pair,
    add_roller_friction,
    fitting_timestep,
    new_spec,
    prepare_drives,
    wheel_inertia,
)
from mecanum_env.mjcf.scene import add_appearance, add_bench_view, add_scene, add_views
from mecanum_env.mjcf.sideways import sideways_friction
from mecanum_env.mjcf.wheel import add_still_wheel, add_wheel, dress_bench, set_inertia
from mecanum_env.model import Model, Robot
from mecanum_env.outputs import output_folder
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, rotor_inertia

PLANAR_JOINTS: Final = (
    ("base_x", mujoco.mjtJoint.mjJNT_SLIDE, [1, 0, 0]),
    ("base_y", mujoco.mjtJoint.mjJNT_SLIDE, [0, 1, 0]),
    ("base_yaw", mujoco.mjtJoint.mjJNT_HINGE, [0, 0, 1]),
)
"""Name, type and axis of the joints of the planar plant, in order."""


def robot_spec(
    model: Model,
    timestep_s: float | None = None,
    *,
    drive: Drive = "plugin",
    wheel_quantum: bool = True,
    visuals: bool = True,
) -> mujoco.MjSpec:
    """Return the robot on its roller wheels, on its field.

    Four wheels on a rigid frame are statically indeterminate: micrometres would decide which three carry the
    load. The front wheels therefore sit on a rocker that turns about the long axis.

    Names: body, free joint and site "base" (its origin at axle height, midway between the wheels); bodies,
    joints and actuators "wheel_fl" .. "wheel_rr"; rollers "wheel_fl_roller_0" ..; joint "rocker"; geom
    "floor"; cameras "track", "close", "side", "overview", "top"; sensors

    | sensor | value |
    |---|---|
    | `wheel_fl_speed` .. `wheel_rr_speed` | wheel speed [rad/s] |
    | `base_velocity` | velocity in the body frame [m/s] |
    | `base_gyro` | angular velocity in the body frame [rad/s] |
    | `base_accelerometer` | acceleration in the body frame, gravity included [m/s^2] |
    | `base_position`, `base_orientation` | pose in the world frame [m, quaternion] |

    Args:
        model: wheel, robot and effects.
        timestep_s: upper bound of the physics step [s], by default 1/480 s; see `fitting_timestep`.
        drive: "plugin" takes rpm, "servo" takes rad/s; see `mecanum_env.mjcf.physics.Drive`.
        wheel_quantum: round each wheel command to the model's quantum; False if the program has already
            rounded V, theta and VC, as the robot itself does.
        visuals: include what is only seen.

    Raises:
        InputError: an effect that the plant cannot simulate, or a yaw inertia that the wheels alone exceed.
    """
    model, spec, base = _begin(model, "rollers", "mecanum robot", timestep_s, visuals)
    robot = model.robot
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    masses = robot_masses(robot)
    if geometry.barrels:
        spec.nuser_geom = len(geometry.barrel)
    base.add_joint(name="base", type=mujoco.mjtJoint.mjJNT_FREE)
    set_inertia(base, masses.base, (base_offset(robot), 0.0, 0.6 * robot.wheel_radius_m))
    rocker = base.add_body(name="rocker", pos=[robot.half_wheelbase_m, 0, 0])
    set_inertia(rocker, masses.rocker)
    rocker.add_joint(
        name="rocker",
        type=mujoco.mjtJoint.mjJNT_HINGE,
        axis=[1, 0, 0],
        limited=mujoco.mjtLimited.mjLIMITED_TRUE,
        range=[-0.2, 0.2],
    )
    for wheel in WHEELS:
        x, y = wheel_position(robot, wheel)
        parent, place = (rocker, (0.0, y, 0.0)) if wheel[0] == "f" else (base, (x, y, 0.0))
        for roller in add_wheel(parent, wheel, place, geometry, masses, visuals=visuals):
            add_floor_pair(spec, roller, robot.friction)
        add_drive(spec, model, f"wheel_{wheel}", drive, wheel_quantum, wheel)
    _add_sensors(spec)
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
    """Return the robot that slides on the plane and whose wheels never slip: three degrees of freedom.

    The four actuators act on the site "base" with the rows of `no_slip_rows` as their gear: an actuator's
    speed is the wheel speed that the body's motion asks for, and its torque acts as the matching force and
    moment. The friction of the rollers is a force along the body's y, from the passive plugin
    "mecanum.rollers". The wheels' own inertia is joint armature (`wheel_armature`). Joints "base_x", "base_y"
    (world axes) and "base_yaw"; all other names are those of `robot_spec`, as are the arguments `drive`,
    `wheel_quantum` and `visuals`.

    Raises:
        InputError: an effect that the plant cannot simulate, or a yaw inertia that the wheels alone exceed.
    """
    model, spec, base = _begin(model, "planar", "mecanum robot, planar", timestep_s, visuals)
    robot = model.robot
    # For a matrix of 3 by 3 dense is faster than the bookkeeping of sparse.
    spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
    numbers = planar_numbers(robot, rotor_inertia(robot, drive_parameters(model)))
    set_inertia(base, numbers.inertia)
    for (name, kind, axis), armature in zip(PLANAR_JOINTS, numbers.armature, strict=True):
        base.add_joint(name=name, type=kind, axis=axis, armature=armature)
    for wheel, gear in zip(WHEELS, numbers.gears, strict=True):
        add_drive(spec, model, f"wheel_{wheel}", drive, wheel_quantum, wheel, gear)
    acting = active_effects(model)
    add_roller_friction(
        spec, base, drive, sideways_friction(robot, planar_body(robot, acting), spec.option.timestep)
    )
    _add_sensors(spec)
    change_spec(spec, model, "planar")
    if visuals:
        geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
        dress_robot(base, base, robot, geometry)
        add_views(spec, base, robot)
        for wheel in WHEELS:
            add_still_wheel(base, wheel, geometry, (*wheel_position(robot, wheel), 0.0))
    return spec


class PlanarNumbers(NamedTuple):
    """What a robot's dimensions and masses are in the planar plant."""

    inertia: Inertia
    """That of the body."""
    armature: tuple[float, float, float]
    """That of the joints in `PLANAR_JOINTS`."""
    gears: list[list[float]]
    """Gear (6,) of each wheel's actuator."""


def planar_numbers(robot: Robot, rotor_kg_m2: float) -> PlanarNumbers:
    """Return the numbers of the planar plant of a robot, given the inertia of each drive's rotor."""
    # The body does not roll or pitch; half the yaw inertia each is that of a flat body.
    yaw = robot.yaw_inertia_kg_m2
    translation, rotation = wheel_armature(robot, rotor_kg_m2)
    gears = [[x, y, 0.0, 0.0, 0.0, turn] for x, y, turn in no_slip_rows(robot).tolist()]
    inertia = Inertia(robot.mass_kg, (yaw / 2, yaw / 2, yaw))
    return PlanarNumbers(inertia, (translation, translation, rotation), gears)


def wheel_armature(robot: Robot, rotor_kg_m2: float = 0.0) -> tuple[float, float]:
    """Return what the turning wheels add to the body's mass [kg] and yaw inertia [kg m^2].

    `rotor_kg_m2` is the inertia of the rotor that turns with each wheel.
    """
    return wheels_on_body(robot, wheel_inertia(robot) + rotor_kg_m2)


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

    The torque has no limit here: the identified law is what the drive does without load, limits of its motor
    included. The rollers are fixed to the hub (nothing turns them here), so the wheel has one degree of
    freedom and the moment of inertia of hub and rollers together.

    `wheel` (fl, fr, rl or rr) puts that wheel's own law on the bench instead of the common one; `drive`,
    `wheel_quantum` and `visuals` are those of `robot_spec`.

    Raises:
        InputError: an effect that the plant cannot simulate, or an impossible inertia.
    """
    model, spec = _new_plant(model, "bench", "mecanum wheel bench", timestep_s)
    geometry = wheel_geometry(model.robot.wheel_radius_m, model.robot.rollers_per_wheel)
    masses = robot_masses(model.robot)
    spin = masses.wheel_spin_inertia(geometry)
    mass = masses.hub.mass + geometry.rollers * masses.roller.mass
    body = spec.worldbody.add_body(name="wheel", pos=[0, 0, 2 * geometry.radius])
    # Nothing moves about the other two axes; any moments of a possible body will do.
    set_inertia(body, Inertia(mass, (spin, spin, spin)))
    body.add_joint(name="wheel", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
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


def _new_plant(
    model: Model, plant: PlantKind, name: str, timestep_s: float | None
) -> tuple[Model, mujoco.MjSpec]:
    """Return the model with its effects on numbers applied, and an empty spec for it."""
    model = changed_model(model, plant)
    spec = new_spec(name, fitting_timestep(model, timestep_s))
    prepare_drives(spec, model)
    return model, spec


def _begin(
    model: Model, plant: RobotPlant, name: str, timestep_s: float | None, visuals: bool
) -> tuple[Model, mujoco.MjSpec, mujoco.MjsBody]:
    """Return what `_new_plant` does, with the field and the robot's body "base", still without joints."""
    require_mecanum(model.robot, f"the plant {plant} is")
    model, spec = _new_plant(model, plant, name, timestep_s)
    add_scene(spec, visuals=visuals)
    base = spec.worldbody.add_body(name="base", pos=[0, 0, model.robot.wheel_radius_m])
    base.add_site(name="base", group=4)
    return model, spec, base


def _add_sensors(spec: mujoco.MjSpec) -> None:
    """Add the sensors that `robot_spec` lists."""
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
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="base")


SPECS: Final = {"robot.xml": robot_spec, "planar.xml": planar_spec, "bench.xml": bench_spec}
"""Name of an MJCF file -> the function that makes its spec."""


def mjcf_text(spec: mujoco.MjSpec) -> str:
    """Return a spec as MJCF whose numbers read back exactly; the spec is not changed.

    MuJoCo writes values that come from compilation with six digits: a sample period of 0.00833333 s would no
    longer be four steps of 0.00208333 s, and the law's ticks would drift against the physics. Values of the
    spec itself it writes with as many digits as needed.
    """
    compiled = spec.compiler.savecompiled
    spec.compiler.savecompiled = False
    try:
        return str(spec.to_xml())
    finally:
        spec.compiler.savecompiled = compiled


def left_out(model: Model) -> dict[str, str]:
    """Return file -> reason for the plants, robot.xml excepted, that cannot simulate the model's effects."""
    reasons = {}
    for name in ("planar.xml", "bench.xml"):
        try:
            SPECS[name](model, visuals=False)
        except EffectRefusedError as error:
            reasons[name] = str(error)
    return reasons


def write_models(model: Model, out: str | os.PathLike[str]) -> list[Path]:
    """Write robot.xml, planar.xml and bench.xml of a model into the folder `out`; return their paths.

    All but robot.xml are left out if their plant cannot simulate an effect; `left_out` says why.

    Raises:
        InputError: an effect that the robot on rollers cannot simulate, an impossible inertia, or a folder
            that cannot be written.
    """
    # All texts before the first file, so that bad input leaves nothing behind.
    omitted = left_out(model)
    texts = {name: mjcf_text(make(model)) for name, make in SPECS.items() if name not in omitted}
    with output_folder(out, "mecanum_env.mjcf", tuple(SPECS)) as staged:
        for name, text in texts.items():
            write_text(staged / name, text)
    return [Path(out) / name for name in texts]
