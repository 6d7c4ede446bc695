"""The law at another sample period: equal at common times, there and back, and where no exact law exists."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law import WheelLaw
from mecanum_env.law.conversion import convert_law
from mecanum_env.law.metrics import step_response

PERIOD = 1.0 / 120.0


@st.composite
def laws_of_continuous_systems(draw):
    """Draw a stable law without poles on the non-positive real axis."""
    real = draw(st.floats(0.05, 0.98))
    if draw(st.booleans()):
        poles = [real, draw(st.floats(0.05, 0.98)), draw(st.floats(0.05, 0.98))]
    else:
        pair = draw(st.floats(0.1, 0.98)) * np.exp(1j * draw(st.floats(0.05, 3.0)))
        poles = [real, pair, np.conj(pair)]
    a, b, c = -np.real(np.poly(poles))[1:]
    d, e, f = (draw(st.floats(-0.3, 0.3)) for _ in range(3))
    return WheelLaw(a, b, c, d, e, f, PERIOD)


def assert_same_at_common_times(slow, fast, ratio, n=40):
    commands = np.random.default_rng(0).uniform(-100.0, 100.0, n)
    expected = slow.simulate(commands)
    got = fast.simulate(np.repeat(commands, ratio))[::ratio]
    np.testing.assert_allclose(got, expected, atol=1e-7 * np.max(np.abs(expected)) + 1e-9)


@given(laws_of_continuous_systems(), st.integers(1, 8))
def test_a_slower_law_agrees_at_common_times(law, ratio):
    assert_same_at_common_times(convert_law(law, ratio * PERIOD), law, ratio)


@given(laws_of_continuous_systems(), st.integers(2, 8))
def test_a_faster_law_agrees_at_common_times(law, ratio):
    assert_same_at_common_times(law, convert_law(law, PERIOD / ratio), ratio)


def test_periods_without_a_whole_ratio_agree_at_common_times(paper):
    law = paper.wheel.law
    other = convert_law(law, 1.0 / 100.0)  # common times: every 6 and every 5 ticks
    commands = np.random.default_rng(1).uniform(-100.0, 100.0, 20)
    ours, theirs = law.simulate(np.repeat(commands, 6)), other.simulate(np.repeat(commands, 5))
    np.testing.assert_allclose(theirs[::5], ours[::6], atol=1e-10)


@given(laws_of_continuous_systems(), st.floats(0.2, 1.0))
def test_there_and_back(law, ratio):
    back = convert_law(convert_law(law, ratio * PERIOD), PERIOD)
    # Fast ticks crowd the poles at 1, whence the loss of digits.
    np.testing.assert_allclose(back.coefficients, law.coefficients, atol=1e-7)


@given(laws_of_continuous_systems(), st.floats(0.2, 5.0))
def test_stability_dc_gain_and_period(law, ratio):
    other = convert_law(law, ratio * PERIOD)
    assert other.is_stable
    assert other.sample_period_s == ratio * PERIOD
    assert other.dc_gain == pytest.approx(law.dc_gain, rel=1e-6, abs=1e-6)


def test_the_same_period_is_the_same_law(paper):
    law = paper.wheel.law
    np.testing.assert_allclose(convert_law(law, PERIOD).coefficients, law.coefficients, atol=1e-15)


@pytest.mark.parametrize("abcdef", [(0.9, 0, 0, 0.1, 0, 0), (1.2, -0.3, 0, 0.06, 0.04, 0)])
def test_lower_order_laws_stay_of_lower_order(abcdef):
    law = WheelLaw(*abcdef, PERIOD)
    other = convert_law(law, PERIOD / 3.0)
    zeros = np.array(abcdef) == 0.0
    assert np.array_equal(other.coefficients[zeros], np.zeros(np.count_nonzero(zeros)))
    assert_same_at_common_times(law, other, 3)


ALTERNATING = WheelLaw(0.5, 0.24, 0.0, 0.15, 0.11, 0.0, PERIOD)  # poles 0.8 and -0.3
DELAYED = WheelLaw(0.8, 0.0, 0.0, 0.0, 0.2, 0.0, PERIOD)  # a tick of pure delay: poles 0.8 and 0


@pytest.mark.parametrize(("law", "pole"), [(ALTERNATING, "-0.3"), (DELAYED, "0")])
def test_a_pole_that_no_continuous_system_has_is_refused(law, pole):
    with pytest.raises(
        InputError, match=rf"at {pole} on the non-positive .* whole multiple .* approximate=True"
    ):
        convert_law(law, PERIOD / 2.0)


@pytest.mark.parametrize("law", [ALTERNATING, DELAYED])
def test_whole_multiples_are_exact_for_every_law(law):
    assert_same_at_common_times(convert_law(law, 3.0 * PERIOD), law, 3)


@pytest.mark.parametrize("law", [ALTERNATING, DELAYED])
@pytest.mark.parametrize("ratio", [0.25, 0.5, 1.5, 2.5])
def test_the_nearest_law_is_stable_keeps_the_gain_and_stays_near(law, ratio):
    near = convert_law(law, ratio * PERIOD, approximate=True)
    assert near.is_stable
    assert near.dc_gain == pytest.approx(law.dc_gain, abs=1e-9)
    ticks = round(60 / ratio)
    truth = step_response(law, 100)
    expected = np.interp(np.arange(ticks + 1) * ratio, np.arange(101), truth)
    assert np.sqrt(np.mean((step_response(near, ticks) - expected) ** 2)) < 0.01


def test_approximate_is_exact_where_an_exact_law_exists(paper):
    law = paper.wheel.law
    assert convert_law(law, 0.005, approximate=True) == convert_law(law, 0.005)


@pytest.mark.parametrize("period", [0.0, -0.01, float("nan"), float("inf")])
def test_the_new_period_must_be_positive(paper, period):
    with pytest.raises(InputError, match="sample_period_s"):
        convert_law(paper.wheel.law, period)


def test_an_unstable_law_is_refused():
    with pytest.raises(UnstableLawError):
        convert_law(WheelLaw(1.1, 0.0, 0.0, 0.1, 0.0, 0.0, PERIOD), 0.01)
