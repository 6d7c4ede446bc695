"""Metrics of hand-made episodes; confidence intervals against published values and against chance."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_twist
from mecanum_env.tankendo import Rules
from training.evaluate import mean, share, summarise
from training.evaluate.metrics import is_saturated, overshoot, settling_time

TIME = np.arange(0.0, 6.0, 0.001)


def test_settling_and_overshoot_of_a_second_order_step():
    """Damping 0.5: overshoot exp(-pi z / sqrt(1 - z^2)) = 16.3 %, textbook."""
    z, w = 0.5, 4.0
    wd = w * np.sqrt(1.0 - z * z)
    decay = np.exp(-z * w * TIME)
    step = 1.0 - decay * (np.cos(wd * TIME) + z * w / wd * np.sin(wd * TIME))
    assert overshoot(step, 1.0) == pytest.approx(np.exp(-np.pi * z / np.sqrt(1 - z * z)), abs=1e-4)
    settled = settling_time(TIME, np.abs(step - 1.0) <= 0.02)
    after = np.abs(step[settled <= TIME] - 1.0)
    assert after.max() <= 0.02
    assert abs(step[round(1000 * settled) - 1] - 1.0) > 0.02


def test_overshoot_counts_in_the_direction_of_the_change():
    assert overshoot(np.array([2.5, 1.9, 1.62, 1.7]), 1.7) == pytest.approx(0.1)
    assert overshoot(np.array([2.5, 2.6, 1.8]), 1.7) == 0.0
    assert overshoot(np.array([1.7, 1.6]), 1.7) is None


def test_what_leaves_the_band_at_the_end_never_settles():
    assert settling_time(TIME[:3], np.array([False, True, False])) is None
    assert settling_time(TIME[:3], np.array([True, True, True])) == 0.0


def test_a_wheel_at_its_maximum_speed_within_the_rounding_is_saturated():
    asked = np.array([[0, 0, 134.5, 0], [133, -133, 0, 0], [0, -200, 0, 0]])
    assert is_saturated(asked, 135.0, 1.0).tolist() == [True, False, True]
    assert not is_saturated(asked, np.inf, 1.0).any()


def test_an_episode_is_measured_until_the_sword_moves(recording, paper):
    distance = [2.5, 2.1, 1.8, 1.6, 1.7, 1.7, 0.9, 0.9]
    guarded = np.array([1, 1, 1, 1, 1, 1, 0, 0.0])
    found = summarise(recording(distance, guarded=guarded), paper, Rules(), "dodge")
    assert found.settling_s == pytest.approx(0.2)
    assert found.overshoot == pytest.approx(0.1 / 0.8)
    assert found.distance_error_m == pytest.approx(np.sqrt((0.01 + 0.01) / 4))
    assert found.duration_s == pytest.approx(0.7)
    assert found.command_time_s == pytest.approx(0.002)


def test_commanded_against_actual_speed_and_saturation(recording, paper):
    commands = np.array([[0, 0, 0], [100, 0, 0], [134, 0, 20], [0, 0, 0], [0, 0, 0.0]])
    actual = np.array([command_to_twist(*row, paper.robot) for row in commands])
    actual[1, 0] -= 0.2
    found = summarise(recording([1.7] * 5, commands=commands, actual=actual), paper, Rules(), "dodge")
    assert found.speed_error_m_s == pytest.approx(0.2 / np.sqrt(4))
    assert found.saturated_share == 0.25


def test_tracking_counts_from_when_the_rules_say(recording, paper):
    distance = [2.5] * 31 + [1.8] * 20
    found = summarise(recording(distance), paper, Rules(track_settle_s=3.0), "track")
    assert found.distance_error_m == pytest.approx(0.1)


@pytest.mark.parametrize(
    ("successes", "trials", "low", "high"),
    # R. G. Newcombe, Statistics in Medicine 17 (1998), table I, method 3: Wilson's score without correction.
    [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0.0, 0.1611), (1, 29, 0.0061, 0.1718)],
)
def test_the_interval_of_a_share_is_wilsons(successes, trials, low, high):
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
    assert mean([]) is mean([None]) is None
    assert mean([None, 2.5]).count == 1
    assert mean([2.5]).low == mean([2.5]).high == 2.5
