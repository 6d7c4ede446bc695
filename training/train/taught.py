"""PPO with a teacher: a new policy first imitates a trained one, then goes on by itself.

The states are the student's own, with its noise, and the teacher says what it would have done in them
(S. Ross, G. Gordon and D. Bagnell, "A reduction of imitation learning and structured prediction to no-regret
online learning", AISTATS 2011). The critic learns the returns of the student all along.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.utils import obs_as_tensor
from stable_baselines3.common.vec_env import VecNormalize

from training.controllers.policy import Network

_TAUGHT_COUNT: Final = 1e6
"""Number of observations that a teacher's normalisation counts as: it must change slowly, or the weights
that go with it are wrong."""


class TaughtPpo(PPO):  # type: ignore[misc]
    """PPO that imitates a teacher until `teacher_steps` steps are done.

    The teacher must see no more observations than the student, and act in the same way. The first `features`
    numbers of an observation are not privileged. A student whose network has the shape of the teacher's may
    `begin_as` the teacher; then the critic alone learns meanwhile.
    """

    def __init__(
        self, *args: Any, teacher: Network, teacher_steps: int, features: int, **kwargs: Any
    ) -> None:
        self._teacher, self._teacher_steps = teacher, teacher_steps
        # The newest observations are the last of the features, and what is privileged follows them.
        first = features - teacher.stack * teacher.feature_count
        self._shown = slice(first, features + teacher.privileged)
        super().__init__(*args, **kwargs)

    def train(self) -> None:
        """Learn from the rollout: the teacher's actions, or by PPO."""
        if self.num_timesteps > self._teacher_steps:
            super().train()
            return
        self.policy.set_training_mode(True)
        self._update_learning_rate(self.policy.optimizer)
        errors = []
        for _ in range(self.n_epochs):
            for batch in self.rollout_buffer.get(self.batch_size):
                seen = self.get_env().unnormalize_obs(batch.observations.cpu().numpy())[:, self._shown]
                wanted = obs_as_tensor(self._teacher.actions(seen).astype(np.float32), self.device)
                acted = self.policy.get_distribution(batch.observations).distribution.mean
                value = self.policy.predict_values(batch.observations).flatten()
                error = torch.nn.functional.mse_loss(acted, wanted)
                loss = error + self.vf_coef * torch.nn.functional.mse_loss(batch.returns, value)
                self.policy.optimizer.zero_grad()
                loss.backward()
                torch.nn.utils.clip_grad_norm_(self.policy.parameters(), self.max_grad_norm)
                self.policy.optimizer.step()
                errors.append(error.item())
            self._n_updates += 1
        self.logger.record("train/imitation_error", float(np.mean(errors)))

    def begin_as(self, normaliser: VecNormalize) -> bool:
        """Give the actor the teacher's weights, and a `normaliser` its moments, if the shapes agree.

        Return whether they do. What is privileged stays as it is.
        """
        teacher, policy = self._teacher, self.policy
        layers = [*policy.mlp_extractor.policy_net, policy.action_net]
        linear = [layer for layer in layers if isinstance(layer, torch.nn.Linear)]
        if [tuple(layer.weight.shape) for layer in linear] != [weight.shape for weight in teacher.weights]:
            return False
        for layer, weight, bias in zip(linear, teacher.weights, teacher.biases, strict=True):
            layer.weight.data.copy_(torch.as_tensor(weight))
            layer.bias.data.copy_(torch.as_tensor(bias))
        moments, size = normaliser.obs_rms, len(teacher.mean)
        moments.mean[:size], moments.var[:size] = teacher.mean, teacher.scale**2
        moments.count = _TAUGHT_COUNT
        return True
