"""The package's own robot, changed by hand: in its MuJoCo model, its commands and its logged values.

No code of the effects is used for the changes, but the robot below them is the one that is tested. So these
logs show that the workflow still finds what it found, and not how well it does on other robots.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from mecanum_env.mjcf import robot_spec
from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray

WHEELS = ("fl", "fr", "rl", "rr")
SAMPLE_S = 0.01
COMMAND_S = 0.1
NOISE = {f"speed_{wheel}_rpm": 0.5 for wheel in WHEELS} | {
    "vx_m_s": 0.005,
    "vy_m_s": 0.005,
    "yaw_rate_rad_s": 0.01,
}
"""Logged channel -> standard deviation of its noise, in the channel's unit."""
RPM = math.pi / 30.0


@dataclass(frozen=True)
class Changes:
    """What is done to the robot; each field's default is nothing."""

    roller_drag_n_m: float = 0.0
    """Coulomb friction of every roller's bearing."""
    load_kg: float = 0.0
    """A ball of 8 cm, 0.2 m above the floor."""
    grip: float = 0.8
    arms: float = 1.0
    """Half wheelbase and half track, over the model's."""
    weak_front_left: float = 1.0
    """Share of its command that this wheel follows."""
    wheel_top_rpm: float = 135.0
    turned_deg: float = 0.0
    """Of the sensor of the body's velocity, to the left."""
    log_late_s: float = 0.0
    wind_n: float = 0.0
    """A force that swings along the world's x at 0.7 Hz; no effect of the catalogue."""


def nominal() -> Model:
    """Return the model whose robot is changed."""
    return paper_model()


def simulate(
    changes: Changes, commands: FloatArray, rngs: list[np.random.Generator]
) -> tuple[FloatArray, list[dict[str, FloatArray]]]:
    """Return sample times (n,) [s] and, for each repeat, channel -> samples (n,), with noise.

    Each repeat is driven anew: its wheels start turned by some hundredths of a radian, as no robot is put
    down twice alike.

    Args:
        changes: what is done to the robot.
        commands: (m, 3), V [rpm], theta [deg], VC [rpm], one row per 0.1 s.
        rngs: one a repeat.
    """
    robot = _compiled(changes)
    step = robot.opt.timestep
    clock = np.arange(round(len(commands) * COMMAND_S / step) + 1) * step
    time_s = np.arange(math.floor(clock[-1] / SAMPLE_S + 1e-9) + 1) * SAMPLE_S
    wheels = _wheel_commands(changes, commands)[np.floor(clock[:-1] / COMMAND_S + 1e-6).astype(int)]
    logged = []
    for rng in rngs:
        true = _channels(changes, robot, *_driven(robot, changes, wheels, 0.01 * rng.standard_normal(4)))
        seen = {name: np.interp(time_s - changes.log_late_s, clock, values) for name, values in true.items()}
        logged.append({n: v + NOISE[n] * rng.standard_normal(time_s.size) for n, v in seen.items()})
    return time_s, logged


def _compiled(changes: Changes) -> mujoco.MjModel:
    """Return the changed robot, which takes a new wheel command at every step."""
    model = nominal()
    body = model.robot
    wider = replace(
        body,
        half_wheelbase_m=body.half_wheelbase_m * changes.arms,
        half_track_m=body.half_track_m * changes.arms,
    )
    spec = robot_spec(replace(model, robot=wider), wheel_quantum=False, visuals=False)
    if changes.roller_drag_n_m:
        for joint in spec.joints:
            if "_roller_" in joint.name:
                joint.frictionloss = changes.roller_drag_n_m
                # Stiff, so that a roller below its friction stands still.
                joint.solref_friction = [0.005, 1.0]
                joint.solimp_friction = [0.998, 0.9999, 0.001, 0.5, 2.0]
    if changes.load_kg:
        load = spec.body("base").add_body(name="load", pos=[0.0, 0.0, 0.2 - body.wheel_radius_m])
        load.explicitinertial = True
        load.mass, load.ipos = changes.load_kg, [0.0, 0.0, 0.0]
        load.inertia = [0.4 * changes.load_kg * 0.08**2] * 3
    for pair in spec.pairs:
        pair.friction[0] = pair.friction[1] = changes.grip
    made = spec.compile()
    # The plugin's own command period and the whole numbers of its commands.
    made.actuator_dynprm[:, 7] = made.opt.timestep
    made.actuator_dynprm[:, 9] = 0.0
    return made


def _wheel_commands(changes: Changes, commands: FloatArray) -> FloatArray:
    """Return the wheel commands [rpm] of body commands (m, 3), shape (m, 4)."""
    v, theta, vc = commands.T
    x, y = v * np.cos(np.radians(theta)), v * np.sin(np.radians(theta))
    wheels = np.stack([x - y - vc, x + y + vc, x + y - vc, x - y + vc], axis=1)
    wheels[:, 0] *= changes.weak_front_left
    return np.clip(wheels, -changes.wheel_top_rpm, changes.wheel_top_rpm)


def _driven(
    robot: mujoco.MjModel, changes: Changes, wheels: FloatArray, turned_rad: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Settle with the wheels turned, drive; return qpos and qvel at every step, the start included."""
    data = mujoco.MjData(robot)
    for wheel, angle in zip(WHEELS, turned_rad, strict=True):
        data.qpos[robot.joint(f"wheel_{wheel}").qposadr[0]] = angle
    mujoco.mj_step(robot, data, round(0.6 / robot.opt.timestep))
    standing = data.qpos.copy()
    mujoco.mj_resetData(robot, data)
    data.qpos[:] = standing
    mujoco.mj_forward(robot, data)
    qpos, qvel = np.empty((len(wheels) + 1, robot.nq)), np.empty((len(wheels) + 1, robot.nv))
    qpos[0], qvel[0] = data.qpos, data.qvel
    base = robot.body("base").id
    for k, command in enumerate(wheels):
        data.ctrl[:] = command
        data.xfrc_applied[base, 0] = changes.wind_n * math.sin(2 * math.pi * 0.7 * k * robot.opt.timestep)
        mujoco.mj_step(robot, data)
        qpos[k + 1], qvel[k + 1] = data.qpos, data.qvel
    return qpos, qvel


def _channels(
    changes: Changes, robot: mujoco.MjModel, qpos: FloatArray, qvel: FloatArray
) -> dict[str, FloatArray]:
    """Return what the sensors would log, without noise, at every step."""
    w, x, y, z = qpos[:, 3:7].T
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) + math.radians(changes.turned_deg)
    speeds = {f"speed_{w}_rpm": qvel[:, robot.joint(f"wheel_{w}").dofadr[0]] / RPM for w in WHEELS}
    return speeds | {
        "vx_m_s": np.cos(yaw) * qvel[:, 0] + np.sin(yaw) * qvel[:, 1],
        "vy_m_s": np.cos(yaw) * qvel[:, 1] - np.sin(yaw) * qvel[:, 0],
        "yaw_rate_rad_s": qvel[:, 5],
    }
