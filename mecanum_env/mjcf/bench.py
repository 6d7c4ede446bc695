"""The bench: one wheel off the floor, as when its response is measured."""

from __future__ import annotations

import mujoco

from mecanum_env.effects.apply import change_spec, changed_model
from mecanum_env.mjcf.drive import Drive, add_drive, prepare_drives
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.mjcf.masses import Inertia, robot_masses
from mecanum_env.mjcf.physics import fitting_timestep, new_spec
from mecanum_env.mjcf.scene import add_appearance, add_bench_view
from mecanum_env.mjcf.wheel import set_inertia
from mecanum_env.mjcf.wheel_look import dress_bench
from mecanum_env.model import Model
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT


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
