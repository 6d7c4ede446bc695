"""What the simulator's tests share."""

import math

import pytest

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.model import paper_model


@pytest.fixture(scope="session")
def slow_law():
    """Return a law of first order with a time constant of 0.5 s."""
    period = paper_model().wheel.law.sample_period_s
    pole = math.exp(-period / 0.5)
    return WheelLaw(pole, 0.0, 0.0, 1.0 - pole, 0.0, 0.0, period)
