"""Step metrics: the paper's figures, known curves, noise, what was never reached."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics, step_metrics, step_response

TIME = np.arange(1, 2001) * 1e-3
TAU = 0.1


def first_order(time, start=0.0, end=1.0):
    return end + (start - end) * np.exp(-time / TAU)


def test_the_papers_law_rises_in_14_9_samples_and_settles_in_28(paper):
    metrics = law_step_metrics(paper.wheel.law, 80.0, duration_s=1.0)
    assert metrics.rise_time_s * 120.0 == pytest.approx(14.9, abs=0.05)
    assert metrics.settling_time_s * 120.0 == pytest.approx(28.0)
    assert round(metrics.rise_time_s, 2) == 0.12
    assert round(metrics.settling_time_s, 2) == 0.23
    assert metrics.overshoot == 0.0
    assert metrics.relative_steady_state_error == pytest.approx(-4.46e-8, rel=1e-3)


@given(command=st.floats(-135.0, 135.0).filter(lambda x: abs(x) > 1e-3))
def test_the_law_is_linear_so_its_metrics_do_not_depend_on_the_command(command):
    law = WheelLaw(1.5, -0.7, 0.0, 0.1, 0.1, 0.0, 0.01)
    one, other = law_step_metrics(law), law_step_metrics(law, command)
    assert other.rise_time_s == pytest.approx(one.rise_time_s)
    assert other.settling_time_s == one.settling_time_s
    assert other.overshoot == pytest.approx(one.overshoot)


def test_a_first_order_response_has_the_textbook_times():
    metrics = step_metrics(TIME, first_order(TIME), 0.0, 1.0)
    assert metrics.rise_time_s == pytest.approx(TAU * math.log(9.0), abs=1e-5)
    assert metrics.settling_time_s == pytest.approx(TAU * math.log(50.0), abs=1e-3)
    assert metrics.overshoot == pytest.approx(0.0, abs=1e-6)
    assert abs(metrics.relative_steady_state_error) < 1e-6


def test_a_second_order_response_overshoots_as_the_textbook_says():
    zeta, omega = 0.4, 30.0
    damped = omega * math.sqrt(1 - zeta**2)
    decay = np.exp(-zeta * omega * TIME)
    speed = 1 - decay * (np.cos(damped * TIME) + zeta / math.sqrt(1 - zeta**2) * np.sin(damped * TIME))
    metrics = step_metrics(TIME, speed, 0.0, 1.0)
    expected = math.exp(-math.pi * zeta / math.sqrt(1 - zeta**2))
    assert metrics.overshoot == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize(("start", "command"), [(0.0, 80.0), (80.0, 40.0), (40.0, -40.0), (-20.0, 0.0)])
def test_times_are_the_same_in_either_direction(start, command):
    metrics = step_metrics(TIME, first_order(TIME, start, command), start, command)
    assert metrics.rise_time_s == pytest.approx(TAU * math.log(9.0), abs=1e-5)
    assert math.isnan(metrics.relative_steady_state_error) == (command == 0.0)


def test_an_error_is_negative_where_the_wheel_stays_short():
    metrics = step_metrics(TIME, 0.9 * first_order(TIME, 0.0, 50.0), 0.0, 50.0)
    assert metrics.relative_steady_state_error == pytest.approx(-0.1, abs=1e-6)
    assert metrics.rise_time_s == pytest.approx(TAU * math.log(9.0), abs=1e-5)  # of its own steady value


def test_times_count_from_the_step():
    early = step_metrics(TIME, first_order(TIME), 0.0, 1.0)
    time = np.concatenate([[3.0, 4.0, 5.0], TIME + 5.0])
    speed = np.concatenate([[0.0, 0.0, 0.0], first_order(TIME)])
    late = step_metrics(time, speed, 0.0, 1.0, step_time_s=5.0)
    assert late.rise_time_s == pytest.approx(early.rise_time_s)
    assert late.settling_time_s == pytest.approx(early.settling_time_s)


def test_noise_of_half_an_rpm_and_gaps_hardly_move_the_figures():
    rng = np.random.default_rng(2)
    time = np.arange(1, 400) * 5e-3
    rises, settlings, errors = [], [], []
    for _ in range(20):
        speed = np.round(first_order(time, 0.0, 80.0) + 0.5 * rng.standard_normal(len(time)))
        speed[rng.random(len(time)) < 0.1] = math.nan
        metrics = step_metrics(time, speed, 0.0, 80.0)
        rises.append(metrics.rise_time_s)
        settlings.append(metrics.settling_time_s)
        assert metrics.overshoot < 0.04
        errors.append(metrics.relative_steady_state_error)
    assert np.mean(rises) == pytest.approx(TAU * math.log(9.0), rel=0.05)
    assert np.mean(errors) == pytest.approx(0.0, abs=1e-3)
    assert np.max(settlings) < 2.0 * TAU * math.log(50.0)


def test_a_slow_step_under_noise_settles_when_it_enters_the_noise():
    rng = np.random.default_rng(3)
    speed = first_order(TIME, 0.0, 10.0) + 0.5 * rng.standard_normal(len(TIME))
    metrics = step_metrics(TIME, speed, 0.0, 10.0)
    assert metrics.settling_band_rpm == pytest.approx(2.5, rel=0.2)
    assert metrics.settling_time_s < 0.6
    assert step_metrics(TIME, speed, 0.0, 10.0, noise_rpm=0.0).settling_band_rpm < 0.21


def test_what_was_not_reached_is_nan():
    still = step_metrics(TIME, np.zeros_like(TIME), 0.0, 50.0)
    assert math.isnan(still.rise_time_s)
    assert math.isnan(still.settling_time_s)
    assert math.isnan(still.overshoot)
    assert still.relative_steady_state_error == -1.0
    ramp = step_metrics(TIME, TIME, 0.0, 50.0)
    assert math.isnan(ramp.settling_time_s)
    noise = np.random.default_rng(4).standard_normal(len(TIME))
    assert math.isnan(step_metrics(TIME, noise, 0.0, 50.0).rise_time_s)


def test_ringing_is_not_taken_for_noise():
    metrics = law_step_metrics(WheelLaw(-0.99, 0.0, 0.0, 1.99, 0.0, 0.0, 0.01), duration_s=1.0)
    assert metrics.settling_time_s == pytest.approx(0.01 * math.log(0.02) / math.log(0.99), abs=0.02)
    assert metrics.overshoot == pytest.approx(0.99)


def test_the_compiled_step_response_is_the_simulation(paper):
    law = paper.wheel.law
    np.testing.assert_allclose(step_response(law, 200), law.simulate(np.ones(200)), atol=1e-13)


def test_a_slow_law_is_simulated_to_its_end():
    law = WheelLaw(0.9999, 0.0, 0.0, 0.0001, 0.0, 0.0, 0.01)
    metrics = law_step_metrics(law)
    assert metrics.settling_time_s == pytest.approx(0.01 * math.log(50.0) / -math.log(0.9999), rel=1e-3)


def test_an_unstable_law_has_no_metrics():
    with pytest.raises(UnstableLawError):
        law_step_metrics(WheelLaw(1.1, 0.0, 0.0, 0.1, 0.0, 0.0, 0.01))


@pytest.mark.parametrize(
    ("time", "speed", "message"),
    [
        ([0.1, 0.2], [1.0], "common shape"),
        ([0.1, 0.1], [1.0, 1.0], "does not increase at sample 1"),
        ([-0.2, -0.1], [1.0, 1.0], "no finite sample after the step"),
        ([0.1, 0.2], [math.nan, math.nan], "no finite sample after the step"),
    ],
)
def test_unusable_samples_are_refused(time, speed, message):
    with pytest.raises(InputError, match=message):
        step_metrics(time, speed, 0.0, 1.0)


def test_a_duration_below_a_tick_is_refused(paper):
    with pytest.raises(InputError, match="at least one tick"):
        law_step_metrics(paper.wheel.law, duration_s=1e-4)
