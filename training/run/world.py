"""What a robot in another process simulates: fights, one command period at a time, with samples within.

A robot's encoders are read more often than it takes commands, and a study of its logs needs them. Physics,
opponent and rules are those of the environment; only what the robot's own sensors show is added here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEEL_SPEEDS
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant
from mecanum_env.simulator.trajectory import read_trajectory
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.arena import TaskName
from mecanum_env.tankendo.env import TankendoEnv
from mecanum_env.tankendo.plant import Compiled, RobotBatch, compile_model
from mecanum_env.units import FloatArray
from training.drivers.interface import CHANNELS, Outcome, Sample

SAMPLES: Final = 4
"""Samples of the robot's own sensors in a command period."""
NOISE: Final[Mapping[str, float]] = {
    **dict.fromkeys(WHEEL_SPEEDS, 0.5),
    **{"vx_m_s": 0.005, "vy_m_s": 0.005, "yaw_rate_rad_s": 0.01},
    **{"x_m": 0.002, "y_m": 0.002, "yaw_rad": 0.002},
}
"""Standard deviation of the noise of encoders and motion capture, in the unit of each channel."""
_KEPT: Final = 15 * SAMPLES
"""Samples that a sensor effect sees: several times its longest delay or time constant."""


class World:
    """Fights of one robot, whose effects nobody outside knows, against the usual opponent.

    Raises:
        InputError: a model that the plant cannot simulate, or steps that do not divide into the samples.
    """

    def __init__(self, model: Model, plant: RobotPlant, task: TaskName, difficulty: str, seed: int) -> None:
        self._env = TankendoEnv(
            task=task, model=model, plant=plant, difficulty=difficulty, action_mode="command"
        )
        self._robot = _SampledRobot(compile_model(model, plant))
        self._env.arena.robots = self._robot
        self._rng = np.random.default_rng(seed)
        self.period_s = self._env.arena.step_s
        """Command period [s]."""
        self.outcome: Outcome = "ready"
        """How the present fight stands."""
        self.observation = np.zeros(self._env.observation_space.shape or (0,))
        """What the task's sensors show now, shape (k,)."""

    @property
    def observation_delay_s(self) -> float:
        """Age of the observation when it may be used [s]: how long before a command it is measured."""
        return self._env.arena.setting.sensors.delay_s

    def begin(self, seed: int) -> list[Sample]:
        """Begin the fight of a seed; return the sample of its start, at time 0."""
        seen, _ = self._env.reset(seed=seed)
        self.observation = np.asarray(seen, float)
        self.outcome = "fighting"
        return self._noisy(self._robot.read(1))

    def step(self, command: tuple[int, int, int]) -> list[Sample]:
        """Drive one command period; return its samples, the last one at its end.

        The command is V [rpm], theta [deg], VC [rpm].
        """
        seen, _, terminated, truncated, info = self._env.step(command_to_action(command))
        self.observation = np.asarray(seen, float)
        if terminated or truncated:
            self.outcome = "won" if info["is_success"] else "lost"
        return self._noisy(self._robot.read(SAMPLES))

    def _noisy(self, true: tuple[FloatArray, dict[str, FloatArray]]) -> list[Sample]:
        time_s, channels = true
        shown = np.array([channels[name] for name in CHANNELS]).T
        shown = shown + self._rng.standard_normal(shown.shape) * [NOISE[name] for name in CHANNELS]
        return [
            Sample(float(at), tuple(row)) for at, row in zip(time_s.tolist(), shown.tolist(), strict=True)
        ]


class _SampledRobot(RobotBatch):
    """One robot whose state is kept several times in a command period."""

    def __init__(self, compiled: Compiled) -> None:
        super().__init__(compiled, 1)
        self._mj_model = compiled.mj_model
        self._period_s = compiled.model.wheel.command_period_s
        if self._substeps % SAMPLES:
            raise InputError(
                f"{self._substeps} physics steps in a command period, must be a multiple of {SAMPLES}"
            )
        self._substeps //= SAMPLES
        self._states: list[tuple[float, FloatArray, FloatArray]] = []

    def restart_rows(self, rows: npt.NDArray[np.intp], poses: FloatArray, robots: Sequence[Compiled]) -> None:
        """Put the robot at rest at a pose, shape (3, 1), with the model of `robots`; `rows` is (0,)."""
        super().restart_rows(rows, poses, robots)
        self._states = []
        self._keep(0.0)

    def step(self, commands: FloatArray) -> None:
        """Simulate one command period with commands, shape (1, 3), and keep the states within it."""
        for _ in range(SAMPLES):
            super().step(commands)
            self._keep(self._states[-1][0] + self._period_s / SAMPLES)
        del self._states[:-_KEPT]

    def read(self, newest: int) -> tuple[FloatArray, dict[str, FloatArray]]:
        """Return times since the start [s] and what the model's sensors show of the newest samples."""
        time_s, qpos, qvel = (np.array(column) for column in zip(*self._states, strict=True))
        still = np.zeros((len(time_s), 3))
        clock = time_s - time_s[0]
        path = read_trajectory(self._mj_model, clock, qpos, qvel, still, self.model_of(0))
        channels = {name: values[-newest:] for name, values in path.channels_at(clock).items()}
        return time_s[-newest:], channels

    def _keep(self, at_s: float) -> None:
        self._states.append((at_s, self._qpos[0].copy(), self._qvel[0].copy()))
