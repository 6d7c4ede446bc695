"""The networks that PPO trains: who sees what, how actions are spread, and what the actor predicts."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import torch
from stable_baselines3.common.distributions import Distribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor

_LOG_STD_RANGE: Final = (-4.0, 0.5)


class ActorSeesLess(MlpExtractor):  # type: ignore[misc]
    """The hidden layers of an actor that sees only the first `seen` of the numbers that its critic sees."""

    def __init__(self, feature_dim: int, seen: int, *args: Any, **kwargs: Any) -> None:
        super().__init__(feature_dim, *args, **kwargs)
        self.seen = seen
        self.policy_net = MlpExtractor(seen, *args, **kwargs).policy_net

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return the last hidden layer of the actor for features, shape (n, all numbers)."""
        return self.policy_net(features[:, : self.seen])


class StateDependentStdPolicy(ActorCriticPolicy):  # type: ignore[misc]
    """PPO's policy with a standard deviation of the actions that is an output of the actor's network.

    The opponent strikes only at a slow robot, and noise that is large enough to discover evasions keeps the
    robot too fast to be struck at. One standard deviation for all states would have to be either.

    With `seen` the actor gets only the first `seen` numbers of an observation, and the critic all.
    """

    def __init__(self, *args: Any, seen: int | None = None, **kwargs: Any) -> None:
        self._seen = seen
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        if self._seen is None:
            super()._build_mlp_extractor()
            return
        self.mlp_extractor = ActorSeesLess(
            self.features_dim,
            self._seen,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    def _build(self, lr_schedule: Callable[[float], float]) -> None:
        super()._build(lr_schedule)
        self.log_std_net = torch.nn.Linear(self.mlp_extractor.latent_dim_pi, self.action_space.shape[0])
        self.reset_std(self.log_std_init)
        self.log_std.requires_grad_(False)
        learned = [parameter for parameter in self.parameters() if parameter.requires_grad]
        self.optimizer = self.optimizer_class(learned, lr=lr_schedule(1.0), **self.optimizer_kwargs)

    def reset_std(self, log_std: float) -> None:
        """Give all states the same standard deviation, exp(`log_std`)."""
        torch.nn.init.zeros_(self.log_std_net.weight)
        torch.nn.init.constant_(self.log_std_net.bias, log_std)

    def _get_action_dist_from_latent(self, latent_pi: torch.Tensor) -> Distribution:
        log_std = self.log_std_net(latent_pi).clamp(*_LOG_STD_RANGE)
        # Only read by Stable-Baselines3, which logs it as train/std.
        self.log_std.data = log_std.detach().mean(dim=0)
        return self.action_dist.proba_distribution(self.action_net(latent_pi), log_std)


class PredictingPolicy(StateDependentStdPolicy):
    """A policy whose actor also predicts what only its critic sees, from its last hidden layer.

    What the strike will do is in the last observations, but the reward says so once an episode. The
    prediction says it in every step, so the hidden layers learn sooner what to look for (M. Jaderberg et al.,
    "Reinforcement learning with unsupervised auxiliary tasks", ICLR 2017). A robot does not need it: it is
    not exported.

    PPO must weigh the entropy by 1: what this policy gives as its entropy is weighed already, and less the
    error of the prediction, which PPO thus adds to its loss.
    """

    def __init__(
        self, *args: Any, seen: int, entropy_weight: float, prediction_weight: float, **kwargs: Any
    ) -> None:
        self._entropy_weight, self._prediction_weight = entropy_weight, prediction_weight
        super().__init__(*args, seen=seen, **kwargs)

    def _build_mlp_extractor(self) -> None:
        super()._build_mlp_extractor()
        unseen = self.features_dim - self.mlp_extractor.seen
        self.prediction_net = torch.nn.Linear(self.mlp_extractor.latent_dim_pi, unseen)

    def evaluate_actions(
        self, obs: torch.Tensor, actions: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Return values (n, 1) at `obs`, log-probabilities of `actions` (n, 3), and what lowers the loss."""
        features = self.extract_features(obs)
        actor, critic = self.mlp_extractor(features)
        chosen = self._get_action_dist_from_latent(actor)
        unseen = features[:, self.mlp_extractor.seen :]
        error = torch.nn.functional.smooth_l1_loss(self.prediction_net(actor), unseen, reduction="none")
        gain = self._entropy_weight * chosen.entropy() - self._prediction_weight * error.mean(dim=1)
        return self.value_net(critic), chosen.log_prob(actions), gain
