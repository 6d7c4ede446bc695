"""Stable-Baselines3's interface of the native vector environment; heavy: import it where training starts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

from mecanum_env.tankendo.vector import TankendoVectorEnv

Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None


class TankendoVecEnv(VecEnv):  # type: ignore[misc]
    """`TankendoVectorEnv` for Stable-Baselines3; wrap it into `VecMonitor` to log episodes.

    An environment's info is empty but at its episode's end, when it has all of the last step's, with
    `terminal_observation` and `TimeLimit.truncated`.

    Args:
        env: the native vector environment.
    """

    def __init__(self, env: TankendoVectorEnv) -> None:
        self.env = env
        self._actions: Array | None = None
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first observations."""
        # Without `seed` before, Stable-Baselines3 leaves None: the generators go on.
        seeds = self._seeds if any(seed is not None for seed in self._seeds) else None
        observation, _ = self.env.reset(seed=seeds)
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        self._reset_seeds()
        self._reset_options()
        return observation

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next step, shape (num_envs, 3)."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return observations, rewards, ends and infos."""
        if self._actions is None:
            raise RuntimeError("step_wait() before step_async()")
        observation, reward, terminated, truncated, info = self.env.step(self._actions)
        done = terminated | truncated
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row in np.flatnonzero(done).tolist():
            infos[row] = self.env.info_of(info, row)
            infos[row]["terminal_observation"] = info["final_obs"][row]
            infos[row]["TimeLimit.truncated"] = bool(truncated[row])
        return observation, reward.astype(np.float32), done, infos

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute, by its attr_name, of the environment, once for each of the indices."""
        return [getattr(self.env, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute, by its attr_name; it is common to all, whatever the indices."""
        setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call the method method_name with method_args and method_kwargs; repeat the result for indices."""
        result = getattr(self.env, method_name)(*method_args, **method_kwargs)
        return [result] * len(list(self._get_indices(indices)))

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Indices = None
    ) -> list[bool]:
        """Return False for each of the indices: no wrapper_class is inside the native environment."""
        return [False] * len(list(self._get_indices(indices)))
