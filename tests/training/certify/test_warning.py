"""The warning that is needed for nine successes in ten, recovered from made-up episodes."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from training.certify.warning import RANGE_S, warning_curve

MIDDLE_S, WIDTH_S = 0.40, 0.04
NEEDED_S = MIDDLE_S + WIDTH_S * np.log(9.0)


def logistic(seed, n=400):
    rng = np.random.default_rng(seed)
    warning = rng.uniform(*RANGE_S, n)
    return warning, rng.random(n) < 1.0 / (1.0 + np.exp(-(warning - MIDDLE_S) / WIDTH_S))


def test_a_logistic_truth_is_found_and_its_interval_holds_it():
    found = [warning_curve(*logistic(seed), seed=seed, resamples=50) for seed in range(15)]
    assert np.mean([curve.needed_s for curve in found]) == pytest.approx(NEEDED_S, abs=0.012)
    held = sum(curve.low_s <= NEEDED_S <= (curve.high_s or np.inf) for curve in found)
    assert held >= 12


def test_the_curve_follows_the_truth_between_its_ends():
    curve = warning_curve(*logistic(0, n=4000), resamples=8)
    truth = 1.0 / (1.0 + np.exp(-(np.array(curve.warning_s) - MIDDLE_S) / WIDTH_S))
    assert np.max(np.abs(np.array(curve.success) - truth)) < 0.05
    assert np.all(np.array(curve.low) <= np.array(curve.success) + 1e-9)


def test_a_curve_that_falls_again_says_where():
    """A controller that leaves too early: hit by the late strike again."""
    rng = np.random.default_rng(0)
    warning = rng.uniform(*RANGE_S, 3000)
    success = (warning > 0.4) & (warning < 0.7)
    curve = warning_curve(warning, success, resamples=20)
    assert curve.needed_s == pytest.approx(0.45, abs=0.05)
    assert curve.holds_to_s == pytest.approx(0.65, abs=0.05)
    assert warning_curve(*logistic(1), resamples=20).holds_to_s is None


def test_who_never_succeeds_needs_more_than_was_played():
    warning, _ = logistic(0, n=100)
    curve = warning_curve(warning, np.zeros(100), resamples=20)
    assert (curve.needed_s, curve.low_s, curve.high_s) == (None, None, None)


def test_who_always_succeeds_needs_no_more_than_the_shortest():
    warning, _ = logistic(0, n=200)
    curve = warning_curve(warning, np.ones(200), resamples=20)
    assert curve.needed_s == curve.high_s == RANGE_S[0]
    assert curve.holds_to_s is None


def test_the_bins_count_every_episode():
    warning, success = logistic(0, n=123)
    bins = warning_curve(warning, success, resamples=5).bins
    assert sum(one.success.trials for one in bins) == 123
    assert sum(one.success.successes for one in bins) == success.sum()


def test_the_same_seed_gives_the_same_curve():
    assert warning_curve(*logistic(3), resamples=10) == warning_curve(*logistic(3), resamples=10)


@pytest.mark.parametrize(("count", "target"), [(0, 0.9), (5, 1.0)])
def test_nothing_to_go_by_is_refused(count, target):
    with pytest.raises(InputError, match="between 0 and 1"):
        warning_curve(np.full(count, 0.5), np.ones(count), target=target)
