"""A new random command every time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import action_to_command
from training.controllers.interface import Command


class RandomMotion:
    """Draws actions evenly, as `env.action_space.sample()` does.

    Args:
        seed: of its generator; each episode goes on with it.
    """

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)

    def reset(self) -> None:
        """Forget nothing: chance has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return a random command, whatever the observation."""
        v, theta, vc = action_to_command(self._rng.uniform(-1.0, 1.0, 3), "cartesian")
        return int(v), int(theta), int(vc)
