"""The environments of a training run, as Stable-Baselines3 sees them."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecMonitor, VecNormalize

from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.train.group import GroupVecEnv
from training.train.levels import level_models
from training.train.settings import Settings
from training.train.stack import StackedVecEnv
from training.vec_env import TankendoVecEnv

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
