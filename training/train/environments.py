"""The robots of `--randomize levels`: what a policy should still win with when the model is not the robot.

Stable-Baselines3's interface of the native vector environment; heavy: import it where training starts.

Several vector environments as one, so that different robots can be trained on side by side.

What a policy looks at, for Stable-Baselines3; the same lines as in the exported policy's controller.

The environments of a training run, as Stable-Baselines3 sees them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor, VecNormalize

from mecanum_env.errors import InputError
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.tankendo.actions import FULL_V_RPM
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.certify.plants import EXTRA_LATENCY_S, robot_level
from training.controllers.policy import ADDED, features, remember
from training.train.settings import Settings

HALF_LATENCY_S: Final = EXTRA_LATENCY_S / 2
"""A delay between none and that of a certificate [s]."""
HALF_CEILING: Final = 0.85
"""Ceiling of the robot between the model and the paper's, over the model's; soft over 40 rpm. Ours."""


def level_models(model: Model) -> dict[str, Model]:
    """Return the robots by name: the model itself, late, with the paper's losses, and in between.

    Args:
        model: what they are made from.
    """
    own = model.effects.get("command_latency", {}).get("delay_s", 0.0)
    ceiling = HALF_CEILING * min(model.wheel.saturation_rpm, FULL_V_RPM)
    return {
        "nominal": model,
        "a little late": model.with_effect("command_latency", delay_s=own + HALF_LATENCY_S),
        "late": model.with_effect("command_latency", delay_s=own + EXTRA_LATENCY_S),
        "a little slow": model.with_effect("speed_saturation", limit_rpm=ceiling, softness_rpm=40.0),
        "robot-level": robot_level(model),
    }


Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None


class TankendoVecEnv(VecEnv):  # type: ignore[misc]
    """`TankendoVectorEnv` for Stable-Baselines3; wrap it into `VecMonitor` to log episodes.

    An environment's info is empty but at its episode's end, when it has all of the last step's, with
    `terminal_observation` and `TimeLimit.truncated`.

    Args:
        env: the native vector environment, with `autoreset_mode="SameStep"`.

    Raises:
        InputError: an environment with another `autoreset_mode`.
    """

    def __init__(self, env: TankendoVectorEnv) -> None:
        if env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP:
            raise InputError('TankendoVecEnv needs a TankendoVectorEnv with autoreset_mode="SameStep"')
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
            infos[row] = self.env.info_of(info["final_info"], row)
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


CLIP: Final = 10.0
"""Largest absolute value of a normalised number."""
_SEEDS: Final = 2**40
"""Training's seeds are beyond this, so that no episode of an evaluation has been trained on."""


def model_of(settings: Settings) -> Model:
    """Return the model that is trained on, or around.

    Raises:
        InputError: no such file, or no model in it.
    """
    return paper_model() if settings.model is None else read_model(settings.model)


def bare_env(settings: Settings) -> VecEnv:
    """Return the environments with the policy's memory, but neither monitor nor normaliser."""
    arguments: dict[str, Any] = {
        "task": settings.task,
        "plant": settings.plant,
        "difficulty": settings.difficulty,
        "action_mode": settings.action_mode,
        "reward_weights": dict(settings.reward_weights),
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    model = model_of(settings)
    if settings.randomize == "levels":
        models = list(level_models(model).values())
        # As even as it goes, the first ones with one more.
        sizes = [len(part) for part in np.array_split(np.arange(settings.envs), len(models))]
        groups = [
            TankendoVecEnv(TankendoVectorEnv(size, model=one, **arguments))
            for one, size in zip(models, sizes, strict=True)
            if size
        ]
        env: VecEnv = GroupVecEnv(groups)
    else:
        native = TankendoVectorEnv(settings.envs, model=model, randomize=settings.randomize, **arguments)
        env = TankendoVecEnv(native)
    return StackedVecEnv(env, settings.stack)


def training_env(settings: Settings) -> VecNormalize:
    """Return the environments, monitored and normalised."""
    monitored = VecMonitor(bare_env(settings))
    return VecNormalize(monitored, gamma=settings.gamma, clip_obs=CLIP)


def seeds_at(settings: Settings, steps_done: int) -> list[int]:
    """Return the seed of each environment for the part of the training that begins after `steps_done`."""
    drawn = np.random.SeedSequence((settings.seed, steps_done)).generate_state(settings.envs)
    return [_SEEDS + int(number) for number in drawn]
