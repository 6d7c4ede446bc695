"""Standing still."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from training.controllers.interface import Command


class Still:
    """Never moves."""

    def reset(self) -> None:
        """Forget the episode."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command to stand, whatever the observation."""
        return 0, 0, 0
