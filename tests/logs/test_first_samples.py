"""At what speed a run starts, told by its first samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sysid.logs.first_samples import speed_at_start

SIGMA = 0.5


@given(st.floats(0.0, 60.0), st.integers(2, 8))
def test_a_wheel_that_is_started_by_the_first_row_was_at_rest(slope: float, n: int) -> None:
    assert speed_at_start(slope * np.arange(n), SIGMA) == 0.0


@given(st.floats(-300.0, 300.0).filter(lambda speed: abs(speed) > 4.0), st.integers(1, 8))
def test_a_steady_wheel_turned_as_fast_before(speed: float, n: int) -> None:
    first = speed + SIGMA * np.random.default_rng(n).uniform(-1.0, 1.0, n)
    assert speed_at_start(first, SIGMA) == pytest.approx(float(np.mean(first)))


def test_the_first_sample_tells_how_fast_a_wheel_was_that_is_just_accelerated() -> None:
    assert speed_at_start(np.array([60.0, 63.0, 68.0]), SIGMA) == 60.0


def test_what_may_be_noise_or_a_bias_is_rest() -> None:
    noise = np.array([1.2, -0.8, 1.5, 0.3])
    assert speed_at_start(noise, SIGMA) == 0.0
    assert speed_at_start(np.full(9, 0.9), 0.0, rest=1.0) == 0.0
    assert speed_at_start(np.zeros(0), SIGMA) == 0.0
