"""What the tests of controllers share."""

from collections.abc import Callable

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from training.evaluate import Setup, controller_factory, evaluate_controller

FIRST_SEED = 100_000  # development seeds: those of certificates begin at 0


@pytest.fixture(scope="session")
def play() -> Callable[..., tuple]:
    """Return a function that plays n episodes with a controller by its name and returns them."""

    def episodes(name: str, n: int, model: Model | None = None, *, known: Model | None = None, **setup):
        robot = paper_model() if model is None else model
        factory = controller_factory(name, robot if known is None else known)
        return evaluate_controller(factory, Setup(robot, **setup), range(FIRST_SEED, FIRST_SEED + n)).episodes

    return episodes


@pytest.fixture(scope="session")
def successes(play) -> Callable[..., float]:
    """Return a function that returns the share of successes."""
    return lambda *args, **setup: float(np.mean([one.success for one in play(*args, **setup)]))


@pytest.fixture(scope="session")
def tracking_error(play) -> Callable[..., float]:
    """Return a function that returns the root mean square of distance - maai while tracking [m]."""
    return lambda *args, **setup: float(
        np.sqrt(np.mean([one.distance_error_m**2 for one in play(*args, task="track", **setup)]))
    )
