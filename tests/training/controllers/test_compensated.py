"""Compensation: neutral effects change nothing; each named one costs less with it than without."""

import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE
from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.model import CustomEffect, paper_model
from mecanum_env.model.static_map import map_parameters
from mecanum_env.simulator.robot import RobotSession
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.compensation import Compensated
from training.controllers.drive_inverse import DriveInverse
from training.controllers.named import SUFFIX, make_controller

COMMANDS = ((12, 0, 0), (40, 0, 0), (40, 90, 0), (30, -120, 10), (75, 180, 0), (0, 0, 25))
DRIVES = {
    "command_deadband": {"command_deadband": {"threshold_rpm": 20.0}},
    "command_deadband/subtract": {"command_deadband/subtract": {"threshold_rpm": 8.0}},
    "speed_gain": {"speed_gain": {"gain": 0.8}},
    "wheel_gain_mismatch": {"wheel_gain_mismatch": {"gain_fl": 0.85}},
    "direction_asymmetry": {"direction_asymmetry": {"reverse_ratio": 0.8}},
    "battery_sag": {"battery_sag": {"drop_per_s": 0.04}},
    "warm_up": {"warm_up": {"share": 0.3, "time_constant_s": 1.0}},
    "warm_up/cold": {"warm_up/cold": {"share": 0.3, "time_constant_s": 1.0}},
    "static_map": {"static_map": map_parameters([6.0, 30.0, 70.0], [2.0, 20.0, 80.0])},
    "speed_saturation": {"speed_saturation": {"limit_rpm": 80.0, "softness_rpm": 70.0}},
    "coulomb_friction": {"coulomb_friction": {"torque_n_m": 0.5}},
    "weak_servo": {"weak_servo": {"servo_n_m_s_rad": 0.5}, "coulomb_friction": {"torque_n_m": 0.3}},
    "viscous_friction": {
        "viscous_friction": {"damping_n_m_s_rad": 0.05},
        "weak_servo": {"servo_n_m_s_rad": 0.5},
    },
    "stiction": {
        "stiction": {"breakaway_n_m": 0.5, "stribeck_rpm": 40.0},
        "coulomb_friction": {"torque_n_m": 0.1},
        "weak_servo": {"servo_n_m_s_rad": 0.5},
    },
    "warm_up/friction": {
        "warm_up/friction": {"share": 0.8, "time_constant_s": 1.5},
        "coulomb_friction": {"torque_n_m": 0.3},
        "viscous_friction": {"damping_n_m_s_rad": 0.1},
        "weak_servo": {"servo_n_m_s_rad": 0.5},
    },
    "warm_up/cold_friction": {
        "warm_up/cold_friction": {"torque_n_m": 0.2, "damping_n_m_s_rad": 0.12, "time_constant_s": 1.5},
        "coulomb_friction": {"torque_n_m": 0.1},
        "viscous_friction": {"damping_n_m_s_rad": 0.03},
        "weak_servo": {"servo_n_m_s_rad": 0.5},
    },
    "wheel_radius": {"wheel_radius": {"scale": 1.1}},
    "track_width": {"track_width": {"scale": 1.2}},
}
SENSORS = {
    "sensor_bias": {"vx_m_s": 0.2, "vy_m_s": -0.1, "yaw_rate_rad_s": 0.3},
    "sensor_scale": {"linear": 0.6, "yaw": 0.7},
    "mount_yaw": {"angle_deg": 25.0},
    "mount_yaw/body": {"angle_deg": 25.0},
    "sensor_bias/drift": {"vx_m_s": 0.1, "yaw_rate_rad_s": 0.1, "per_s": 0.5},
    "sensor_latency": {"delay_s": 0.2},
    "sensor_latency/body": {"delay_s": 0.2},
    "sensor_lowpass": {"time_constant_s": 0.2},
    "sensor_lowpass/window": {"window_s": 0.4},
}
NEUTRAL = {
    "command_latency": {"delay_s": 0.0},
    "command_deadband": {"threshold_rpm": 0.0},
    "command_deadband/subtract": {"threshold_rpm": 0.0},
    "body_speed_limit": {},
    "speed_gain": {"gain": 1.0},
    "warm_up": {"share": 0.0},
    "static_map": {},
    "direction_asymmetry": {"reverse_ratio": 1.0},
    "battery_sag": {"drop_per_s": 0.0},
    "coulomb_friction": {"torque_n_m": 0.0},
    "viscous_friction": {"damping_n_m_s_rad": 0.0},
    "wheel_radius": {"scale": 1.0},
    "sensor_bias": {"vx_m_s": 0.0},
    "sensor_scale": {"linear": 1.0},
    "sensor_latency": {"delay_s": 0.0},
    "sensor_lowpass": {"time_constant_s": 0.0},
    "mount_yaw": {"angle_deg": 0.0},
}


def robot_with(effects):
    model = paper_model()
    for name, values in effects.items():
        model = model.with_effect(name, **values)
    return model


LIMITS = ("speed_saturation/supply", "body_speed_limit")
"""Beyond a limit the robot stays slower, so that these have tests of their own."""
CUSTOM = {
    "command": CustomEffect("command", "-0.002 * command * abs(command)"),
    "set_point": CustomEffect("set_point", "-4 * sin(command / 12)"),
}


def test_every_effect_that_is_undone_is_tested():
    tested = {*DRIVES, *LIMITS, *SENSORS, "command_latency", "command_latency/jitter"}
    undone = {name for name, effect in CATALOGUE.items() if effect.undone_by is not None}
    # Late or turned poses alone leave the velocities as they are, which the test of the sensors compares.
    assert undone - tested == {"sensor_latency/pose", "mount_yaw/pose"}


def test_the_docs_say_what_is_done_about_each_effect():
    page = (Path(__file__).parents[3] / "docs" / "controllers.md").read_text(encoding="utf-8")
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    said = {name: row for row in rows for name in re.findall(r"`([a-z_/]+)`", row.split("|")[1])}
    for name, effect in CATALOGUE.items():
        assert said[name].endswith("| - |") == (effect.undone_by is None), name


def relative_speed_error(model, compensated):
    """Return by how much the mean twist of one second misses what was asked for, mean of commands."""
    lever = np.array([1.0, 1.0, 0.38])  # turning counts by the speed of the wheels
    errors = []
    for command in COMMANDS:
        inverse, session = DriveInverse(model), RobotSession(model, "planar")
        for k in range(20):
            session.advance(*(inverse.command(command, 0.1 * k) if compensated else command))
        path = session.trajectory()
        twist = path.twist[path.time_s >= 1.0].mean(axis=0)
        asked = command_to_twist(*command, paper_model().robot)
        errors.append(np.linalg.norm((twist - asked) * lever) / np.linalg.norm(asked * lever))
    return float(np.mean(errors))


class Passing:
    """Gives fixed commands and keeps what it sees."""

    def __init__(self, commands=()):
        self.commands, self.seen = list(commands), []

    def reset(self):
        self.seen = []

    def act(self, observation):
        self.seen.append(observation)
        return self.commands[(len(self.seen) - 1) % len(self.commands)]


@pytest.mark.parametrize("name", DRIVES)
def test_the_robot_keeps_the_speed_that_was_asked_for(name):
    model = robot_with(DRIVES[name])
    with_it, without = relative_speed_error(model, True), relative_speed_error(model, False)
    assert with_it < 0.5 * without
    assert with_it < 0.06


@pytest.mark.parametrize("station", CUSTOM)
def test_a_custom_effect_of_the_command_is_inverted(station):
    model = paper_model().with_custom(CUSTOM[station])
    with_it, without = relative_speed_error(model, True), relative_speed_error(model, False)
    assert with_it < 0.5 * without
    assert with_it < 0.06


@pytest.mark.parametrize("effect", [CustomEffect("load", "-2"), CustomEffect("set_point", "-0.1 * speed")])
def test_a_custom_effect_that_commands_alone_do_not_give_is_left_alone(effect):
    model = paper_model().with_custom(effect)
    assert DriveInverse(model).command((40, 30, 10), 0.0) == (40, 30, 10)
    assert Compensated(Passing([(0, 0, 0)]), model).left_alone == (f"custom effect ({effect.station})",)


def test_a_limit_of_the_supply_keeps_the_direction():
    model = robot_with({"speed_saturation/supply": {"limit_rpm": 40.0}})
    v, theta, vc = DriveInverse(model).command((80, 30, 0), 0.0)
    assert (theta, vc) == (30, 0)
    assert np.max(np.abs(command_to_wheels(v, theta, vc))) == pytest.approx(40.0, abs=1.0)


def test_friction_that_the_drive_makes_up_for_is_left_to_it():
    values = {"torque_n_m": 0.5, "washout_s": 0.3}
    model = robot_with({"coulomb_friction/washed_out": values, "speed_gain": {"gain": 0.8}})
    assert DriveInverse(model).command((40, 0, 0), 0.0) == (50, 0, 0)
    assert Compensated(Passing([(0, 0, 0)]), model).left_alone == ("coulomb_friction/washed_out",)


def test_a_limit_of_the_body_keeps_the_direction():
    model = robot_with({"body_speed_limit": {"v_rpm": 40.0, "vc_rpm": 100.0}})
    v, theta, vc = DriveInverse(model).command((80, 30, 20), 0.0)
    assert (v, theta, vc) == (40, 30, 10)


@pytest.mark.parametrize("name", SENSORS)
def test_the_controller_sees_its_own_motion_as_it_is(name):
    """Velocity and place in what the wrapped controller sees, against those of a robot with true sensors."""
    model = robot_with({name: SENSORS[name]})
    rng = np.random.default_rng(0)
    commands = [
        (int(rng.integers(0, 50)), int(rng.integers(-180, 180)), int(rng.integers(-8, 8))) for _ in range(6)
    ]
    shown = {}
    for sensors in (paper_model(), model):
        env = TankendoVectorEnv(1, task="track", model=sensors, action_mode="command")
        observation, _ = env.reset(seed=100_000)
        player = Compensated(Passing([c for c in commands for _ in range(4)]), model)
        player.reset()
        seen = []
        for _ in range(24):
            seen.append(observation[0].astype(float))
            observation, *_ = env.step(command_to_action([player.act(observation[0])]))
        shown[sensors is model] = (np.array(seen), np.array(player._controller.seen))
    truth, (raw, corrected) = shown[False][0], shown[True]
    own = slice(10, 13)
    error = np.sqrt(np.mean((corrected[:, own] - truth[:, own]) ** 2))
    assert error < 0.4 * np.sqrt(np.mean((raw[:, own] - truth[:, own]) ** 2))
    place = [18, 19] if name.startswith(("sensor_bias", "sensor_scale")) else [16, 17]
    off, before = np.abs(corrected - truth)[:, place].max(), np.abs(raw - truth)[:, place].max()
    assert off <= max(0.5 * before, 1e-5)


@pytest.mark.parametrize("name", NEUTRAL)
def test_neutral_effects_change_nothing_bit_for_bit(name):
    model = robot_with({name: NEUTRAL[name]})
    rng = np.random.default_rng(1)
    commands = [(int(rng.integers(0, 136)), int(rng.integers(-179, 181)), -7) for _ in range(10)]
    inner = Passing(commands)
    player = Compensated(inner, model)
    player.reset()
    for command in commands:
        observation = rng.standard_normal(20).astype(np.float32)
        assert player.act(observation) == command
        assert inner.seen[-1] is observation


@settings(max_examples=20)
@given(
    st.floats(0.6, 1.3),
    st.floats(0.6, 1.3),
    st.floats(0.0, 0.6),
    st.integers(0, 135),
    st.integers(-180, 180),
    st.integers(-100, 100),
)
def test_commands_stay_whole_and_within_range(gain, reverse, torque, v, theta, vc):
    effects = {
        "speed_gain": {"gain": gain},
        "direction_asymmetry": {"reverse_ratio": reverse},
        "coulomb_friction": {"torque_n_m": torque},
        "command_deadband": {"threshold_rpm": 6.0},
    }
    command = DriveInverse(robot_with(effects)).command((v, theta, vc), 0.0)
    assert all(isinstance(number, int) for number in command)
    assert abs(command[0]) <= 135
    assert abs(command[2]) <= 100


@given(st.floats(0.6, 1.4), st.integers(5, 60), st.integers(-180, 180), st.integers(-20, 20))
def test_what_is_delivered_is_what_was_asked_for(reverse, v, theta, vc):
    model = robot_with({"direction_asymmetry": {"reverse_ratio": reverse}})
    inverse, nominal = DriveInverse(model), DriveInverse(paper_model())
    reached = inverse.delivered(inverse.command((v, theta, vc), 0.0), 0.0)
    np.testing.assert_allclose(reached, nominal.delivered((v, theta, vc), 0.0), atol=2.2)  # whole numbers


@pytest.mark.parametrize("name", ["speed_gain", "direction_asymmetry"])
def test_tracking_is_better_with_it(tracking_error, name):
    model = robot_with(DRIVES[name])
    assert tracking_error("p" + SUFFIX, 5, model) < 0.9 * tracking_error("p", 5, model)


def test_a_known_latency_is_made_up_for(tracking_error):
    model = robot_with({"command_latency": {"delay_s": 0.25}})
    assert tracking_error("p" + SUFFIX, 5, model) < 0.9 * tracking_error("p", 5, model)


def test_a_controller_that_foresees_is_left_the_latency():
    model = robot_with({"command_latency": {"delay_s": 0.1}})
    rng = np.random.default_rng(0)
    plain, wrapped = make_controller("lqr", model), make_controller("lqr" + SUFFIX, model)
    for _ in range(5):
        seen = (0.3 * rng.standard_normal(20)).astype(np.float32)
        seen[18], seen[19] = 1.0, 0.0
        assert plain.act(seen) == wrapped.act(seen)


def test_says_what_it_leaves_alone():
    model = robot_with({"backlash": {"gap_deg": 2.0}, "speed_gain": {"gain": 0.9}})
    assert Compensated(Passing([(0, 0, 0)]), model).left_alone == ("backlash",)
