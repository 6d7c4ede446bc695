"""PPO's policy with a spread of the actions that depends on what is seen.

The learner: Stable-Baselines3's PPO or SAC with this run's numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import torch
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.vec_env import VecEnv

from training.train.settings import Settings

_LOG_STD: Final = (-4.0, 0.5)


class SeenSpreadPolicy(ActorCriticPolicy):  # type: ignore[misc]
    """A normal distribution whose standard deviation is one more output of the actor's network.

    An opening is offered only by a robot that is slow: noise that is large enough to find out how to evade a
    strike keeps it from ever being struck at. One spread for all states has to be one or the other.
    """

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.log_std_net = torch.nn.Linear(self.mlp_extractor.latent_dim_pi, self.action_space.shape[0])
        self.spread_anew(self.log_std_init)
        self.log_std.requires_grad_(False)
        learned = [parameter for parameter in self.parameters() if parameter.requires_grad]
        self.optimizer = self.optimizer_class(learned, lr=lr_schedule(1.0), **self.optimizer_kwargs)

    def spread_anew(self, log_std: float) -> None:
        """Give all states the same spread, with this logarithm log_std of the standard deviation."""
        torch.nn.init.zeros_(self.log_std_net.weight)
        torch.nn.init.constant_(self.log_std_net.bias, log_std)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        log_std = self.log_std_net(latent_pi).clamp(*_LOG_STD)
        # Not used again: Stable-Baselines3 logs it as train/std.
        self.log_std.data = log_std.detach().mean(dim=0)
        return self.action_dist.proba_distribution(self.action_net(latent_pi), log_std)


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
