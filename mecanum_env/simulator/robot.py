"""Driving the robot, on rollers or as the fast planar plant, through a sequence or one command at a time."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from typing import Final

import mujoco
import numpy as np

from mecanum_env.effects.apply import check_effects
from mecanum_env.effects.definition import RobotPlant as RobotPlant
from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS, command_to_wheels, round_command
from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.model import Model
from mecanum_env.simulator.body_limits import BodyLimits, behind_limits, limits_body
from mecanum_env.simulator.commands import Commands
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import Trajectory, read_trajectory, step_through
from mecanum_env.units import FloatArray

_MOST_BYTES: Final = 2 << 30
"""Most memory for the states of one drive [bytes]."""


def compile_plant(
    model: Model, plant: RobotPlant = "rollers", timestep_s: float | None = None, *, visuals: bool = True
) -> mujoco.MjModel:
    """Compile the robot for commands that are already rounded and limited.

    V, theta and VC are rounded before the kinematics, so the wheel actuators do not round again. The effects
    that limit the robot's command as a whole are left to `BodyLimits`, since a wheel's drive cannot apply
    them. The plant "rollers" has 45-degree rollers on a floor; the wheels of "planar", which is much faster,
    never slip. The physics step has the upper bound `timestep_s`, 1/480 s when None; `visuals` includes what
    is only seen.

    Raises:
        InputError: an effect that the plant cannot simulate, or an impossible inertia.
    """
    return plant_spec(model, plant, timestep_s, visuals=visuals).compile()


def plant_spec(
    model: Model, plant: RobotPlant = "rollers", timestep_s: float | None = None, *, visuals: bool = True
) -> mujoco.MjSpec:
    """Return what `compile_plant` compiles for a model, plant and the same `visuals`, as a spec.

    Raises:
        InputError: an effect that the plant cannot simulate, or an impossible inertia.
    """
    check_effects(model, plant)
    spec = robot_spec if plant == "rollers" else planar_spec
    return spec(behind_limits(model), timestep_s, wheel_quantum=False, visuals=visuals)


def drive(
    model: Model,
    commands: Commands,
    duration_s: float,
    *,
    plant: RobotPlant = "rollers",
    timestep_s: float | None = None,
    mj_model: mujoco.MjModel | None = None,
    stance: FloatArray | None = None,
    supply: Supply | None = None,
    data: mujoco.MjData | None = None,
) -> Trajectory:
    """Drive the robot from rest at the origin through commands and return every physics step.

    Args:
        model: wheel, robot and effects.
        commands: command sequence, whose times count from the start.
        duration_s: how long to simulate [s]; rounded up to a whole physics step.
        plant: "rollers" or "planar".
        timestep_s: upper bound of the physics step [s]; 1/480 s when None.
        mj_model: the result of `compile_plant` with the same arguments, to save compiling.
        stance: `standing` of the compiled model, to save settling on the floor, or to turn the wheels.
        supply: the supply's voltage; by default it stays what it is at the start.
        data: what to simulate in, of the compiled model and in any state, to save making it.

    Raises:
        InputError: an effect that the plant cannot simulate, or a duration that is not a number above 0.
        SimulationDivergedError: the state stopped being finite.
    """
    if not (math.isfinite(duration_s) and duration_s > 0.0):
        raise InputError(f"duration_s = {duration_s}, must be a number of seconds above 0")
    compiled = compile_plant(model, plant, timestep_s) if mj_model is None else mj_model
    data = at_rest(compiled, stance=stance, data=data)
    step = compiled.opt.timestep
    size = duration_s / step * (compiled.nq + compiled.nv) * 8.0
    if size > _MOST_BYTES:
        longest = duration_s * _MOST_BYTES / size
        raise InputError(
            f"duration_s = {duration_s:g}: the states of every physics step would take {size / 2**30:.3g} "
            f"GiB, must be at most {longest:.0f} s; drive in parts"
        )
    time_s = np.arange(math.ceil(duration_s / step - 1e-9) + 1) * step
    ctrl = commands.wheels_at(time_s[:-1], model.wheel.command_quantum_rpm)
    if limits_body(model):
        ctrl = BodyLimits(model, step).path(ctrl)
    lost = None if supply is None else supply.lost_at(time_s[:-1])
    qpos, qvel = step_through(compiled, data, ctrl, lost_v=lost)
    return read_trajectory(compiled, time_s, qpos, qvel, commands.at(time_s), model)


def at_rest(
    mj_model: mujoco.MjModel,
    turned_rad: Sequence[float] = (),
    stance: FloatArray | None = None,
    data: mujoco.MjData | None = None,
) -> mujoco.MjData:
    """Return data in which the robot, or another model, stands still, drives at rest, at time 0.

    It has the positions of a `stance`, shape (nq,); None: those of `standing`, with `turned_rad` as there.
    It is the `data` given, which are reset; new ones by default.
    """
    if data is None:
        data = mujoco.MjData(mj_model)
    else:
        mujoco.mj_resetData(mj_model, data)
    data.qpos[:] = standing(mj_model, turned_rad) if stance is None else stance
    mujoco.mj_forward(mj_model, data)
    return data


def standing(mj_model: mujoco.MjModel, turned_rad: Sequence[float] = ()) -> FloatArray:
    """Return MuJoCo's generalised positions, shape (nq,), of the robot that has settled on the floor.

    The four wheels are turned by angles [rad], 0 by default, which decide what rollers touch the floor; the
    planar plant's wheels have none.
    """
    stance = np.array(mj_model.qpos0)
    for wheel, angle in zip(WHEELS, turned_rad, strict=False):
        stance[mj_model.joint(f"wheel_{wheel}").qposadr] = angle
    if mj_model.joint(0).type[0] != mujoco.mjtJoint.mjJNT_FREE:
        return stance
    if np.any(mj_model.opt.gravity[:2] != 0.0):
        # On a slope the robot would creep while it settles, so it settles on level ground.
        level = copy.copy(mj_model)
        level.opt.gravity[:] = 0.0, 0.0, -np.linalg.norm(mj_model.opt.gravity)
        return standing(level, turned_rad)
    # In half a second the rollers sink into the floor by some micrometres and come to rest.
    data = mujoco.MjData(mj_model)
    data.qpos[:] = stance
    mujoco.mj_step(mj_model, data, math.ceil(0.5 / mj_model.opt.timestep))
    return np.array(data.qpos)


class RobotSession:
    """A simulated robot that is driven one command at a time, as a controller does.

    The plant is "rollers" or "planar"; the physics step has the upper bound `timestep_s` [s], 1/480 s when
    None.
    """

    def __init__(self, model: Model, plant: RobotPlant = "rollers", timestep_s: float | None = None) -> None:
        self._model = model
        self._mj_model = compile_plant(model, plant, timestep_s)
        self._substeps = round(model.wheel.command_period_s / self._mj_model.opt.timestep)
        self.reset()

    def reset(self) -> None:
        """Put the robot at rest at the origin and forget what was driven."""
        self._data = at_rest(self._mj_model)
        limited = limits_body(self._model)
        self._limits = BodyLimits(self._model, self._mj_model.opt.timestep) if limited else None
        # time, qpos, qvel and command at each physics step
        self._rows: list[tuple[float, FloatArray, FloatArray, FloatArray]] = []
        self._record(np.zeros(3))

    @property
    def time_s(self) -> float:
        """Time since the reset [s]."""
        return float(self._data.time)

    @property
    def pose(self) -> FloatArray:
        """World pose x [m], y [m], yaw [rad] within +-pi, shape (3,)."""
        x, y, yaw = self._read(self._rows[-1:]).pose[0]
        return np.array([x, y, np.arctan2(np.sin(yaw), np.cos(yaw))])

    def advance(self, v_rpm: float, theta_deg: float, vc_rpm: float) -> None:
        """Send one command and simulate one command period (0.1 s for the paper's robot).

        The command is wheel speed V [rpm], direction of travel theta [deg] (0 forward, 90 left) and turning
        speed VC [rpm] (counter-clockwise positive).
        """
        quantum = self._model.wheel.command_quantum_rpm
        wheels = command_to_wheels(*round_command(v_rpm, theta_deg, vc_rpm, quantum))
        command = np.array([v_rpm, theta_deg, vc_rpm])
        for _ in range(self._substeps):
            self._data.ctrl[:] = wheels if self._limits is None else self._limits.step(wheels)
            mujoco.mj_step(self._mj_model, self._data)
            self._record(command)

    def trajectory(self) -> Trajectory:
        """Return everything driven since the reset, one row per physics step."""
        return self._read(self._rows)

    def _record(self, command: FloatArray) -> None:
        data = self._data
        self._rows.append((data.time, data.qpos.copy(), data.qvel.copy(), command))

    def _read(self, rows: list[tuple[float, FloatArray, FloatArray, FloatArray]]) -> Trajectory:
        time_s, qpos, qvel, command = (np.array(column) for column in zip(*rows, strict=True))
        return read_trajectory(self._mj_model, time_s, qpos, qvel, command, self._model)
