"""Limits on the robot's command as a whole: all wheels together, in every way of driving alike."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels, wheels_to_body
from mecanum_env.mjcf import planar_spec, robot_spec
from mecanum_env.simulator import BodyCommands, WheelCommands, drive, replay_bench
from mecanum_env.simulator.body_limits import BodyLimits
from mecanum_env.simulator.robot import RobotSession


def limited(model, commands, seconds):
    """Return the clock and what the drives get, as body commands (n, 3) [rpm]."""
    step = 1 / 480
    clock, limits = np.arange(0.0, seconds, step), BodyLimits(model, step)
    wheels = commands.wheels_at(clock, model.wheel.command_quantum_rpm)
    return clock, wheels_to_body(np.array([limits.step(row) for row in wheels]))


@pytest.mark.parametrize(
    ("command", "expected"),
    [((50, 30, 10), (50, 30, 10)), ((120, 30, 10), (60, 30, 10)), ((50, -90, -80), (50, -90, -20))],
)
def test_the_speed_limit_keeps_the_direction_and_leaves_rotation_apart(base, command, expected):
    model = base.with_effect("body_speed_limit", v_rpm=60.0, vc_rpm=20.0)
    _, body = limited(model, BodyCommands.constant(*command), 0.3)
    np.testing.assert_allclose(body[-1], wheels_to_body(command_to_wheels(*expected)), atol=1e-9)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_under_the_speed_limit_no_wheel_is_at_a_limit_of_its_own(base, plant):
    path = drive(
        base.with_effect("body_speed_limit", v_rpm=60.0), BodyCommands.constant(120, 30), 1.2, plant=plant
    )
    late = path.time_s > 1.0
    np.testing.assert_allclose(path.wheels_rpm[late].mean(axis=0), command_to_wheels(60, 30, 0), atol=1.0)


def test_the_acceleration_limit_ramps_the_vector(base):
    model = base.with_effect("body_acceleration_limit", v_rpm_s=200.0, vc_rpm_s=100.0)
    commands = BodyCommands.from_rows([(0.0, 60, 0, 20), (0.6, 60, 90, -20)])
    clock, body = limited(model, commands, 1.6)
    tick = base.wheel.law.sample_period_s
    ticks = body[::4]
    change = np.diff(ticks, axis=0)
    assert np.max(np.hypot(change[:, 0], change[:, 1])) <= 200.0 * tick + 1e-9
    assert np.max(np.abs(change[:, 2])) <= 100.0 * tick + 1e-9
    # Straight from one velocity to the other: the corner between forward and left is cut.
    crossing = (clock > 0.6) & (body[:, 0] > 1) & (body[:, 1] > 1)
    np.testing.assert_allclose(body[crossing, 0] + body[crossing, 1], 60.0, atol=1e-9)
    np.testing.assert_allclose(body[-1], [0, 60, -20], atol=1e-9)
    np.testing.assert_allclose(body[clock < 0.59][-1], [60, 0, 20], atol=1e-9)
    rise = clock[np.argmax(body[:, 0] >= 60 - 1e-9)]
    assert rise == pytest.approx(0.3, abs=tick + 1e-9)


def test_the_drives_get_the_mean_of_a_ramp_over_a_tick(base):
    tick = base.wheel.law.sample_period_s
    _, body = limited(
        base.with_effect("body_acceleration_limit", v_rpm_s=200.0), BodyCommands.constant(10), 0.2
    )
    clock = (np.arange(6000) + 0.5) / 6000 * tick
    for number, ticked in enumerate(body[::4, 0]):
        ramp = np.minimum(200.0 * (number * tick + clock), 10.0)
        assert ticked == pytest.approx(ramp.mean(), abs=1e-4)


def test_a_ramp_that_is_steep_enough_is_none(base):
    commands = BodyCommands.from_rows([(0.0, 60, 0, 20), (0.1, 30, 90, -20)])
    _, free = limited(base, commands, 0.3)
    _, steep = limited(
        base.with_effect("body_acceleration_limit", v_rpm_s=1e12, vc_rpm_s=1e12), commands, 0.3
    )
    np.testing.assert_allclose(steep, free, atol=1e-4)


@pytest.mark.parametrize("delay_s", [0.0, 0.03, 0.137, 0.25])
@pytest.mark.parametrize("rate", [120, 240, 480, 960])
def test_all_steps_at_once_are_the_steps_one_by_one(base, delay_s, rate):
    model = base.with_effect("body_acceleration_limit", v_rpm_s=150.0, vc_rpm_s=80.0)
    if delay_s:
        model = model.with_effect("command_latency", delay_s=delay_s)
    rng = np.random.default_rng(rate)
    wheels = np.repeat(rng.uniform(-100, 100, (11, 4)), rate // 10, axis=0)[: rate - 3]
    one_by_one = BodyLimits(model, 1 / rate)
    expected = np.array([one_by_one.step(row) for row in wheels])
    at_once = BodyLimits(model, 1 / rate)
    for _ in range(2):  # each path is from the start
        np.testing.assert_array_equal(at_once.path(wheels), expected)


def test_the_limits_come_after_the_latency(base):
    model = base.with_effect("body_acceleration_limit", v_rpm_s=200.0)
    late = model.with_effect("command_latency", delay_s=0.1)
    clock, plain = limited(model, BodyCommands.constant(60), 0.8)
    _, delayed = limited(late, BodyCommands.constant(60), 0.8)
    np.testing.assert_allclose(delayed[48:], plain[:-48], atol=1e-9)
    assert clock[48] == pytest.approx(0.1)


def test_speed_before_acceleration(base):
    model = base.with_effect("body_acceleration_limit", v_rpm_s=200.0).with_effect(
        "body_speed_limit", v_rpm=30.0
    )
    clock, body = limited(model, BodyCommands.constant(120), 0.4)
    assert clock[np.argmax(body[:, 0] >= 30 - 1e-9)] == pytest.approx(0.15, abs=0.01)
    assert np.max(body) == pytest.approx(30.0)


def test_wheel_commands_are_limited_too_and_keep_what_the_body_cannot_follow(base):
    model = base.with_effect("body_speed_limit", v_rpm=60.0)
    # 90 forward, 10 to the right, and front wheels against rear wheels.
    sent = WheelCommands(np.array([0.0]), np.array([[105.0, 85.0, 75.0, 95.0]]))
    limits = BodyLimits(model, 1 / 480)
    out = limits.step(sent.wheels_at(0.0, 0.0))
    body = wheels_to_body(out)
    assert np.hypot(body[0], body[1]) == pytest.approx(60.0)
    assert body[1] / body[0] == pytest.approx(-10 / 90)
    np.testing.assert_allclose(
        out - command_to_wheels(60, np.rad2deg(np.arctan2(-10, 90)), 0), [5, 5, -5, -5]
    )


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_stepwise_and_open_loop_drive_alike(base, plant):
    model = (
        base.with_effect("body_acceleration_limit", v_rpm_s=150.0, vc_rpm_s=80.0)
        .with_effect("body_speed_limit", v_rpm=60.0)
        .with_effect("command_latency", delay_s=0.13)
        .with_effect("speed_gain", gain=0.9)
    )
    rows = [(80.4, 30.0, 5.0), (80.0, 120.0, 0.0), (0.0, 0.0, -60.0), (20.0, 0.0, 0.0)]
    session = RobotSession(model, plant)
    for row in rows:
        session.advance(*row)
    commands = BodyCommands.from_rows([(0.1 * i, *row) for i, row in enumerate(rows)])
    np.testing.assert_array_equal(session.trajectory().qpos, drive(model, commands, 0.4, plant=plant).qpos)
    session.reset()
    for row in rows:
        session.advance(*row)
    np.testing.assert_array_equal(session.trajectory().qpos, drive(model, commands, 0.4, plant=plant).qpos)


@pytest.mark.parametrize("spec", [robot_spec, planar_spec])
def test_physics_alone_refuses_a_limit_on_the_robots_command(base, spec):
    with pytest.raises(InputError, match=r"effects\.body_speed_limit: acts on the robot's command"):
        spec(base.with_effect("body_speed_limit", v_rpm=60.0))


def test_a_bench_has_no_body_to_limit(base):
    time = np.arange(0.0, 0.5, 0.01)
    command = np.full(time.shape, 80.0)
    model = base.with_effect("body_speed_limit", v_rpm=20.0)
    np.testing.assert_array_equal(replay_bench(model, time, command), replay_bench(base, time, command))
