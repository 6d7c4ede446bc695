"""The motor's bounds on the law's steps: straight ramps, the torque-speed line, inertia at the wheel."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError, UnstableLawError
from mecanum_env.law import LawState, WheelLaw
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.motor_bounds import MotorBounds, loaded_law, steepest_share
from tests.plugin.conftest import random_law

FIRST_ORDER = WheelLaw(0.9, 0.0, 0.0, 0.1, 0.0, 0.0, 0.01)
REST = LawState()


def simulate(law, command, start=REST, **bounds):
    return MotorBounds(**bounds).simulate(law, np.asarray(command, float), start)


def test_without_a_bound_the_law_is_its_own_to_the_bit(paper):
    command = np.random.default_rng(1).uniform(-100.0, 100.0, 200)
    law = paper.wheel.law
    np.testing.assert_array_equal(simulate(law, command), law.simulate(command))
    # Bounds that are never met are none.
    loose = simulate(law, command, rise_rpm=1e9, brake_rpm=1e9, supply_rpm=1e9, supply_share=0.5)
    np.testing.assert_array_equal(loose, law.simulate(command))


def test_a_torque_limit_makes_straight_rises_to_where_the_law_takes_over():
    speed = simulate(FIRST_ORDER, np.full(100, 80.0), rise_rpm=2.0, brake_rpm=2.0)
    # The law wants 0.1 (80 - w), which is less than 2 from 60 rpm on.
    np.testing.assert_allclose(speed[:31], 2.0 * np.arange(31))
    np.testing.assert_allclose(80.0 - speed[31:], 20.0 * 0.9 ** np.arange(1, 71))


def test_braking_has_a_limit_of_its_own_up_to_rest():
    start = LawState.steady(30.0)
    speed = simulate(FIRST_ORDER, np.full(40, -300.0), start, rise_rpm=2.0, brake_rpm=5.0)
    np.testing.assert_allclose(speed[:8], [30, 25, 20, 15, 10, 5, 0, -2])


def test_nothing_winds_up_while_a_limit_acts(paper):
    """The law goes on from the speed that was reached: the step back is that of a wheel that came so far."""
    law = paper.wheel.law
    limited = {"rise_rpm": 1.0, "brake_rpm": 1.0}
    speed = simulate(law, np.repeat([130.0, 20.0], [40, 200]), **limited)
    assert speed[40] == pytest.approx(40.0)
    assert np.min(speed[60:]) > 19.9
    assert speed[-1] == pytest.approx(20.0)


@given(
    pole=st.floats(0.5, 0.99),
    gain=st.floats(0.2, 3.0),
    integral=st.floats(0.0, 0.1),
    most=st.floats(2.0, 60.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_a_law_that_winds_up_is_a_pi_controller_without_anti_windup(pole, gain, integral, most, seed):
    """The controller runs here by itself, on a motor of first order whose voltage is limited."""
    share, command = 1.0 - pole, np.repeat(np.random.default_rng(seed).uniform(-100.0, 100.0, 8), 25)
    law = WheelLaw(
        1.0 + pole - share * (gain + integral),
        share * gain - pole,
        0.0,
        share * (gain + integral),
        -share * gain,
        0.0,
        0.01,
    )
    speeds, total = [0.0], 0.0
    for wanted in command:
        error = wanted - speeds[-1]
        total += integral * error
        volts = gain * error + total
        speeds.append(pole * speeds[-1] + share * min(max(volts, -most), most))
    found = simulate(law, command, windup=1.0, supply_rpm=most, supply_share=share)
    np.testing.assert_allclose(found, speeds, atol=1e-6 * np.ptp(speeds))


def test_the_supply_bends_the_rise_towards_its_limit():
    """A step of a law of first order that the supply ends goes there as a step to the limit itself."""
    share = steepest_share(FIRST_ORDER)
    speed = simulate(FIRST_ORDER, np.full(60, 120.0), supply_rpm=80.0, supply_share=share)
    np.testing.assert_allclose(speed, FIRST_ORDER.simulate(np.full(60, 80.0)))


@given(seed=st.integers(0, 2**32 - 1), limit=st.floats(5.0, 100.0))
def test_the_wheel_never_passes_the_supplys_limit(seed, limit):
    rng = np.random.default_rng(seed)
    law = random_law(rng)
    command = np.repeat(rng.uniform(-200.0, 200.0, 8), 30)
    speed = simulate(law, command, supply_rpm=limit, supply_share=steepest_share(law))
    assert np.max(np.abs(speed)) <= limit * (1.0 + 1e-12)


def test_the_steepest_tick_is_that_of_the_step_response(paper):
    law = paper.wheel.law
    assert steepest_share(law) == pytest.approx(np.max(np.diff(law.simulate(np.ones(500)))))
    assert steepest_share(FIRST_ORDER) == pytest.approx(0.1)


def test_a_law_that_moves_against_its_command_has_no_supply():
    with pytest.raises(InputError, match="does not follow its command"):
        steepest_share(WheelLaw(0.5, 0.0, 0.0, -0.5, 0.0, 0.0, 0.01))


@pytest.mark.parametrize("ratio", [0.7, 1.0, 3.0, 25.0])
def test_inertia_divides_what_a_controller_without_memory_changes(ratio):
    loaded = loaded_law(FIRST_ORDER, ratio)
    command, state = np.random.default_rng(3).uniform(-100.0, 100.0, 60), REST
    for r in command:
        wanted, _ = FIRST_ORDER.tick(state, r)
        speed, after = loaded.tick(state, r)
        assert speed == pytest.approx(state.w0 + (wanted - state.w0) / ratio, abs=1e-9)
        state = after


@pytest.mark.parametrize("integral", [False, True])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 25.0])
@pytest.mark.parametrize("gain", [0.8, 1.0, 1.3])
def test_inertia_keeps_the_gain(ratio, integral, gain):
    law = replace(FIRST_ORDER, D=gain * FIRST_ORDER.D)
    loaded = loaded_law(law, ratio, integral=integral)
    assert loaded.dc_gain == pytest.approx(gain)
    # The command is another unit of the same speed.
    unit = loaded_law(FIRST_ORDER, ratio, integral=integral)
    np.testing.assert_allclose(loaded.coefficients[:3], unit.coefficients[:3], atol=1e-12)


def test_a_drive_that_cannot_hold_the_inertia_is_refused():
    pair = 0.9 * np.exp(2.5j)
    _, a, b = -np.poly([pair, pair.conjugate()]).real
    law = replace(FIRST_ORDER, A=float(a), B=float(b)).normalised().require_stable()
    with pytest.raises(UnstableLawError):
        loaded_law(law, 0.3)


def test_a_motor_with_a_time_constant_of_its_own_rises_with_it():
    """Behind a law that wants the speed at once, a step to twice the supply's limit is the motor's own."""
    drive = DriveParameters(WheelLaw(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.01), 0.1, supply_rpm=80.0, supply_s=0.05)
    speed = drive.motor_bounds.simulate(drive.law, np.full(20, 160.0), REST)
    np.testing.assert_allclose(speed, 80.0 * (1.0 - np.exp(-0.01 * np.arange(21) / 0.05)), rtol=1e-12)
