"""The environments of a training run, as Stable-Baselines3 sees them.

`TankendoVecEnv` adapts the native vector environments, `StackedVecEnv` gives the policy its features and its
memory, and `training_env` adds Stable-Baselines3's monitor and normaliser.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper, VecMonitor, VecNormalize

from mecanum_env.effects.apply import delayed
from mecanum_env.errors import InputError
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.tankendo import Opponents, opponent_for
from mecanum_env.tankendo.actions import FULL_V_RPM
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.certify.plants import EXTRA_LATENCY_S, robot_level
from training.controllers.policy import EXTRA_FEATURES, features, stack_features
from training.train.settings import TrainingSettings

_HALF_LATENCY_S: Final = EXTRA_LATENCY_S / 2
"""Extra latency of the robot "a little late" [s]: half of that in a certificate."""
_REDUCED_SPEED: Final = 0.85
"""Maximum wheel speed of the robot "a little slow", relative to the model's; this project's choice."""
_CLIP: Final = 10.0
"""Largest absolute value of a normalised observation."""
_FIRST_SEED: Final = 2**40
"""Training seeds are at least this, so that no evaluated episode has been trained on."""
Array = npt.NDArray[Any]
Indices = int | Sequence[int] | None


def level_models(model: Model) -> dict[str, Model]:
    """Return the robots of `--randomize levels` by name.

    They are the model itself, with latency, with the losses that the paper measured, and in between.
    """
    limit = _REDUCED_SPEED * min(model.wheel.saturation_rpm, FULL_V_RPM)
    return {
        "nominal": model,
        "a little late": delayed(model, _HALF_LATENCY_S),
        "late": delayed(model, EXTRA_LATENCY_S),
        "a little slow": model.with_effect("speed_saturation", limit_rpm=limit, softness_rpm=40.0),
        "robot-level": robot_level(model),
    }


class TankendoVecEnv(VecEnv):  # type: ignore[misc]
    """One or more `TankendoVectorEnv` as one environment of Stable-Baselines3.

    The info of an environment is empty except at the end of an episode, when it is that of the last step with
    `terminal_observation` and `TimeLimit.truncated`.

    Args:
        envs: native vector environments with the same spaces; their rows follow each other.

    Raises:
        InputError: an environment has another `autoreset_mode` than "SameStep".
    """

    def __init__(self, *envs: TankendoVectorEnv) -> None:
        if any(env.metadata["autoreset_mode"] is not AutoresetMode.SAME_STEP for env in envs):
            raise InputError('TankendoVecEnv needs a TankendoVectorEnv with autoreset_mode="SameStep"')
        self.envs = envs
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
            rewards.append(reward.astype(np.float32))
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
    """

    def __init__(self, env: VecEnv, stack: int) -> None:
        size = stack * (env.observation_space.shape[0] + EXTRA_FEATURES)
        super().__init__(env, gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32))
        self._stack = stack
        self._memory: Array = np.zeros(0)

    def reset(self) -> Array:
        """Begin an episode everywhere; return the first features, shape (num_envs, stack * (k + 1))."""
        self._memory = stack_features(None, features(self.venv.reset()), self._stack)
        return self._memory

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return features, rewards, ends and infos."""
        observation, reward, done, infos = self.venv.step_wait()
        newest = features(observation)
        memory = stack_features(self._memory, newest, self._stack)
        for row in np.flatnonzero(done).tolist():
            last = features(infos[row]["terminal_observation"])
            infos[row]["terminal_observation"] = stack_features(self._memory[row], last, self._stack)
            memory[row] = stack_features(None, newest[row], self._stack)
        self._memory = memory
        return memory, reward, done, infos


def model_of(settings: TrainingSettings) -> Model:
    """Return the model that is trained on or varied.

    Raises:
        InputError: there is no such file, or it holds no model.
    """
    return paper_model() if settings.model is None else read_model(settings.model)


def bare_env(settings: TrainingSettings) -> VecEnv:
    """Return the environments with the policy's memory, but without monitor and normaliser."""
    arguments: dict[str, Any] = {
        "task": settings.task,
        "plant": settings.plant,
        "difficulty": settings.difficulty,
        "opponent": Opponents(opponent_for(settings.difficulty)) if settings.opponents == "varied" else None,
        "senses": {"off": None, "usual": Senses(), "varied": VariedSenses()}[settings.senses],
        "action_mode": settings.action_mode,
        "reward_weights": dict(settings.reward_weights),
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }
    model = model_of(settings)
    if settings.randomize == "levels":
        models = list(level_models(model).values())
        # As evenly as possible; the first ones get one more.
        sizes = [len(part) for part in np.array_split(np.arange(settings.envs), len(models))]
        pairs = zip(models, sizes, strict=True)
        natives = [TankendoVectorEnv(size, model=one, **arguments) for one, size in pairs if size]
    else:
        natives = [TankendoVectorEnv(settings.envs, model=model, randomize=settings.randomize, **arguments)]
    return StackedVecEnv(TankendoVecEnv(*natives), settings.stack)


def training_env(settings: TrainingSettings) -> VecNormalize:
    """Return the environments with monitor and normaliser."""
    return VecNormalize(VecMonitor(bare_env(settings)), gamma=settings.gamma, clip_obs=_CLIP)


def episode_seeds(settings: TrainingSettings, steps_done: int) -> list[int]:
    """Return the seed of each environment for the part of the training that begins after `steps_done`."""
    drawn = np.random.SeedSequence((settings.seed, steps_done)).generate_state(settings.envs)
    return [_FIRST_SEED + int(number) for number in drawn]
