"""Several vector environments as one, so that different robots can be trained on side by side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None


class GroupVecEnv(VecEnv):  # type: ignore[misc]
    """The environments of several vector environments, one after the other.

    Args:
        groups: with the same spaces.
    """

    def __init__(self, groups: Sequence[VecEnv]) -> None:
        self.groups = list(groups)
        first = self.groups[0]
        self._ends = np.cumsum([group.num_envs for group in self.groups])
        super().__init__(int(self._ends[-1]), first.observation_space, first.action_space)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first observations."""
        starts = self._ends - [group.num_envs for group in self.groups]
        for group, start, end in zip(self.groups, starts, self._ends, strict=True):
            group._seeds = self._seeds[start:end]
        first = np.concatenate([group.reset() for group in self.groups])
        self.reset_infos = [info for group in self.groups for info in group.reset_infos]
        self._reset_seeds()
        self._reset_options()
        return first

    def step_async(self, actions: Array) -> None:
        """Take the actions of the next step, shape (num_envs, 3)."""
        for group, own in zip(self.groups, np.split(actions, self._ends[:-1]), strict=True):
            group.step_async(own)

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return observations, rewards, ends and infos."""
        observations, rewards, dones, infos = zip(*(group.step_wait() for group in self.groups), strict=True)
        joined = [info for group in infos for info in group]
        return np.concatenate(observations), np.concatenate(rewards), np.concatenate(dones), joined

    def close(self) -> None:
        """Close them all."""
        for group in self.groups:
            group.close()

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Return an attribute, by its attr_name, of each of the environments in indices."""
        values = [value for group in self.groups for value in group.get_attr(attr_name)]
        return [values[row] for row in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute, by its attr_name; it is common to all, whatever the indices."""
        for group in self.groups:
            group.set_attr(attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Indices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call the method method_name of all with method_args and method_kwargs; return those of indices."""
        results = [
            value
            for group in self.groups
            for value in group.env_method(method_name, *method_args, **method_kwargs)
        ]
        return [results[row] for row in self._get_indices(indices)]

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: Indices = None
    ) -> list[bool]:
        """Return whether a wrapper_class is inside, for each of the indices."""
        return [value for group in self.groups for value in group.env_is_wrapped(wrapper_class, indices)]
