"""Measures of a compiled robot: its motion against geometry, bounce, drift, energy and engine warnings.

Every function takes a model that `robot_spec` or `planar_spec` made for the plugin (ctrl in rpm).
`benchmarks/physics.py` and the tests use them; they work for any `model.json`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import mujoco
import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.mjcf.geometry import no_slip_rows
from mecanum_env.model import Robot
from mecanum_env.units import RAD_S_PER_RPM, FloatArray

Command = tuple[float, float, float]
"""V [rpm], theta [deg], VC [rpm]."""
_STRAIGHT_M: Final = 3.0
"""Length of a straight drive [m]."""


@dataclass(frozen=True)
class SteadyDrive:
    """A drive at a constant command, after it has settled."""

    ratio: float
    """Motion along the commanded twist, relative to ideal kinematics."""
    expected_ratio: float
    """The ratio that wheels with this number of rollers give on average (`geometry.no_slip_rows`)."""
    bounce_m: float
    """Root mean square of the base's height about its mean [m]."""


def start(mj_model: mujoco.MjModel, settle_s: float = 0.3) -> mujoco.MjData:
    """Return data in which the robot has sunk into its contacts for `settle_s`, with commands of zero."""
    data = mujoco.MjData(mj_model)
    mujoco.mj_step(mj_model, data, nstep=round(settle_s / mj_model.opt.timestep))
    return data


def settled_motion(
    mj_model: mujoco.MjModel, ctrl: npt.ArrayLike, seconds: float
) -> tuple[mujoco.MjData, FloatArray, FloatArray]:
    """Drive with one `ctrl` for 1 s, and return how the base moves in the `seconds` after it.

    That is its twist [m/s, m/s, rad/s], shape (n, 3), and its height [m], (n,), after each physics step; and
    the data at the end.
    """
    data = start(mj_model)
    data.ctrl[:] = ctrl
    mujoco.mj_step(mj_model, data, nstep=round(1.0 / mj_model.opt.timestep))
    steps = round(seconds / mj_model.opt.timestep)
    twists, heights = np.empty((steps, 3)), np.empty(steps)
    for i in range(steps):
        mujoco.mj_step(mj_model, data)
        twists[i] = [*data.sensor("base_velocity").data[:2], data.sensor("base_gyro").data[2]]
        heights[i] = data.body("base").xpos[2]
    return data, twists, heights


def steady_drive(
    mj_model: mujoco.MjModel, robot: Robot, command: Command, seconds: float = 3.0
) -> SteadyDrive:
    """Drive at one command for 1 s and average over the `seconds` after it."""
    _, twists, heights = settled_motion(mj_model, command_to_wheels(*command), seconds)
    ideal = command_to_twist(*command, robot)
    return SteadyDrive(
        ratio=float(twists.mean(axis=0) @ ideal / (ideal @ ideal)),
        expected_ratio=expected_ratio(robot, command),
        bounce_m=float(np.std(heights)),
    )


def expected_ratio(robot: Robot, command: Command) -> float:
    """Return the ratio that wheels with these rollers give on average in a drive at one command."""
    wheels = command_to_wheels(*command) * RAD_S_PER_RPM
    twist = np.linalg.lstsq(no_slip_rows(robot), wheels, rcond=None)[0]
    ideal = command_to_twist(*command, robot)
    return float(twist @ ideal / (ideal @ ideal))


def heading_drift_rad(mj_model: mujoco.MjModel, command: Command) -> float:
    """Return how far [rad] the robot has turned after a straight drive of 3 m with a command of VC 0."""
    data = start(mj_model)
    data.ctrl[:] = command_to_wheels(*command)
    begin = pose(data)
    while np.hypot(*(pose(data) - begin)[:2]) < _STRAIGHT_M:
        mujoco.mj_step(mj_model, data, nstep=20)
        if data.time > 60.0:
            raise ValueError(f"command {command} has not moved the robot {_STRAIGHT_M} m in a minute")
    return float((pose(data) - begin)[2])


def pose(data: mujoco.MjData) -> FloatArray:
    """Return x, y [m] and yaw [rad] of the base of a robot whose `xmat` is up to date, shape (3,)."""
    base = data.body("base")
    forward = base.xmat.reshape(3, 3)[:, 0]
    return np.array([base.xpos[0], base.xpos[1], np.arctan2(forward[1], forward[0])])


def random_commands(count: int, seed: int, v_rpm: float = 60.0, vc_rpm: float = 40.0) -> list[Command]:
    """Return a `count` of seeded random commands, uniform in V 0..v_rpm, any theta, VC -vc_rpm..vc_rpm."""
    rng = np.random.default_rng(seed)
    return [
        (float(rng.uniform(0, v_rpm)), float(rng.uniform(-180, 180)), float(rng.uniform(-vc_rpm, vc_rpm)))
        for _ in range(count)
    ]


def paper_like_commands(seed: int) -> list[tuple[float, Command]]:
    """Return ten seconds of random commands of a seed like the paper's, each with its hold time [s].

    Half are held long enough to settle (0.8 s), half are not (0.2 s), as in its random trials.
    """
    return [(0.8 if i % 2 else 0.2, command) for i, command in enumerate(random_commands(20, seed))]


def follow(mj_model: mujoco.MjModel, commands: list[tuple[float, Command]]) -> FloatArray:
    """Drive through commands from rest; return the poses, shape (n, 3), at the start and every 0.1 s.

    Commands follow each other, each with its hold time, a multiple of 0.1 s.
    """
    data = mujoco.MjData(mj_model)
    mujoco.mj_forward(mj_model, data)
    poses = [pose(data)]
    substeps = round(0.1 / mj_model.opt.timestep)
    for seconds, command in commands:
        data.ctrl[:] = command_to_wheels(*command)
        for _ in range(round(seconds / 0.1)):
            mujoco.mj_step(mj_model, data, nstep=substeps)
            poses.append(pose(data))
    return np.array(poses)


def path_difference(one: FloatArray, other: FloatArray) -> float:
    """Return the largest distance of the other path (n, 3) at equal times, over the length of one."""
    length = np.sum(np.hypot(*np.diff(one[:, :2], axis=0).T))
    return float(np.max(np.hypot(*(one - other)[:, :2].T)) / length)


def coast_energy(mj_model: mujoco.MjModel, command: Command, seconds: float = 2.0) -> FloatArray:
    """Return the energy [J] at every step, shape (steps,), while the robot coasts after a command."""
    data = start(mj_model)
    data.ctrl[:] = command_to_wheels(*command)
    mujoco.mj_step(mj_model, data, nstep=round(1.0 / mj_model.opt.timestep))
    free = mj_model.__copy__()
    free.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    free.opt.enableflags |= mujoco.mjtEnableBit.mjENBL_ENERGY
    energies = np.empty(round(seconds / free.opt.timestep))
    for i in range(len(energies)):
        mujoco.mj_step(free, data)
        energies[i] = data.energy.sum()
    return energies


def largest_rise(values: FloatArray) -> float:
    """Return the largest rise of a sequence of values (n,) above its running minimum."""
    return float(np.max(values - np.minimum.accumulate(values)))


def warnings_of(data: mujoco.MjData) -> dict[str, int]:
    """Return the MuJoCo warnings that were raised in a simulation, name -> count."""
    return {
        mujoco.mjtWarning(i).name: int(data.warning[i].number)
        for i in range(int(mujoco.mjtWarning.mjNWARNING))
        if data.warning[i].number
    }
