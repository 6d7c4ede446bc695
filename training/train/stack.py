"""The last few observations as one, for Stable-Baselines3; the same lines as the exported policy's memory."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from training.controllers.policy import remember

Array = npt.NDArray[Any]


class StackedVecEnv(VecEnvWrapper):  # type: ignore[misc]
    """Observations become the last `stack` ones, oldest first; at a start the first stands for those before.

    Stable-Baselines3's own `VecFrameStack` puts zeros there, which no sensor ever shows.

    Args:
        env: with observations (k,).
        stack: how many.
    """

    def __init__(self, env: VecEnv, stack: int) -> None:
        space = env.observation_space
        low, high = np.tile(space.low, stack), np.tile(space.high, stack)
        super().__init__(env, gymnasium.spaces.Box(low, high, dtype=space.dtype))
        self._stack = stack
        self._memory: Array = np.zeros(0)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first observations, (num_envs, stack * k)."""
        self._memory = remember(None, self.venv.reset(), self._stack)
        return self._memory

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return observations, rewards, ends and infos."""
        observation, reward, done, infos = self.venv.step_wait()
        memory = remember(self._memory, observation, self._stack)
        for row in np.flatnonzero(done).tolist():
            last = infos[row]["terminal_observation"]
            infos[row]["terminal_observation"] = remember(self._memory[row], last, self._stack)
            memory[row] = remember(None, observation[row], self._stack)
        self._memory = memory
        return memory, reward, done, infos
