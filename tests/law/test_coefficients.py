"""The wheel law: poles, simulation, steady state, errors."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law import LawState, WheelLaw

STABLE_POLES = st.tuples(st.floats(-0.95, 0.95), st.floats(-0.95, 0.95), st.floats(-0.95, 0.95))
COMMANDS = arrays(float, st.integers(1, 40), elements=st.floats(-135, 135))


def law_with_poles(poles, d=0.1, e=0.05, period=0.01):
    a, b, c = -np.real(np.poly(poles))[1:]
    return WheelLaw(a, b, c, d, e, 0.0, period).normalised()


@given(STABLE_POLES)
def test_poles_are_the_roots_largest_first(poles):
    law = law_with_poles(poles)
    assert law.poles.shape == (3,)
    assert np.all(np.diff(np.abs(law.poles)) <= 1e-12)
    np.testing.assert_allclose(np.real(np.poly(law.poles))[1:], [-law.A, -law.B, -law.C], atol=1e-9)


def test_a_law_without_memory_has_three_poles_at_zero():
    assert np.array_equal(WheelLaw(0, 0, 0, 1, 0, 0, 0.01).poles, np.zeros(3))


@given(COMMANDS)
def test_simulation_is_tick_after_tick(commands):
    law = law_with_poles([0.8, 0.3, -0.2])
    state = LawState(3.0, 2.0, 1.0, 4.0, 5.0)
    speeds = law.simulate(commands, state)
    assert speeds[0] == 3.0
    for k, command in enumerate(commands):
        speed, state = law.tick(state, command)
        assert speed == speeds[k + 1]


def test_the_first_ticks_are_the_equation_by_hand():
    law = WheelLaw(0.5, 0.2, 0.1, 0.3, 0.02, 0.01, 0.01)
    w1 = 0.5 * 3 + 0.2 * 2 + 0.1 * 1 + 0.3 * 10 + 0.02 * 4 + 0.01 * 5
    w2 = 0.5 * w1 + 0.2 * 3 + 0.1 * 2 + 0.3 * 20 + 0.02 * 10 + 0.01 * 4
    w3 = 0.5 * w2 + 0.2 * w1 + 0.1 * 3 + 0.3 * 30 + 0.02 * 20 + 0.01 * 10
    speeds = law.simulate([10.0, 20.0, 30.0], LawState(3.0, 2.0, 1.0, 4.0, 5.0))
    np.testing.assert_allclose(speeds, [3.0, w1, w2, w3], rtol=1e-15)


def test_leading_axes_are_independent_runs():
    law = law_with_poles([0.8, 0.3, -0.2])
    commands = np.random.default_rng(1).uniform(-100, 100, (2, 3, 20))
    together = law.simulate(commands)
    assert together.shape == (2, 3, 21)
    assert np.array_equal(together[1, 2], law.simulate(commands[1, 2]))
    starts = LawState.steady(np.array([0.0, 10.0, 20.0]))
    one_command = law.simulate(commands[0, 0], starts)
    assert one_command.shape == (3, 21)
    assert np.array_equal(one_command[1], law.simulate(commands[0, 0], LawState.steady(10.0)))


@given(STABLE_POLES, st.floats(-135, 135))
def test_a_steady_wheel_stays_steady(poles, speed):
    speeds = law_with_poles(poles).simulate(np.full(30, speed), LawState.steady(speed))
    np.testing.assert_allclose(speeds, speed, rtol=1e-12, atol=1e-300)


def test_a_step_ends_at_the_dc_gain():
    law = WheelLaw(0.5, 0.1, 0.0, 0.3, 0.02, 0.0, 0.01)
    assert law.simulate(np.full(400, 10.0))[-1] == pytest.approx(10.0 * law.dc_gain, rel=1e-12)
    assert law.dc_gain == pytest.approx(0.8)
    assert law.normalised().dc_gain == pytest.approx(1.0)
    assert math.isnan(WheelLaw(1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.01).dc_gain)


@given(arrays(float, 6, elements=st.floats(-2, 2)))
def test_normalising_moves_only_e(coefficients):
    law = WheelLaw.from_coefficients(coefficients, 0.01)
    after = law.normalised()
    assert sum(after.coefficients) == pytest.approx(1.0, abs=1e-14)
    kept = [0, 1, 2, 3, 5]
    assert np.array_equal(after.coefficients[kept], law.coefficients[kept])


def test_the_papers_law_is_the_published_one_with_e_renormalised(paper):
    law = paper.wheel.law
    assert np.array_equal(law.coefficients[[0, 1, 2, 3, 5]], [0.881, -0.151, 0.122, 0.0744, -0.0748])
    assert abs(law.E - 0.149) < 0.0007  # the published E
    assert sum(law.coefficients) == pytest.approx(1.0, abs=1e-15)
    assert law.is_stable
    assert law.sample_period_s == 1.0 / 120.0


def test_the_papers_law_is_short_by_4e_8_after_120_ticks(paper):
    shortfall = 1.0 - paper.wheel.law.simulate(np.ones(120))[-1]
    assert shortfall == pytest.approx(4.46e-8, rel=1e-3)


def test_an_unstable_law_is_refused_with_its_poles():
    law = WheelLaw(1.2, 0.0, 0.0, 0.1, 0.0, 0.0, 0.01)
    with pytest.raises(UnstableLawError, match=r"poles 1\.2\+0j \(\|z\| 1\.2\), .*below 1"):
        law.require_stable()


@pytest.mark.parametrize("name", ["A", "F", "sample_period_s"])
@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_coefficient_must_be_finite(name, bad):
    numbers = {**dict.fromkeys("ABCDEF", 0.1), "sample_period_s": 0.01, name: bad}
    with pytest.raises(InputError, match=f"{name} = {bad}, must be a finite number"):
        WheelLaw(**numbers)


@pytest.mark.parametrize("period", [0.0, -0.01])
def test_the_period_must_be_positive(period):
    with pytest.raises(InputError, match="must be above 0"):
        WheelLaw(0.1, 0.0, 0.0, 0.9, 0.0, 0.0, period)


def test_six_coefficients_are_needed():
    with pytest.raises(InputError, match="six numbers"):
        WheelLaw.from_coefficients([0.1, 0.2], 0.01)
