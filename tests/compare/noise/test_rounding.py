"""Which part of a coarse sensor's rounding error repeats share, from how much they differ."""

from __future__ import annotations

import numpy as np
import pytest

from sysid.compare.noise.estimate import shared_rounding


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
