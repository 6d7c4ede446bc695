"""Made-up episodes, and a controller that shows whatever it sees."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from training.evaluate import Recording


class Echo:
    """Commands that depend on every number of the observation and on the last command."""

    def reset(self) -> None:
        """Forget the last command."""
        self._last = 0

    def act(self, observation: np.ndarray) -> tuple[int, int, int]:
        """Return a slow command out of the observation's digits."""
        digits = int(np.sum(np.round(1e4 * observation.astype(float)))) + self._last
        self._last = digits % 29
        return digits % 30, digits % 180, digits % 11 - 5


@pytest.fixture
def echo() -> Callable[..., Any]:
    """Return a maker of such controllers."""

    def make(*_) -> Echo:
        controller = Echo()
        controller.reset()
        return controller

    return make


@pytest.fixture
def recording() -> Callable[..., Recording]:
    """Return a maker of successful episodes from distances [m], at rest and facing by default."""

    def make(distance_m, **columns: Any) -> Recording:
        n = len(distance_m)
        usual = {
            "time_s": 0.1 * np.arange(n),
            "distance_m": np.array(distance_m, float),
            "bearing_rad": np.zeros(n),
            "commands": np.zeros((n, 3)),
            "actual": np.zeros((n, 3)),
            "guarded": np.ones(n),
            "reward": np.zeros(n),
        }
        return Recording(0, True, "", "men", 0.5, (0.001, 0.003), **{**usual, **columns})

    return make
