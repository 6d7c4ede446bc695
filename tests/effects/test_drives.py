"""Textbook signatures of what the drives do to their commands."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec
from mecanum_env.plugin.layout import write_parameters
from mecanum_env.simulator import BodyCommands, WheelCommands, drive, replay_bench
from mecanum_env.simulator.bench import law_of_bench
from mecanum_env.simulator.supply import Supply
from mecanum_env.wheel_drive.set_point import saturated

TIME = np.arange(0.0, 1.2, 0.01)


def steady_speed(model, command, wheel=None):
    return replay_bench(model, TIME, np.full(TIME.shape, float(command)), wheel=wheel)[-20:].mean()


@pytest.mark.parametrize(("command", "speed"), [(9, 0), (10, 10), (11, 11), (60, 60), (-9, 0), (-60, -60)])
def test_the_deadband_swallows_small_commands_only(base, command, speed):
    assert steady_speed(base.with_effect("command_deadband", threshold_rpm=10.0), command) == pytest.approx(
        speed, abs=1e-3
    )


@pytest.mark.parametrize(("command", "speed"), [(9, 0), (10, 0), (11, 1), (60, 50), (-9, 0), (-60, -50)])
def test_a_deadband_may_be_taken_off_every_command(base, command, speed):
    model = base.with_effect("command_deadband", "subtract", threshold_rpm=10.0)
    assert steady_speed(model, command) == pytest.approx(speed, abs=1e-3)


def test_the_deadband_takes_the_slow_wheels_of_a_diagonal(base):
    model = base.with_effect("command_deadband", threshold_rpm=15.0)
    # At 30 degrees fl and rr are commanded 22 rpm, at 40 degrees 7 rpm, which is within the dead band.
    moving, still = (
        drive(model, BodyCommands.constant(60, theta), 1.0).wheels_rpm[-50:, 0].mean() for theta in (30, 40)
    )
    assert moving > 10.0
    assert abs(still) < 1.5


@pytest.mark.parametrize("command", [20, 80, -80])
def test_the_gain_is_in_proportion(base, command):
    assert steady_speed(base.with_effect("speed_gain", gain=0.9), command) == pytest.approx(
        0.9 * command, abs=1e-3
    )


@pytest.mark.parametrize("wheel", ["fl", "fr", "rl", "rr"])
def test_the_mismatch_is_one_wheels_own(base, wheel):
    model = base.with_effect("wheel_gain_mismatch", gain_rl=0.8)
    assert steady_speed(model, 60, wheel) == pytest.approx(48.0 if wheel == "rl" else 60.0, abs=1e-3)
    assert steady_speed(model, 60) == pytest.approx(60.0, abs=1e-3)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_one_weaker_motor_bends_the_path(base, plant):
    commands = BodyCommands.constant(60)
    bent, straight = (
        drive(m, commands, 2.0, plant=plant)
        for m in (base.with_effect("wheel_gain_mismatch", gain_fl=0.9), base)
    )
    # The left side is slower: the robot turns left.
    assert bent.pose[-1, 2] > 0.05
    assert abs(straight.pose[-1, 2]) < 0.01


@pytest.mark.parametrize(("command", "speed"), [(60, 60), (-60, -48), (20, 20), (-20, -16)])
def test_the_asymmetry_shows_in_reverse_only(base, command, speed):
    model = base.with_effect("direction_asymmetry", reverse_ratio=0.8)
    assert steady_speed(model, command) == pytest.approx(speed, abs=1e-3)


def test_the_battery_takes_the_same_part_of_the_speed_each_second(base):
    model = base.with_effect("battery_sag", drop_per_s=0.05)
    time = np.arange(0.0, 4.0, 0.01)
    speed = replay_bench(model, time, np.full(time.shape, 80.0))
    # Differences, since the law's lag delays all of them alike.
    at = {second: speed[np.abs(time - second) < 0.05].mean() for second in (1.0, 2.0, 3.0)}
    assert at[1.0] - at[2.0] == pytest.approx(0.05 * 80, rel=0.02)
    assert at[2.0] - at[3.0] == pytest.approx(0.05 * 80, rel=0.02)


@pytest.mark.parametrize("share", [0.3, -0.2])
def test_a_drive_that_warms_up_loses_or_gains_its_share(base, share):
    model = base.with_effect("warm_up", share=share, time_constant_s=0.5)
    time = np.arange(0.0, 6.0, 0.01)
    speed = replay_bench(model, time, np.full(time.shape, 80.0))
    assert speed[-20:].mean() == pytest.approx(80 * (1 - share), abs=0.01)
    # One time constant after the start, and the law's lag.
    assert speed[np.abs(time - 0.61) < 0.05].mean() == pytest.approx(
        80 * (1 - share * (1 - 1 / np.e)), rel=0.01
    )


@pytest.mark.parametrize("share", [0.3, -0.2])
def test_a_cold_drive_ends_at_the_gain_of_the_model(base, share):
    model = base.with_effect("warm_up", "cold", share=share, time_constant_s=0.5)
    time = np.arange(0.0, 6.0, 0.01)
    speed = replay_bench(model, time, np.full(time.shape, 80.0))
    assert speed[-20:].mean() == pytest.approx(80.0, abs=0.01)
    # One time constant after the start, and the law's lag.
    assert speed[np.abs(time - 0.61) < 0.05].mean() == pytest.approx(80 * (1 - share / np.e), rel=0.01)


def test_a_gain_cannot_be_lost_altogether(base):
    with pytest.raises(InputError, match=r"effects\.warm_up\.share = 1, must be"):
        replay_bench(base.with_effect("warm_up", share=1.0), TIME, TIME)


@pytest.mark.parametrize("form", [None, "voltage"])
def test_the_gain_follows_the_logged_voltage(base, form):
    """Full is the first sample that is there; between samples the voltage is linear."""
    model = base.with_effect("battery_sag", form, per_volt=0.04)
    time = np.arange(0.0, 4.0, 0.01)
    command, volts = (
        np.full(time.shape, 80.0),
        np.interp(time, [0.0, 2.0, 2.5, 4.0], [25.0, 25.0, 22.0, 22.0]),
    )
    sparse = np.where(np.arange(time.size) % 50 == 0, volts, np.nan)
    for battery_v in (volts, sparse):
        speed = replay_bench(model, time, command, battery_v=battery_v)
        assert speed[np.abs(time - 1.9) < 0.05].mean() == pytest.approx(80.0, abs=0.01)
        assert speed[-20:].mean() == pytest.approx(80.0 * (1.0 - 0.04 * 3.0), abs=0.01)


def test_without_a_logged_voltage_nothing_is_lost(base):
    model = base.with_effect("battery_sag", "voltage", per_volt=0.04)
    command, missing = np.full(TIME.shape, 80.0), np.full(TIME.shape, np.nan)
    for battery_v in (None, missing, np.full(TIME.shape, 24.0)):
        speed = replay_bench(model, TIME, command, battery_v=battery_v)
        np.testing.assert_array_equal(speed, replay_bench(base, TIME, command))


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_a_robot_slows_down_with_its_battery(base, plant):
    model = base.with_effect("battery_sag", "voltage", per_volt=0.04)
    falling = Supply(np.array([0.0, 1.0, 1.1]), np.array([25.0, 25.0, 20.0]))
    commands = BodyCommands.constant(40.0)
    speed = drive(model, commands, 2.0, plant=plant, supply=falling).wheels_rpm.mean(axis=1)
    full = drive(base, commands, 2.0, plant=plant).wheels_rpm.mean(axis=1)
    assert speed[-1] == pytest.approx(0.8 * full[-1], rel=0.01)


@pytest.mark.parametrize(("command", "speed"), [(40, 40), (70, 70), (100, 70), (-100, -70)])
def test_the_saturation_spares_low_speeds(base, command, speed):
    assert steady_speed(base.with_effect("speed_saturation", limit_rpm=70.0), command) == pytest.approx(
        speed, abs=1e-3
    )


def test_a_higher_limit_than_the_models_lifts_it(base):
    assert steady_speed(base.with_effect("speed_saturation", limit_rpm=160.0), 150) == pytest.approx(
        150.0, abs=1e-3
    )


@given(
    limit=st.floats(5.0, 200.0),
    softness=st.floats(0.0, 300.0),
    command=st.floats(-400.0, 400.0),
)
def test_the_knee_is_between_the_line_and_the_limit_and_odd_and_rising(limit, softness, command):
    given, knee = np.array([command, -command, command + 1e-3]), min(softness, limit)
    bent, mirrored, next_up = saturated(given, limit, softness)
    assert mirrored == -bent
    assert next_up >= bent - 1e-12
    assert abs(bent) <= min(abs(command), limit) + 1e-9
    if abs(command) <= limit - knee:
        assert bent == command
    # The parabola deviates most at the hard corner, by a quarter of the softness.
    assert abs(bent) >= min(abs(command), limit) - knee / 4 - 1e-9


def test_the_acceleration_limit_makes_ramps_of_steps(base):
    model = base.with_effect("acceleration_limit", limit_rpm_s=200.0)
    law = base.wheel.law
    # A law w(k+1) = r(k) shows its input.
    passing = replace(model, wheel=replace(model.wheel, law=type(law)(0, 0, 0, 1, 0, 0, law.sample_period_s)))
    clock = np.arange(0.0, 1.0, law.sample_period_s)
    speed = law_of_bench(passing, np.array([0.0, 0.5]), np.array([60.0, 20.0]), clock)
    # The law takes the mean over the tick before: half a tick behind the ramp.
    behind = np.maximum(clock - law.sample_period_s / 2, 0.0)
    rising, ramps = np.minimum(200.0 * behind, 60.0), (clock < 0.295) & (clock > 0.0)
    np.testing.assert_allclose(speed[ramps], rising[ramps], atol=1e-9)
    assert np.max(np.abs(np.diff(speed))) <= 200.0 * law.sample_period_s + 1e-9
    assert speed[-1] == pytest.approx(20.0)
    assert steady_speed(model, 60) == pytest.approx(60.0, abs=1e-3)


def test_large_steps_take_longer_under_an_acceleration_limit(base):
    model = base.with_effect("acceleration_limit", limit_rpm_s=200.0)
    rises = [
        int(np.argmax(replay_bench(model, TIME, np.full(TIME.shape, v)) > 0.9 * v)) / 100
        for v in (40.0, 120.0)
    ]
    assert rises[1] - rises[0] == pytest.approx(0.9 * 80 / 200, abs=0.03)


def test_what_comes_first_in_the_chain_acts_first(base):
    """Dead band before gain, gain before saturation."""
    model = base.with_effect("command_deadband", threshold_rpm=50.0).with_effect("speed_gain", gain=0.5)
    assert steady_speed(model, 60) == pytest.approx(30.0, abs=1e-3)
    model = base.with_effect("speed_gain", gain=0.5).with_effect("speed_saturation", limit_rpm=40.0)
    assert steady_speed(model, 70) == pytest.approx(35.0, abs=1e-3)
    assert steady_speed(model, 100) == pytest.approx(40.0, abs=1e-3)


def test_gains_multiply(base):
    model = (
        base.with_effect("speed_gain", gain=0.9)
        .with_effect("wheel_gain_mismatch", gain_rr=0.8)
        .with_effect("direction_asymmetry", reverse_ratio=0.5)
    )
    assert steady_speed(model, -100, "rr") == pytest.approx(-100 * 0.9 * 0.8 * 0.5, abs=1e-3)


def test_on_the_floor_a_wheel_does_what_it_does_on_the_bench(base):
    model = base.with_effect("speed_gain", gain=0.9).with_effect(
        "speed_saturation", limit_rpm=60.0, softness_rpm=10.0
    )
    path = drive(model, WheelCommands(np.array([0.0]), np.full((1, 4), 60.0)), 1.0, plant="planar")
    assert path.wheels_rpm[-1].mean() == pytest.approx(steady_speed(model, 60), abs=0.05)


def test_a_compiled_model_can_be_given_effects(base):
    model = (
        base.with_effect("speed_gain", gain=0.9)
        .with_effect("acceleration_limit", limit_rpm_s=300.0)
        .with_effect("weak_servo", servo_n_m_s_rad=2.0)
    )
    rewritten = bench_spec(base).compile()
    write_parameters(rewritten, 0, model, torque_limit_n_m=np.inf)
    anew = bench_spec(model).compile()
    for field in ("actuator_dynprm", "actuator_user", "actuator_biasprm"):
        np.testing.assert_array_equal(getattr(rewritten, field), getattr(anew, field))


def test_the_law_alone_has_the_drives_effects(base):
    model = base.with_effect("command_deadband", threshold_rpm=10.0).with_effect("speed_gain", gain=0.9)
    command = np.where(TIME < 0.5, 60.0, 5.0)
    step = bench_spec(model).option.timestep
    clock = np.arange(int(TIME[-1] / step)) * step
    law = np.interp(TIME[:-2], clock, law_of_bench(model, TIME, command, clock))
    assert np.max(np.abs(law - replay_bench(model, TIME, command)[:-2])) < 1.0


def test_a_drive_that_cannot_be_names_the_effect_that_asks_for_it(base):
    with pytest.raises(InputError, match=r"^effects\.command_latency: delay_s = 200\.0, must be 0 to 6\.1"):
        steady_speed(base.with_effect("command_latency", delay_s=200.0), 60)
