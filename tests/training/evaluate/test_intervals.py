"""Intervals against published values and against chance."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from training.evaluate import mean, share


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3: Wilson's score without correction.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_wilson_as_published(successes, trials, low, high):
    found = share(successes, trials)
    assert (found.low, found.high) == pytest.approx((low, high), abs=5e-5)
    assert found.value == successes / trials


def test_a_share_of_nothing_is_refused():
    with pytest.raises(InputError, match="at least one episode"):
        share(0, 0)


def test_the_bootstrap_of_a_mean_holds_the_truth_as_often_as_it_says():
    rng = np.random.default_rng(0)
    held = 0
    for _ in range(100):
        found = mean(rng.normal(3.0, 2.0, 40).tolist())
        held += found.low <= 3.0 <= found.high
    assert 88 <= held <= 99


def test_the_mean_of_nothing_is_none_and_of_one_value_itself():
    assert mean([]) is None
    assert mean([2.5]).low == mean([2.5]).high == 2.5
