"""Rollouts that lie on the learner's device while it learns."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples


class RolloutOnDevice(RolloutBuffer):  # type: ignore[misc]
    """A rollout that is copied to the device once, and not a minibatch at a time."""

    def reset(self) -> None:
        """Forget the rollout."""
        self._whole: list[torch.Tensor] | None = None
        super().reset()

    def _get_samples(self, batch_inds: npt.NDArray[np.intp]) -> RolloutBufferSamples:
        if self._whole is None:
            # Stable-Baselines3 has made one row of each step before it asks for the first minibatch.
            single = self.values, self.log_probs, self.advantages, self.returns
            arrays = self.observations, self.actions, *(each.flatten() for each in single)
            self._whole = [torch.as_tensor(each, dtype=torch.float32).to(self.device) for each in arrays]
        rows = torch.as_tensor(batch_inds, device=self.device)
        return RolloutBufferSamples(*(each[rows] for each in self._whole))
