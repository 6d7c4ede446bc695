"""Textbook signatures of limited torque and supply, and of inertia at the wheel."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.model import model_from_dict, model_to_dict
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.simulator.bench import law_of_bench
from mecanum_env.wheel_drive.motor_bounds import loaded_law

TIME = np.arange(0.0, 2.0, 1 / 120)
STEPS = np.where(TIME < 1.0, 100.0, -40.0)


def test_a_limited_torque_bounds_the_wheels_own_acceleration(base):
    speed = replay_bench(base.with_effect("acceleration_limit", "drive", limit_rpm_s=240.0), TIME, STEPS)
    change = np.diff(speed) * 120
    assert np.max(np.abs(change)) == pytest.approx(240.0, rel=1e-6)
    rising = (TIME[1:] > 0.02) & (TIME[1:] < 0.25)
    np.testing.assert_allclose(change[rising], 240.0, rtol=1e-6)
    assert speed[TIME < 1.0][-1] == pytest.approx(100.0, abs=0.1)


def test_the_motor_limits_differently_from_a_ramp_of_the_setpoint(base):
    """The wheel rises at once and at full rate; behind a ramp it lags by the law's own time."""
    by_motor, by_ramp = (
        replay_bench(base.with_effect("acceleration_limit", form, limit_rpm_s=240.0), TIME, STEPS)
        for form in ("drive", "set_point")
    )
    assert by_motor[24] - by_ramp[24] > 10.0


def test_braking_may_be_gentler_or_harder_than_starting(base):
    model = base.with_effect("acceleration_limit", "drive", limit_rpm_s=240.0, brake_rpm_s=120.0)
    change = np.diff(replay_bench(model, TIME, STEPS)) * 120
    braking = (TIME[1:] > 1.05) & (TIME[1:] < 1.5)
    np.testing.assert_allclose(change[braking], -120.0, rtol=1e-6)
    assert np.max(change) == pytest.approx(240.0, rel=1e-6)


def test_small_steps_know_no_limit(base):
    small = np.where(TIME < 1.0, 10.0, 5.0)
    model = base.with_effect("acceleration_limit", "drive", limit_rpm_s=800.0)
    np.testing.assert_array_equal(replay_bench(model, TIME, small), replay_bench(base, TIME, small))


def test_the_supply_ends_a_rise_slowly_and_spares_low_speeds(base):
    model = base.with_effect("speed_saturation", "supply", limit_rpm=60.0)
    speed = replay_bench(model, TIME, STEPS)
    clipped = replay_bench(base.with_effect("speed_saturation", limit_rpm=60.0), TIME, STEPS)
    assert speed[TIME < 1.0][-1] == pytest.approx(60.0, abs=0.01)
    assert np.max(speed) <= 60.0
    # On the way up the motor works for 100 rpm, behind a ceiling of the command for 60.
    assert speed[8] > clipped[8] + 1.0
    low = np.where(TIME < 1.0, 20.0, -10.0)
    np.testing.assert_allclose(replay_bench(model, TIME, low), replay_bench(base, TIME, low), atol=1e-9)


def test_the_limit_of_the_supply_falls_with_its_voltage(base):
    model = base.with_effect("speed_saturation", "supply", limit_rpm=60.0, per_volt=0.05)
    volts = np.interp(TIME, [0.0, 0.6, 0.7], [24.0, 24.0, 20.0])
    speed = replay_bench(model, TIME, np.full(TIME.shape, 100.0), battery_v=volts)
    assert speed[np.abs(TIME - 0.55) < 0.03].mean() == pytest.approx(60.0, abs=0.1)
    assert speed[-1] == pytest.approx(60.0 * (1.0 - 0.05 * 4.0), abs=0.01)


def test_a_wheel_at_the_supplys_limit_comes_back_at_once(base):
    model = base.with_effect("speed_saturation", "supply", limit_rpm=60.0)
    back = np.where(TIME < 1.0, 130.0, 50.0)
    speed = replay_bench(model, TIME, back)
    at_limit = replay_bench(base, TIME, np.where(TIME < 1.0, 60.0, 50.0))
    assert np.max(np.abs(speed - at_limit)[TIME > 1.1]) < 1.5


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_under_load_the_supplys_ceiling_falls(base, plant):
    """Of 1 N m at rest, 0.6 of the limiting speed leaves the 0.4 N m that friction takes there."""
    weak = replace(base, robot=replace(base.robot, torque_limit_n_m=1.0, servo_n_m_s_rad=20.0))
    supplied = weak.with_effect("speed_saturation", "supply", limit_rpm=100.0)
    speeds = {}
    for friction in (0.1, 0.4):
        model = supplied.with_effect("coulomb_friction", torque_n_m=friction)
        path = drive(model, BodyCommands.constant(120, 0, 0), 4.0, plant=plant)
        speeds[friction] = path.wheels_rpm[-200:].mean()
    # Torque 1 (1 - w / 100) = friction, and a little more that the rollers take.
    assert speeds[0.1] == pytest.approx(90.0, abs=4.0)
    assert speeds[0.4] == pytest.approx(60.0, abs=4.0)


def loop(
    inertia: float, memory: tuple[float, float], answer: tuple[float, float], separate: float
) -> WheelLaw:
    """Return the law of a wheel J (w(k+1) - w(k)) = torque under a controller with a memory of its torque.

    torque(k) = m1 torque(k-1) + m2 torque(k-2) + a1 (u - w)(k) + a2 (u - w)(k-1) - separate (w(k) - w(k-1))
    """
    wheel, kept = np.array([1.0, -1.0]), np.array([1.0, -memory[0], -memory[1]])
    command = np.array([0.0, *answer, 0.0]) / inertia
    speed = command + np.array([0.0, separate, -separate, 0.0]) / inertia
    own = np.convolve(wheel, kept) + speed
    return WheelLaw.from_coefficients([*-own[1:], *command[1:]], 0.01)


@pytest.mark.parametrize("ratio", [1.5, 7.0])
@pytest.mark.parametrize("memory", [(0.0, 0.0), (0.6, 0.0), (1.0, 0.0), (1.3, -0.3)])
def test_the_law_of_a_heavier_wheel_is_that_of_the_same_controller(ratio, memory):
    """It answers the difference of both without memory, with a lag, with integral action, or with both."""
    light, heavy = (loop(inertia, memory, (0.12, -0.1), 0.0) for inertia in (1.0, ratio))
    np.testing.assert_allclose(loaded_law(light, ratio).coefficients, heavy.coefficients, atol=1e-12)


@pytest.mark.parametrize("ratio", [1.5, 7.0])
def test_a_drive_with_integral_action_may_answer_command_and_speed_separately(ratio):
    light, heavy = (loop(inertia, (1.0, 0.0), (0.12, -0.1), 0.2) for inertia in (1.0, ratio))
    found = loaded_law(light, ratio, integral=True)
    np.testing.assert_allclose(found.coefficients, heavy.coefficients, atol=1e-12)
    assert not np.allclose(loaded_law(light, ratio).coefficients, heavy.coefficients, atol=1e-3)


@pytest.mark.parametrize("ratio", [2.0, 10.0])
def test_more_inertia_slows_the_rise_and_keeps_the_speed(base, ratio):
    time = np.arange(0.0, 30.0, 0.01)
    command = np.full(time.shape, 80.0)
    light, heavy = (
        replay_bench(m, time, command) for m in (base, base.with_effect("load_inertia", ratio=ratio))
    )
    assert heavy[-1] == pytest.approx(80.0, abs=1e-3)
    first = np.argmax(time >= 0.01)
    assert heavy[first] / light[first] == pytest.approx(1 / ratio, rel=0.2)


def test_a_heavier_wheel_gets_less_acceleration_from_a_limited_torque(base):
    limited = base.with_effect("acceleration_limit", "drive", limit_rpm_s=600.0, brake_rpm_s=300.0)
    speed = replay_bench(limited.with_effect("load_inertia", ratio=2.0), TIME, STEPS)
    change = np.diff(speed) * 120
    assert change.max() == pytest.approx(300.0, rel=1e-6)
    assert change[speed[1:] > 5.0].min() == pytest.approx(-150.0, rel=1e-6)


def test_a_heavier_wheel_takes_longer_to_the_supplys_speed(base):
    """Under full voltage it approaches that speed with a time constant that goes with its inertia."""
    limited = base.with_effect("speed_saturation", "supply", limit_rpm=60.0, motor_s=0.2)
    for ratio in (1.0, 2.5):
        speed = replay_bench(limited.with_effect("load_inertia", ratio=ratio), TIME, STEPS)
        left = 60.0 - speed[(TIME > 0.1) & (TIME < 0.5)]
        np.testing.assert_allclose(np.diff(np.log(left)) * 120, -1.0 / (0.2 * ratio), rtol=1e-4)


def test_the_reference_has_the_motors_effects(base):
    model = (
        base.with_effect("speed_saturation", "supply", limit_rpm=70.0)
        .with_effect("acceleration_limit", "drive", limit_rpm_s=300.0, brake_rpm_s=900.0)
        .with_effect("load_inertia", ratio=3.0)
    )
    clock = np.arange(0.0, 2.0, 1 / 480)
    law = law_of_bench(model, TIME, STEPS, clock)
    speed = replay_bench(model, TIME, STEPS, sample_times_s=clock[clock <= TIME[-1]])
    np.testing.assert_allclose(law[: speed.size], speed, atol=1e-9)


def test_a_file_names_the_form(base):
    model = base.with_effect("acceleration_limit", "drive", limit_rpm_s=300.0)
    value = model_to_dict(model)
    assert value["effects"] == {"acceleration_limit": {"form": "drive", "limit_rpm_s": 300.0}}
    assert model_from_dict(value) == model


def test_inertia_that_the_drive_cannot_hold_names_its_effect(base):
    law = base.wheel.law
    lively = replace(law, A=-0.8, B=-0.1, C=0.0, D=0.0, E=0.0, F=0.0).normalised()
    model = replace(base, wheel=replace(base.wheel, law=lively)).with_effect("load_inertia", ratio=0.5)
    with pytest.raises(InputError, match=r"effects\.load_inertia: the wheel law is unstable"):
        replay_bench(model, TIME, STEPS)
