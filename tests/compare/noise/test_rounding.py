"""Coarse sensors: the part of their rounding error that repeats share, and the least noise."""

from __future__ import annotations

import numpy as np
import pytest

from sysid.compare.measured import observe
from sysid.compare.noise import measure_noise
from sysid.compare.noise.estimate import shared_rounding
from sysid.logs import BenchCommand, Dataset, Run


def rounded_repeats(noise: float, step: float, repeats: int = 400) -> tuple[float, float]:
    """Return by how much rounded repeats of many values differ, and by how much their means are off."""
    rng = np.random.default_rng(3)
    true = rng.uniform(-50.0 * step, 50.0 * step, 4000)
    seen = step * np.rint((true + noise * rng.standard_normal((repeats, true.size))) / step)
    return float(np.sqrt(seen.var(axis=0, ddof=1).mean())), float(np.std(seen.mean(axis=0) - true))


@pytest.mark.parametrize("share", [0.05, 0.1, 0.2, 0.3])
@pytest.mark.parametrize("step", [0.3, 8.0])
def test_what_repeats_share_follows_from_what_they_differ_by(share: float, step: float) -> None:
    differ, off = rounded_repeats(share * step, step)
    # The mean of finitely many repeats is off by its own noise, too.
    shared = np.sqrt(max(0.0, off**2 - differ**2 / 400))
    assert shared_rounding(differ, step) == pytest.approx(shared, abs=0.01 * step)


def test_without_noise_the_whole_rounding_error_is_shared() -> None:
    assert shared_rounding(0.0, 2.0) == pytest.approx(2.0 / np.sqrt(12.0), rel=0.05)


def test_much_noise_and_fine_sensors_leave_nothing_shared() -> None:
    assert shared_rounding(1.0, 1.0) < 1e-6
    assert shared_rounding(1.0, 0.0) == 0.0


def test_counts_that_are_filtered_before_they_are_logged_are_no_less_noisy_than_rounding() -> None:
    time = 0.02 * np.arange(600)
    command = np.where(time > 0.2, 60.4, 0.0)
    counted = 4.0 * np.diff(np.floor(np.cumsum(command) / 4.0), prepend=0.0)
    filtered = np.copy(counted)
    for k in range(1, time.size):
        filtered[k] = 0.1 * filtered[k - 1] + 0.9 * counted[k]
    run = Run("a.csv", "a", "fit", time, BenchCommand(command), {"speed_rpm": filtered})
    logs = Dataset("logs", (run,), ())
    # The numbers differ by far less than a count, and most neighbours by hardly anything.
    assert measure_noise(logs, observe(logs)).sigma["speed_rpm"] > 0.8 * 4.0 / np.sqrt(12.0)
