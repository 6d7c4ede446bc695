"""Hand-made episodes, and one small certificate of a controller that stands still."""

from collections.abc import Callable
from typing import Any

import pytest

from mecanum_env.model import paper_model
from mecanum_env.parallel import Workers
from training.certify.certificate import Certificate
from training.certify.run import CertifyOptions, certify_controller
from training.evaluate import Episode

SMALL = CertifyOptions(episodes=4, plants=("latency", "with-backlash"), workers=Workers(jobs=1))


@pytest.fixture(scope="session")
def episode() -> Callable[..., Episode]:
    """Return a maker of episodes: successes by default."""

    def make(seed: int = 0, success: bool = True, **values: Any) -> Episode:
        usual = {
            "reason": "" if success else "hit",
            "technique": "men",
            "warning_s": 0.5,
            "duration_s": 3.0,
            "total_reward": 1.0,
            "distance_error_m": 0.1,
            "bearing_error_rad": 0.05,
            "speed_error_m_s": 0.2,
            "settling_s": 0.8,
            "overshoot": 0.1,
            "saturated_share": 0.25,
            "command_time_s": 1e-4,
        }
        return Episode(seed, success, **{**usual, **values})

    return make


@pytest.fixture(scope="session")
def small() -> Certificate:
    """Return a certificate of the retreat, of four episodes on three plants."""
    return certify_controller("retreat", paper_model(), SMALL)
