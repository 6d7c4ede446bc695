"""PPO's policy with a spread of the actions that depends on what is seen."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import torch
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy

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
