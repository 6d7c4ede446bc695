"""Driving the robot one command at a time, as a controller does."""

from __future__ import annotations

import mujoco
import numpy as np

from mecanum_env.kinematics import command_to_wheels, round_command
from mecanum_env.model import Model
from mecanum_env.simulator.body_limits import BodyLimits, limits_body
from mecanum_env.simulator.robot import Plant, at_rest, compile_plant
from mecanum_env.simulator.trajectory import Trajectory, read_trajectory
from mecanum_env.units import FloatArray

_Row = tuple[float, FloatArray, FloatArray, FloatArray]


class RobotSession:
    """The robot between two commands.

    Args:
        model: wheel, robot and effects.
        plant: "rollers" or "planar".
        timestep_s: upper bound of the physics step [s].
    """

    def __init__(self, model: Model, plant: Plant = "rollers", timestep_s: float | None = None) -> None:
        self._model = model
        self._compiled = compile_plant(model, plant, timestep_s)
        self._steps = round(model.wheel.command_period_s / self._compiled.opt.timestep)
        self.reset()

    def reset(self) -> None:
        """Put the robot at rest at the origin and forget what was driven."""
        self._data = at_rest(self._compiled)
        self._rows = [self._row(np.zeros(3))]
        limited = limits_body(self._model)
        self._limits = BodyLimits(self._model, self._compiled.opt.timestep) if limited else None

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

        Args:
            v_rpm: wheel speed V [rpm].
            theta_deg: direction theta [deg], 0 forward, 90 left.
            vc_rpm: turning speed VC [rpm], counter-clockwise positive.
        """
        quantum = self._model.wheel.command_quantum_rpm
        wheels = command_to_wheels(*round_command(v_rpm, theta_deg, vc_rpm, quantum))
        command = np.array([v_rpm, theta_deg, vc_rpm])
        for _ in range(self._steps):
            self._data.ctrl[:] = wheels if self._limits is None else self._limits.step(wheels)
            mujoco.mj_step(self._compiled, self._data)
            self._rows.append(self._row(command))

    def trajectory(self) -> Trajectory:
        """Return everything driven since the reset, one row a physics step."""
        return self._read(self._rows)

    def _read(self, rows: list[_Row]) -> Trajectory:
        time_s, qpos, qvel, command = (np.array(column) for column in zip(*rows, strict=True))
        return read_trajectory(self._compiled, time_s, qpos, qvel, command, self._model)

    def _row(self, command: FloatArray) -> _Row:
        data = self._data
        return data.time, data.qpos.copy(), data.qvel.copy(), command
