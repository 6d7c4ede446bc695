"""The learner: Stable-Baselines3's PPO or SAC with this run's numbers."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv

from training.train.exploration import SeenSpreadPolicy
from training.train.settings import Settings

_CLASSES: Final = {"ppo": PPO, "sac": SAC}
_ACTIVATIONS: Final = {"tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}


def make_agent(settings: Settings, env: VecEnv) -> BaseAlgorithm:
    """Return a learner with new weights, drawn from the settings' seed.

    Args:
        settings: of the run.
        env: what it learns in.
    """
    # More threads only wait for each other on networks this small.
    torch.set_num_threads(1)
    make = _ppo if settings.algo == "ppo" else _sac
    return make(settings, env)


def read_agent(settings: Settings, env: VecEnv, path: Path) -> BaseAlgorithm:
    """Return the learner of a checkpoint.

    Args:
        settings: of the run.
        env: what it learns in.
        path: the checkpoint's `agent.zip`.
    """
    torch.set_num_threads(1)
    # The schedule is made anew: stored, it is code of whatever version wrote it.
    fresh = {"learning_rate": _falling(*_rates(settings)), "lr_schedule": _falling(*_rates(settings))}
    return _CLASSES[settings.algo].load(path, env=env, device="cpu", custom_objects=fresh)


def _ppo(settings: Settings, env: VecEnv) -> PPO:
    own = settings.ppo
    return PPO(
        SeenSpreadPolicy,
        env,
        learning_rate=_falling(*_rates(settings)),
        n_steps=own.rollout_steps,
        batch_size=min(own.batch_size, own.rollout_steps * settings.envs),
        n_epochs=own.epochs,
        gamma=own.gamma,
        gae_lambda=own.gae_lambda,
        clip_range=own.clip_range,
        ent_coef=own.entropy_weight,
        policy_kwargs={
            "net_arch": {"pi": list(own.layers), "vf": list(own.layers)},
            "activation_fn": _ACTIVATIONS[own.activation],
            "log_std_init": own.log_std,
        },
        seed=settings.seed,
        device="cpu",
    )


def _sac(settings: Settings, env: VecEnv) -> SAC:
    own = settings.sac
    return SAC(
        "MlpPolicy",
        env,
        learning_rate=_falling(*_rates(settings)),
        batch_size=own.batch_size,
        buffer_size=own.buffer_size,
        learning_starts=own.learning_starts,
        train_freq=1,
        gradient_steps=own.updates_a_step,
        gamma=own.gamma,
        policy_kwargs={"net_arch": list(own.layers), "activation_fn": _ACTIVATIONS[own.activation]},
        seed=settings.seed,
        device="cpu",
    )


def _rates(settings: Settings) -> tuple[float, float]:
    own: Any = settings.ppo if settings.algo == "ppo" else settings.sac
    return own.learning_rate, own.last_learning_rate


def _falling(first: float, last: float) -> Callable[[float], float]:
    return lambda left: last + (first - last) * left
