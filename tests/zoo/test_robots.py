"""Robots drawn at random, the path of their commands and the sensors of their logs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sysid.studies.zoo.drives.drive import Link
from sysid.studies.zoo.drives.plant import draw_plant
from sysid.studies.zoo.drives.sensor import Motion
from sysid.studies.zoo.robots.commands import wheel_set_points
from sysid.studies.zoo.robots.draw import draw_robot, known, scaled
from sysid.studies.zoo.robots.engine import RobotMotion
from sysid.studies.zoo.robots.robot import BodyCommandPath, BodySensors
from sysid.studies.zoo.robots.sensors import pose_channels, velocity_channels
from sysid.studies.zoo.robots.simulate import simulate
from sysid.studies.zoo.robots.trial import try_out

RPM = 60.0 / (2.0 * math.pi)
SEEDS = (0, 3, 11)
STAMPS = np.arange(0.0, 4.0, 0.01)
EXACT = BodySensors(noise_m_s=0.0, noise_rad_s=0.0, noise_m=0.0, noise_rad=0.0)


@pytest.fixture(scope="module")
def drawn():
    return {seed: draw_robot(seed) for seed in SEEDS}


@pytest.fixture
def plain(drawn):
    """A drawn robot whose drives treat commands as they are, over a link that is never late."""
    robot = drawn[3]
    control = replace(
        robot.drive.controller, quantum_rpm=0.0, filters_s=(), ramp_rpm_s=math.inf, jerk_rpm_s2=math.inf
    )
    drive = replace(robot.drive, controller=control, link=Link(period_s=0.1))
    return replace(robot, drive=drive, path=BodyCommandPath())


@pytest.fixture
def motion():
    """A robot that starts at time 0 and drives a circle with 0.4 m/s, 0.1 m/s to the left, 0.5 rad/s."""
    time_s = np.arange(-0.2, 4.01, 1e-3)
    on = (time_s >= 0.0).astype(float)
    twist = on[:, None] * np.array([0.4, 0.1, 0.5])
    pose = np.column_stack([0.4 * time_s * on, 0.1 * time_s * on, 0.5 * time_s * on])
    wheel = Motion(time_s, *(np.zeros((5, time_s.size))))
    return RobotMotion(time_s, pose, twist, (wheel, wheel, wheel, wheel))


def generator(seed=0):
    return np.random.default_rng(seed)


def held(robot, command, seconds):
    return np.tile(np.array(command, float), (round(seconds / robot.drive.link.period_s), 1))


@pytest.mark.parametrize("seed", SEEDS)
def test_a_seed_draws_the_same_useful_robot(drawn, seed):
    assert drawn[seed] == draw_robot(seed)
    assert try_out(drawn[seed]).useful


def test_other_seeds_draw_other_robots(drawn):
    assert len({robot.wheels.radius_m for robot in drawn.values()}) == len(SEEDS)


def test_a_family_that_is_asked_for_is_drawn():
    assert draw_robot(1, "cascade").drive.family == "cascade"


def test_a_scaled_drive_has_the_same_time_constants():
    plant = draw_plant(generator())
    larger = scaled(plant, 7.0)
    assert larger.time_constant_s == pytest.approx(plant.time_constant_s)
    assert larger.lag_s == pytest.approx(plant.lag_s)


def test_a_ruler_errs_by_little_and_tells_nothing_about_the_floor(drawn):
    robot = drawn[0]
    said = known(robot, generator())
    assert set(said) == {
        "wheel_radius_m", "half_wheelbase_m", "half_track_m", "mass_kg", "rollers_per_wheel"
    }  # fmt: skip
    assert said["wheel_radius_m"] == pytest.approx(robot.wheels.radius_m, rel=0.015)
    assert said["mass_kg"] == pytest.approx(robot.body.mass_kg, rel=0.05)
    assert said["rollers_per_wheel"] == robot.wheels.rollers


@pytest.mark.parametrize("seed", SEEDS)
def test_the_same_seed_gives_the_same_log(drawn, seed):
    robot = drawn[seed]
    commands = held(robot, (0.5 * robot.drive.top_rpm, 30.0, 5.0), 1.0)
    one, same, other = (simulate(robot, commands, generator(run)) for run in (5, 5, 6))
    assert one.channels.keys() == same.channels.keys()
    for name, channel in one.channels.items():
        assert np.array_equal(channel, same.channels[name], equal_nan=True)
    assert not np.array_equal(one.channels["speed_fl_rpm"], other.channels["speed_fl_rpm"])


@pytest.mark.parametrize("stamps", ["even", "uneven", "late"])
def test_all_channels_share_the_rows_of_one_logger(plain, stamps):
    sensor = replace(plain.drive.sensor, stamps=stamps, jitter_s=0.002)
    robot = replace(plain, drive=replace(plain.drive, sensor=sensor), sensors=replace(EXACT, pose=True))
    log = simulate(robot, held(robot, (30.0, 0.0, 0.0), 2.0), generator())
    assert np.all(np.diff(log.time_s) > 0.0)
    assert log.time_s[0] == 0.0
    assert log.commands.shape == (log.time_s.size, 3)
    assert len(log.channels) == 10
    assert all(channel.shape == log.time_s.shape for channel in log.channels.values())


def test_wheels_get_the_commands_of_the_contract_and_their_gains(plain):
    robot = replace(plain, wheel_gains=(1.0, 1.1, 1.0, 1.0))
    ticks_s = np.arange(-100, 200) / robot.drive.controller.loop_hz
    wanted = wheel_set_points(robot, held(robot, (50.0, 60.0, 10.0), 1.0), ticks_s, generator())
    x, y = 50.0 * math.cos(math.radians(60.0)), 50.0 * math.sin(math.radians(60.0))
    gain = robot.drive.controller.gain
    assert wanted[:, -1] * RPM / gain == pytest.approx(
        [x - y - 10, 1.1 * (x + y + 10), x + y - 10, x - y + 10]
    )
    assert np.all(wanted[:, :100] == 0.0)
    assert np.all(wanted[:, 101] == wanted[:, -1])


def test_the_platform_limits_and_ramps_v_as_a_vector(plain):
    path = BodyCommandPath(v_limit_rpm=40.0, vc_limit_rpm=5.0, v_ramp_rpm_s=100.0, vc_ramp_rpm_s=100.0)
    ticks_s = np.arange(0.0, 1.5, 1.0 / plain.drive.controller.loop_hz)
    commands = np.repeat(np.array([[50.0, 0.0, 10.0], [50.0, 90.0, 10.0]]), 8, axis=0)
    fl, fr, rl, rr = wheel_set_points(replace(plain, path=path), commands, ticks_s, generator()) * RPM
    x, y, turn = (fl + fr + rl + rr) / 4, (fr + rl - fl - rr) / 4, (fr + rr - fl - rl) / 4
    assert np.max(turn) == pytest.approx(5.0)
    assert np.interp(0.2, ticks_s, x) == pytest.approx(20.0, abs=1.0)
    assert np.interp(0.79, ticks_s, x) == pytest.approx(40.0, abs=1e-6)
    # From one limit to the other the vector takes the chord.
    assert np.interp(1.0, ticks_s, x + y) == pytest.approx(40.0, abs=1e-6)
    assert np.interp(1.48, ticks_s, y) == pytest.approx(40.0, abs=1e-6)


def test_a_lost_command_is_lost_to_all_wheels(plain):
    robot = replace(plain, drive=replace(plain.drive, link=Link(period_s=0.1, loss=0.5)))
    commands = np.column_stack([np.arange(1.0, 21.0), np.zeros(20), np.zeros(20)])
    ticks_s = np.arange(0.0, 2.0, 1.0 / robot.drive.controller.loop_hz)
    wanted = wheel_set_points(robot, commands, ticks_s, generator())
    assert np.ptp(wanted, axis=0) == pytest.approx(0.0, abs=1e-12)
    assert 4 < len(np.unique(wanted[0])) < 17


def test_a_sensor_beside_the_middle_sees_the_rotation(motion):
    shown = velocity_channels(motion, replace(EXACT, lever_x_m=0.2, lever_y_m=-0.1), STAMPS, generator())
    assert shown["vx_m_s"][-1] == pytest.approx(0.4 + 0.1 * 0.5)
    assert shown["vy_m_s"][-1] == pytest.approx(0.1 + 0.2 * 0.5)


def test_a_turned_mount_turns_velocity_and_path_alike(motion):
    sensors = replace(EXACT, turned_deg=90.0)
    velocity = velocity_channels(motion, sensors, STAMPS, generator())
    pose = pose_channels(motion, sensors, STAMPS, generator())
    assert (velocity["vx_m_s"][-1], velocity["vy_m_s"][-1]) == pytest.approx((0.1, -0.4))
    assert (pose["x_m"][-1], pose["y_m"][-1]) == pytest.approx((0.1 * STAMPS[-1], -0.4 * STAMPS[-1]))
    assert pose["yaw_rad"][-1] == pytest.approx(0.5 * STAMPS[-1])


def test_scales_biases_drift_and_crosstalk(motion):
    sensors = replace(
        EXACT, linear_scale=1.1, yaw_scale=0.9, bias_vy_m_s=0.03, drift_yaw_rate_rad_s2=0.01, crosstalk=0.2
    )
    shown = velocity_channels(motion, sensors, STAMPS, generator())
    assert shown["vx_m_s"][-1] == pytest.approx(0.44)
    assert shown["vy_m_s"][-1] == pytest.approx(0.14)
    assert shown["yaw_rate_rad_s"][-1] == pytest.approx(0.9 * (0.5 + 0.2 * 0.4) + 0.01 * STAMPS[-1])


@pytest.mark.parametrize(
    ("change", "after", "wanted"),
    [
        ({"late_s": 0.1}, 0.095, 0.0),
        ({"late_s": 0.1}, 0.105, 0.4),
        ({"filter_s": 0.1}, 0.1, 0.4 * (1.0 - math.exp(-1.0))),
        ({"window_s": 0.2}, 0.05, 0.1),
    ],
)
def test_delay_filter_and_window_of_the_velocities(motion, change, after, wanted):
    shown = velocity_channels(motion, replace(EXACT, **change), np.array([0.0, after]), generator())
    assert shown["vx_m_s"][1] == pytest.approx(wanted, abs=3e-3)


def test_motion_capture_is_late_and_drops_out_in_gaps(motion):
    sensors = replace(EXACT, pose_late_s=0.1, drop_outs=0.2, drop_out_s=0.1)
    missing = []
    for seed in range(40):
        shown = pose_channels(motion, sensors, STAMPS, generator(seed))
        gone = np.isnan(shown["x_m"])
        missing.append(gone.mean())
        assert np.array_equal(gone, np.isnan(shown["yaw_rad"]))
        seen = np.flatnonzero(~gone & (STAMPS > 0.2))
        assert shown["x_m"][seen] == pytest.approx(0.4 * (STAMPS[seen] - 0.1))
    assert np.mean(missing) == pytest.approx(0.18, abs=0.03)


def test_a_logged_battery_is_a_channel(plain):
    battery = replace(plain.drive.battery, logged=True, full_v=24.0, fall_v_per_s=0.2)
    robot = replace(plain, drive=replace(plain.drive, battery=battery))
    log = simulate(robot, held(robot, (0.0, 0.0, 0.0), 2.0), generator())
    assert log.channels["battery_v"][-1] == pytest.approx(23.6, abs=0.05)
