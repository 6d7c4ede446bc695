"""What draws of a change on rollers share."""

from __future__ import annotations

import numpy as np
import pytest

from sysid.compare.least_squares.shared_part import shared_part

SIGNAL = np.sin(np.linspace(0.0, 20.0, 500))


def test_equal_draws_are_kept() -> None:
    """Where chance does nothing, the change is what each draw shows."""
    assert shared_part([SIGNAL] * 3) == pytest.approx(SIGNAL)


@pytest.mark.parametrize("seed", range(5))
def test_chance_alone_is_no_change(seed: int) -> None:
    """Draws that have nothing in common leave next to nothing of what their mean has."""
    draws = list(np.random.default_rng(seed).standard_normal((3, 500)))
    left = shared_part(draws)
    assert np.sum(left**2) < 0.1 * np.sum(np.mean(draws, axis=0) ** 2)


@pytest.mark.parametrize("seed", range(5))
def test_a_change_beside_chance_is_kept(seed: int) -> None:
    """A change that is as large as chance is nearer to the truth after shrinking, on average of the noise."""
    rng = np.random.default_rng(seed)
    draws = [SIGNAL + rng.standard_normal(500) * 0.7 for _ in range(3)]
    mean, left = np.mean(draws, axis=0), shared_part(draws)
    assert np.sum((left - SIGNAL) ** 2) < np.sum((mean - SIGNAL) ** 2)
    assert left @ SIGNAL > 0.6 * SIGNAL @ SIGNAL


def test_nothing_stays_nothing() -> None:
    """Where no draw changes anything, nothing is changed."""
    assert not shared_part([np.zeros(4)] * 2).any()
