"""Ramps: two rates, and the S-curve, which is exact in any parts, bounded, and the fastest there is."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.wheel_drive.ramp import Ramp, RampLimits

TAU = 1 / 120
RATES = st.floats(50.0, 5000.0)
JERKS = st.floats(500.0, 1e6)
SPEEDS = st.floats(-120.0, 120.0)


def followed(limits, commands, parts=1):
    """Return a ramp's values, slopes and contributions, from rest, with each command held for one tick."""
    ramp, rows = Ramp.steady(0.0), []
    for command in commands:
        mean = 0.0
        for _ in range(parts):
            ramp, share = limits.moved(ramp, np.float64(command), np.float64(1 / parts))
            mean += float(share)
        rows.append((float(ramp.value_rpm), float(ramp.slope_rpm_s), mean))
    return np.array(rows).T


@given(
    rise=RATES, brake=RATES, jerk=JERKS | st.just(math.inf), commands=st.lists(SPEEDS, min_size=1, max_size=8)
)
def test_a_tick_in_parts_is_the_whole_tick(rise, brake, jerk, commands):
    limits = RampLimits(rise, brake, jerk, TAU)
    np.testing.assert_allclose(followed(limits, commands, 7), followed(limits, commands), atol=1e-6)


@given(limit=RATES, jerk=JERKS, commands=st.lists(SPEEDS, min_size=1, max_size=4))
def test_an_s_curve_keeps_to_its_rate_and_its_jerk(limit, jerk, commands):
    value, slope, mean = followed(RampLimits(limit, limit, jerk, TAU), np.repeat(commands, 20))
    assert np.all(np.abs(slope) <= limit * (1 + 1e-9))
    assert np.all(np.abs(np.diff(slope, prepend=0.0)) <= jerk * TAU * (1 + 1e-9))
    steps = np.diff(value, prepend=0.0) / TAU
    assert np.all(np.abs(steps) <= limit * (1 + 1e-9))
    # The mean of a tick lies between its ends, unless the ramp turns within it.
    assert np.all(np.abs(mean - value) <= limit * TAU * (1 + 1e-9))


@given(limit=RATES, jerk=JERKS, command=SPEEDS)
def test_a_step_from_rest_ends_in_the_shortest_time_without_overshoot(limit, jerk, command):
    size = abs(command)
    seconds = size / limit + limit / jerk if size > limit**2 / jerk else 2 * math.sqrt(size / jerk)
    limits = RampLimits(limit, limit, jerk, seconds / 10 or 1.0)
    value, slope, _ = followed(limits, [command] * 10)
    assert np.all(np.diff(np.abs(value)) >= -1e-9 * size)
    assert np.all(np.abs(value[:9]) < size + (size == 0.0))
    assert value[9] == pytest.approx(command, abs=1e-6 * size)
    assert abs(slope[9]) <= 1e-3 * limit


def test_an_s_curve_has_the_shape_of_the_textbook():
    # 0.1 s of rising slope, 0.05 s at 400 rpm/s, 0.1 s of falling slope.
    value, slope, mean = followed(RampLimits(400.0, 400.0, 4000.0, 0.05), [60.0] * 6)
    assert value == pytest.approx([5.0, 20.0, 40.0, 55.0, 60.0, 60.0])
    assert slope == pytest.approx([200.0, 400.0, 400.0, 200.0, 0.0, 0.0], abs=1e-6)
    assert mean == pytest.approx([5 / 3, 35 / 3, 30.0, 60 - 35 / 3, 60 - 5 / 3, 60.0])


def test_a_new_command_bends_an_s_curve_without_a_jump_of_its_slope():
    limits = RampLimits(400.0, 400.0, 4000.0, 0.05)
    value, slope, _ = followed(limits, [60.0] * 3 + [0.0] * 12)
    assert slope[3] == pytest.approx(200.0)
    assert value.max() == pytest.approx(
        60.0
    )  # 20 rpm past the turn of the command: it has to slow down first
    assert (value[-1], slope[-1]) == (0.0, 0.0)


@pytest.mark.parametrize("jerk", [math.inf, 1e8])
def test_a_brake_of_its_own_acts_towards_0_only(jerk):
    value, _, _ = followed(RampLimits(100.0, 400.0, jerk, 0.1), [40.0] * 5 + [-20.0] * 4 + [-10.0])
    assert value == pytest.approx([10, 20, 30, 40, 40, 0, -10, -20, -20, -10], abs=1e-3)


@pytest.mark.parametrize(("rise", "brake"), [(200.0, 400.0), (400.0, 200.0)])
def test_an_s_curve_with_two_rates_passes_through_0_and_goes_over_to_the_other_rate(rise, brake):
    value, slope, _ = followed(RampLimits(rise, brake, 4000.0, 1e-3), [60.0] * 600 + [-60.0] * 900)
    back = slice(600, None)
    passes = 600 + int(np.flatnonzero(value[back] <= 0.0)[0])
    assert slope[passes] == pytest.approx(-brake, abs=5.0)
    assert slope[back].min() == pytest.approx(-max(rise, brake))
    # The rates are 200 rpm/s apart, for which the jerk takes 50 ms.
    assert slope[passes + 51 : passes + 100] == pytest.approx(np.full(49, -rise))
    assert np.max(np.abs(np.diff(slope))) < 4000.0 * 1.001e-3
    assert value.min() > -60.0 - 1e-9
    assert (value[-1], slope[-1]) == (-60.0, 0.0)


def test_rates_that_hardly_differ_make_the_ramp_of_one_rate():
    """Where the ramp passes through 0 the rates must not show that they are two."""
    commands = np.repeat(np.random.default_rng(1).uniform(-90.0, 90.0, 40), 7)
    one = followed(RampLimits(300.0, 300.0, 2000.0, 0.02), commands)
    two = followed(RampLimits(300.0, 300.0 * (1.0 + 1e-9), 2000.0, 0.02), commands)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_allclose(a, b, atol=1e-4)
