"""A robot that is driven while its effects are switched on and off."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from mecanum_env.kinematics import command_to_wheels, round_command
from mecanum_env.model import Model
from mecanum_env.simulator.body_limits import BodyLimits, limits_body
from mecanum_env.simulator.robot import RobotPlant, at_rest, compile_plant
from mecanum_env.simulator.trajectory import read_trajectory, step_through
from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class Motion:
    """What the robot has done in a slice of time."""

    time_s: FloatArray
    """Times of the samples [s], shape (n,)."""
    sent_rpm: FloatArray
    """Wheel speeds that the command asked for [rpm], in the order fl, fr, rl, rr, shape (n, 4)."""
    wheels_rpm: FloatArray
    """Actual wheel speeds [rpm], shape (n, 4)."""
    twist: FloatArray
    """Velocity in the body frame at the end: vx, vy [m/s], yaw rate [rad/s], shape (3,)."""
    pose: FloatArray
    """Pose in the world at the end: x, y [m], yaw [rad], shape (3,)."""


class LiveRobot:
    """A simulated robot on a plant, from rest at the origin; its model may change while it drives."""

    def __init__(self, model: Model, plant: RobotPlant = "rollers") -> None:
        self._plant: RobotPlant = plant
        self._compile(model)
        self._data = at_rest(self.mj_model)

    def _compile(self, model: Model) -> None:
        # Nothing is changed before the new model has been compiled, which may refuse it.
        compiled = compile_plant(model, self._plant)
        limits = BodyLimits(model, compiled.opt.timestep) if limits_body(model) else None
        self._model, self.mj_model, self._limits = model, compiled, limits

    @property
    def qpos(self) -> FloatArray:
        """MuJoCo's generalised positions now, shape (nq,)."""
        return np.array(self._data.qpos)

    @property
    def time_s(self) -> float:
        """Simulated time since the last reset [s]."""
        return float(self._data.time)

    def reset(self) -> None:
        """Put the robot at rest at the origin, at time 0."""
        self._compile(self._model)
        self._data = at_rest(self.mj_model)

    def change(self, model: Model) -> None:
        """Go on as another model, in the present motion; the drives keep what they remember.

        Limits of the robot's command as a whole start from rest.

        Raises:
            InputError: the plant cannot simulate the model; the robot goes on as before.
        """
        before = self._data
        self._compile(model)
        fresh = mujoco.MjData(self.mj_model)
        if fresh.qpos.size != before.qpos.size or fresh.plugin_state.size != before.plugin_state.size:
            # An effect of one's own may add joints; there is no motion to go on with.
            self._data = at_rest(self.mj_model)
            return
        fresh.time = before.time
        for name in ("qpos", "qvel", "qacc_warmstart", "plugin_state", "userdata"):
            getattr(fresh, name)[:] = getattr(before, name)
        mujoco.mj_forward(self.mj_model, fresh)
        self._data = fresh

    def advance(self, command: tuple[float, float, float], seconds: float, samples: int = 3) -> Motion:
        """Simulate some seconds, rounded up to a physics step, with a command that is sent throughout.

        The command is (V [rpm], theta [deg], VC [rpm]); the drives latch it every `command_period_s`. The
        motion is returned at about this number of `samples`.

        Raises:
            SimulationDivergedError: the state stopped being finite or plausible.
        """
        steps = max(1, math.ceil(seconds / self.mj_model.opt.timestep - 1e-9))
        sent = command_to_wheels(*round_command(*command, self._model.wheel.command_quantum_rpm))
        ctrl = np.tile(sent, (steps, 1))
        if self._limits is not None:
            ctrl = np.array([self._limits.step(sent) for _ in range(steps)])
        start = self.time_s
        qpos, qvel = step_through(self.mj_model, self._data, ctrl)
        rows = np.unique(np.linspace(0, steps, samples + 1).round().astype(int))[1:]
        time_s = start + rows * self.mj_model.opt.timestep
        commands = np.tile(np.array(command), (rows.size, 1))
        path = read_trajectory(self.mj_model, time_s, qpos[rows], qvel[rows], commands)
        return Motion(time_s, np.tile(sent, (rows.size, 1)), path.wheels_rpm, path.twist[-1], path.pose[-1])
