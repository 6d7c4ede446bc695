"""What a policy looks at, for Stable-Baselines3; the same lines as in the exported policy's controller."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from training.controllers.features import ADDED, features
from training.controllers.policy import remember

Array = npt.NDArray[Any]


class StackedVecEnv(VecEnvWrapper):  # type: ignore[misc]
    """Observations become the features of the last `stack` ones, oldest first.

    At a start the first stands for those before. Stable-Baselines3's own `VecFrameStack` puts zeros there,
    which no sensor ever shows.

    Args:
        env: with observations (k,).
        stack: how many.
    """

    def __init__(self, env: VecEnv, stack: int) -> None:
        size = stack * (env.observation_space.shape[0] + ADDED)
        super().__init__(env, gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32))
        self._stack = stack
        self._memory: Array = np.zeros(0)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first observations, (num_envs, stack * (k + 1))."""
        self._memory = remember(None, features(self.venv.reset()), self._stack)
        return self._memory

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return observations, rewards, ends and infos."""
        observation, reward, done, infos = self.venv.step_wait()
        seen = features(observation)
        memory = remember(self._memory, seen, self._stack)
        for row in np.flatnonzero(done).tolist():
            last = features(infos[row]["terminal_observation"])
            infos[row]["terminal_observation"] = remember(self._memory[row], last, self._stack)
            memory[row] = remember(None, seen[row], self._stack)
        self._memory = memory
        return memory, reward, done, infos
