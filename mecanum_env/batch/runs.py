"""One robot without slip through whole runs: the planar plant without MuJoCo, for fits that need thousands.

The plugin's library moves it (`mecanum_env/plugin/planar.c`) by the numbers of `PlanarRobot`, one run a call.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mecanum_env.batch.numbers import PlanarRobot, planar_robot
from mecanum_env.model import Model
from mecanum_env.plugin.library import planar_motion
from mecanum_env.simulator import Commands
from mecanum_env.simulator.body_limits import BodyLimits, limits_body
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import diverged
from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class PlanarPath:
    """How a robot moved, at the start and after each physics step."""

    time_s: FloatArray
    """Shape (n,)."""
    wheels_rpm: FloatArray
    """Wheel speeds fl, fr, rl, rr, shape (n, 4)."""
    twist: FloatArray
    """Velocity in the body's axes [m/s] and yaw rate [rad/s], shape (n, 3)."""
    pose: FloatArray
    """x [m], y [m], unwrapped yaw [rad] in the world, shape (n, 3)."""


class PlanarDrives:
    """A model on the planar plant, made ready once for several drives.

    The physics step has the upper bound `timestep_s` [s].

    Raises:
        InputError: an effect that the plant cannot simulate.
    """

    def __init__(self, model: Model, timestep_s: float) -> None:
        self._model, self._robot = model, planar_robot(model, timestep_s)
        self._drives = _rows_of(self._robot)
        self._limits = BodyLimits(model, self._robot.clocks.timestep_s) if limits_body(model) else None

    def drive(self, commands: Commands, duration_s: float, supply: Supply | None = None) -> PlanarPath:
        """Drive the robot from rest at the origin, as `mecanum_env.simulator.drive` does.

        Args:
            commands: command sequence, whose times count from the start.
            duration_s: how long to simulate [s]; rounded up to a whole physics step.
            supply: the supply's voltage; by default it stays what it is at the start.

        Raises:
            SimulationDivergedError: the state stopped being finite.
        """
        step = self._robot.clocks.timestep_s
        time_s: FloatArray = np.arange(math.ceil(duration_s / step - 1e-9) + 1, dtype=np.float64) * step
        ctrl = _sent(commands, len(time_s) - 1, step, self._model.wheel.command_quantum_rpm)
        if self._limits is not None:
            ctrl = self._limits.path(ctrl)
        lost = None if supply is None else supply.lost_at(time_s[:-1])
        pose, twist, speeds, reached = planar_motion(self._drives, self._robot.body, step, ctrl, lost)
        if reached < len(ctrl):
            raise diverged(float(time_s[reached]))
        return PlanarPath(time_s, speeds, twist, pose)


@lru_cache(maxsize=128)
def _sent(commands: Commands, steps: int, step_s: float, quantum_rpm: float) -> FloatArray:
    """Return the wheel commands [rpm] at each physics step, (steps, 4), read-only, since they are kept."""
    sent = commands.wheels_at(np.arange(steps, dtype=np.float64) * step_s, quantum_rpm)
    sent.flags.writeable = False
    return sent


def _rows_of(robot: PlanarRobot) -> FloatArray:
    """Return the parameters of a robot's drives with their programs, shape (4, P)."""
    programs = np.concatenate([np.asarray(program, float) for program in robot.programs.values()])
    return np.concatenate([robot.drives.T, np.tile(programs, (4, 1))], axis=1)
