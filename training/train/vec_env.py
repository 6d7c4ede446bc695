"""The native vector environments as Stable-Baselines3 sees them.

`TankendoVecEnv` adapts them, and `StackedVecEnv` gives a policy its features and its memory, and a critic
what it alone may see.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from mecanum_env.errors import InputError
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.features import EXTRA_FEATURES, features, stack_features
from training.train.privileged import PRIVILEGED, Privileged

Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None
_SAFE_M: Final = 0.15
"""Margin of a miss, or of a hit, beyond which more counts no more [m]: about half a target's size."""


class TankendoVecEnv(VecEnv):  # type: ignore[misc]
    """One or more `TankendoVectorEnv` as one environment of Stable-Baselines3.

    The info of an environment is empty except at the end of an episode, when it is that of the last step with
    `terminal_observation` and `TimeLimit.truncated`.

    Args:
        envs: native vector environments with the same spaces; their rows follow each other.
        margin_weight: weight of the margin by which a strike misses, which is added to the reward.

    Raises:
        InputError: an environment has another `autoreset_mode` than "SameStep".
    """

    def __init__(self, *envs: TankendoVectorEnv, margin_weight: float = 0.0) -> None:
        if any(env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP for env in envs):
            raise InputError('TankendoVecEnv needs a TankendoVectorEnv with autoreset_mode="SameStep"')
        self.envs, self._margin_weight = envs, margin_weight
        self._actions: Array | None = None
        spaces = envs[0].single_observation_space, envs[0].single_action_space
        super().__init__(sum(env.num_envs for env in envs), *spaces)

    def _rows(self) -> Iterator[tuple[TankendoVectorEnv, slice]]:
        """Yield each native environment with its rows."""
        start = 0
        for env in self.envs:
            yield env, slice(start, start + env.num_envs)
            start += env.num_envs

    def reset(self) -> Array:
        """Begin an episode in every environment; return the first observations."""
        # Stable-Baselines3 leaves None where no seed was given: the generators go on.
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        first = [env.reset(seed=None if seeds is None else seeds[rows])[0] for env, rows in self._rows()]
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return np.concatenate(first)

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next step, shape (num_envs, 3)."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return observations, rewards, ends and infos."""
        if self._actions is None:
            raise RuntimeError("step_wait() before step_async()")
        observations, rewards, dones = [], [], []
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for env, rows in self._rows():
            observation, reward, terminated, truncated, info = env.step(self._actions[rows])
            observations.append(observation)
            # A reset leaves these of the step as they are.
            margin = np.nan_to_num(env.arena.fighter.missed_m)
            shaped = reward + self._margin_weight * np.clip(margin / _SAFE_M, -1.0, 1.0)
            rewards.append(shaped.astype(np.float32))
            dones.append(terminated | truncated)
            for row in np.flatnonzero(dones[-1]).tolist():
                infos[rows.start + row] = {
                    **env.info_of(info["final_info"], row),
                    "terminal_observation": info["final_obs"][row],
                    "TimeLimit.truncated": bool(truncated[row]),
                }
        return np.concatenate(observations), np.concatenate(rewards), np.concatenate(dones), infos

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return the attribute `attr_name` of the environments with these indices."""
        return [getattr(env, attr_name) for env in self._envs_of(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set the attribute `attr_name` to a value in all batches that the indices belong to."""
        for env in self._envs_of(indices):
            setattr(env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call `method_name` with `method_args`, `method_kwargs`; return a result for each of the indices."""
        envs = self._envs_of(indices)
        found = {env: getattr(env, method_name)(*method_args, **method_kwargs) for env in dict.fromkeys(envs)}
        return [found[env] for env in envs]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Indices = None
    ) -> list[bool]:
        """Return False for each of the indices: no native environment is inside a `wrapper_class`."""
        return [False for _ in self._envs_of(indices)]

    def _envs_of(self, indices: Indices) -> list[TankendoVectorEnv]:
        """Return the native environment of each row in the indices."""
        of_row = [env for env in self.envs for _ in range(env.num_envs)]
        return [of_row[row] for row in self._get_indices(indices)]


class StackedVecEnv(VecEnvWrapper):  # type: ignore[misc]
    """Turns observations into the features of the last `stack` ones, oldest first, as `Policy` does.

    At the start of an episode the first observation is repeated. Stable-Baselines3's `VecFrameStack` would
    use zeros, which no sensor ever shows.

    Args:
        env: an environment with observations of shape (k,).
        stack: number of observations.
        has_time_to_cut: whether the features of an observation end with the time to the cut.
        privileged: whether the numbers of `training.train.privileged` follow, for the critic; `env` must then
            be a `TankendoVecEnv`.
    """

    def __init__(
        self, env: VecEnv, stack: int, *, has_time_to_cut: bool = False, privileged: bool = False
    ) -> None:
        features_of_one = env.observation_space.shape[0] + EXTRA_FEATURES + has_time_to_cut
        size = stack * features_of_one + privileged * PRIVILEGED
        super().__init__(env, gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32))
        self._stack, self._privileged = stack, privileged
        self._features = partial(features, has_time_to_cut=has_time_to_cut)
        self._memory: Array = np.zeros(0)
        self._watchers: list[Privileged] = []
        self._last: Array = np.zeros(0)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first features, shape (num_envs, stack * f + p)."""
        observation = self.venv.reset()
        self._memory = stack_features(None, self._features(observation), self._stack)
        if self._privileged:
            self._watchers = [Privileged(env.arena) for env in self.venv.envs]
        return self._with_privileged(self._memory)

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return features, rewards, ends and infos."""
        observation, reward, done, infos = self.venv.step_wait()
        newest = self._features(observation)
        memory = stack_features(self._memory, newest, self._stack)
        over = np.flatnonzero(done)
        if over.size:
            last = self._features(np.stack([infos[row]["terminal_observation"] for row in over.tolist()]))
            ended = stack_features(self._memory[over], last, self._stack)
            if self._privileged:
                # The episode's last privileged numbers are gone; only a time limit needs them.
                ended = np.concatenate([ended, self._last[over]], axis=-1)
            for row, seen in zip(over.tolist(), ended, strict=True):
                infos[row]["terminal_observation"] = seen
            memory[over] = stack_features(None, newest[over], self._stack)
        self._memory = memory
        return self._with_privileged(memory), reward, done, infos

    def _with_privileged(self, memory: Array) -> Array:
        if not self._privileged:
            return memory.astype(np.float32)
        self._last = np.concatenate([watcher.numbers() for watcher in self._watchers])
        return np.concatenate([memory, self._last], axis=-1, dtype=np.float32)
