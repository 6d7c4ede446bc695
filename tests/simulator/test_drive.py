from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_twist, command_to_wheels
from mecanum_env.simulator import BodyCommands, WheelCommands, compile_plant, drive
from mecanum_env.simulator.commands import scripted
from mecanum_env.simulator.trajectory import CHANNELS

PLANTS = ("rollers", "planar")


@pytest.fixture(scope="module")
def model():
    from mecanum_env.model import paper_model

    return paper_model()


@pytest.fixture(scope="module")
def compiled(model):
    return {plant: compile_plant(model, plant) for plant in PLANTS}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize(
    ("command", "ratio"),
    [((60, 0, 0), 1.0), ((60, 180, 0), 1.0), ((60, 90, 0), 0.98), ((60, -90, 0), 0.98), ((0, 0, 30), 1.0)],
)
def test_the_robot_moves_as_commanded(model, compiled, plant, command, ratio):
    path = drive(model, BodyCommands.constant(*command), 1.5, plant=plant, mj_model=compiled[plant])
    twist = path.twist[path.time_s >= 1.0].mean(axis=0)
    ideal = command_to_twist(*command, model.robot)
    # Sideways the gaps between rollers cost 2 %: geometry, on both plants.
    assert twist @ ideal / (ideal @ ideal) == pytest.approx(ratio, abs=0.015)
    across = twist - (twist @ ideal / (ideal @ ideal)) * ideal
    assert np.max(np.abs(across)) < 0.03 * np.linalg.norm(ideal)
    wheels = path.wheels_rpm[path.time_s >= 1.0].mean(axis=0)
    np.testing.assert_allclose(wheels, command_to_wheels(*command), atol=1.5)


def test_positions_are_the_integral_of_velocities(model, compiled):
    path = drive(model, scripted("tour")[0], 9.0, mj_model=compiled["rollers"])
    yaw = path.pose[:, 2]
    vx = np.cos(yaw) * path.twist[:, 0] - np.sin(yaw) * path.twist[:, 1]
    vy = np.sin(yaw) * path.twist[:, 0] + np.cos(yaw) * path.twist[:, 1]
    step = path.time_s[1]
    for rate, position in ((vx, 0), (vy, 1), (path.twist[:, 2], 2)):
        assert np.sum(rate[1:]) * step == pytest.approx(
            path.pose[-1, position] - path.pose[0, position], abs=2e-3
        )


def test_both_plants_drive_one_path(model, compiled):
    commands, duration = scripted("tour")
    rollers, planar = (
        drive(model, commands, duration, plant=plant, mj_model=compiled[plant]).pose for plant in PLANTS
    )
    length = np.sum(np.hypot(*np.diff(rollers[:, :2], axis=0).T))
    assert length > 3
    assert np.max(np.hypot(*(rollers - planar)[:, :2].T)) < 0.03 * length
    assert np.max(np.abs(rollers - planar)[:, 2]) < 0.05


def test_without_a_command_it_stands(model, compiled):
    path = drive(model, BodyCommands.constant(), 2.0, mj_model=compiled["rollers"])
    assert np.max(np.hypot(*path.pose[:, :2].T)) < 1e-3
    assert np.max(np.abs(path.pose[:, 2])) < np.deg2rad(0.1)
    assert np.max(np.abs(path.wheels_rpm)) < 0.5


def test_a_drive_repeats_bit_for_bit(model, compiled):
    commands, _ = scripted("diagonal")
    one, two = (drive(model, commands, 0.6, mj_model=m) for m in (compiled["rollers"], None))
    np.testing.assert_array_equal(one.qpos, two.qpos)
    np.testing.assert_array_equal(one.wheels_rpm, two.wheels_rpm)


@pytest.mark.parametrize("plant", PLANTS)
def test_a_command_acts_at_the_next_latch(model, compiled, plant):
    def of(at):
        rows = [(0.0, 0, 0, 0), (at, 60, 0, 0)]
        return drive(model, BodyCommands.from_rows(rows), 0.4, plant=plant, mj_model=compiled[plant])

    between, on_time, late = of(0.05), of(0.1), of(0.15)
    np.testing.assert_array_equal(between.qpos, on_time.qpos)
    before, after = between.time_s <= 0.1 + 1e-9, between.time_s >= 0.12
    assert np.max(np.abs(between.wheels_rpm[before])) < 0.5
    assert np.min(between.wheels_rpm[after]) > 1.0
    assert np.max(np.abs(late.wheels_rpm[late.time_s <= 0.2 + 1e-9])) < 0.5


def test_a_command_gone_before_the_latch_never_acts(model, compiled):
    blink = BodyCommands.from_rows([(0.0, 0, 0, 0), (0.02, 100, 0, 0), (0.09, 0, 0, 0)])
    path = drive(model, blink, 0.3, plant="planar", mj_model=compiled["planar"])
    assert np.max(np.abs(path.wheels_rpm)) == 0


def test_commands_are_rounded_on_the_body(model, compiled):
    sent = [BodyCommands.constant(*c) for c in ((80.4, 29.6, 10.5), (80, 30, 10), (80, 29, 10))]
    one, same, other = (drive(model, s, 0.3, plant="planar", mj_model=compiled["planar"]).qpos for s in sent)
    np.testing.assert_array_equal(one, same)
    assert not np.array_equal(one, other)


@pytest.mark.parametrize("plant", PLANTS)
def test_each_wheel_saturates_by_itself(model, compiled, plant):
    sent = WheelCommands(np.array([0.0]), np.array([[200.0, 135.0, 135.0, 200.0]]))
    path = drive(model, sent, 2.0, plant=plant, mj_model=compiled[plant])
    np.testing.assert_allclose(path.wheels_rpm[-100:].mean(axis=0), 135.0, atol=1.0)


def test_latency_shifts_the_drive_in_time(model):
    commands = BodyCommands.constant(60)
    plain = drive(model, commands, 0.6, plant="planar")
    late = drive(model.with_effect("command_latency", delay_s=0.1), commands, 0.7, plant="planar")
    steps = round(0.1 / plain.time_s[1])
    np.testing.assert_allclose(late.wheels_rpm[steps:][: len(plain.time_s)], plain.wheels_rpm, atol=1e-9)
    assert np.max(np.abs(late.wheels_rpm[: steps + 1])) == 0


def test_commands_later_by_whole_periods_move_the_drive_later(model):
    one = drive(model, BodyCommands.from_rows([(0, 0, 0, 0), (0.1, 60, 0, 0)]), 0.6, plant="planar")
    two = drive(model, BodyCommands.from_rows([(0, 0, 0, 0), (0.3, 60, 0, 0)]), 0.8, plant="planar")
    steps = round(0.2 / one.time_s[1])
    np.testing.assert_allclose(two.pose[steps:], one.pose, atol=1e-12)


def test_each_wheel_follows_its_own_law(model, slow_law):
    path = drive(replace(model, wheels={"rl": slow_law}), BodyCommands.constant(60), 0.3)
    speeds = path.wheels_rpm[path.time_s >= 0.2].mean(axis=0)
    assert speeds[2] < 0.8 * np.min(speeds[[0, 1, 3]])


def test_an_effect_that_is_not_simulated_is_refused(model):
    with pytest.raises(InputError, match=r"effects\.low_grip: the planar plant cannot"):
        drive(model.with_effect("low_grip", friction=0.1), BodyCommands.constant(60), 0.1, plant="planar")


@pytest.mark.parametrize("duration", [0.0, -1.0, float("nan"), float("inf")])
def test_an_impossible_duration_is_refused(model, compiled, duration):
    with pytest.raises(InputError, match=f"duration_s = {duration}"):
        drive(model, BodyCommands.constant(60), duration, mj_model=compiled["planar"])


def test_channels_are_named_as_in_a_log_and_interpolated(model, compiled):
    path = drive(model, BodyCommands.constant(60, 20, 5), 0.5, plant="planar", mj_model=compiled["planar"])
    channels = path.channels_at(path.time_s)
    assert tuple(channels) == CHANNELS
    np.testing.assert_array_equal(channels["speed_rl_rpm"], path.wheels_rpm[:, 2])
    np.testing.assert_array_equal(channels["vy_m_s"], path.twist[:, 1])
    np.testing.assert_array_equal(channels["yaw_rad"], path.pose[:, 2])
    middle = path.channels_at((path.time_s[1:] + path.time_s[:-1]) / 2)
    np.testing.assert_allclose(middle["x_m"], (path.pose[1:, 0] + path.pose[:-1, 0]) / 2, rtol=1e-12)
