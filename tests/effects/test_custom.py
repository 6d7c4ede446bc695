"""Custom effects: each station does what it says, on every plant."""

import numpy as np
import pytest

from mecanum_env.effects.apply import drive_parameters, measured, without_sensors
from mecanum_env.errors import InputError
from mecanum_env.mjcf.plants import bench_spec
from mecanum_env.model import CustomEffect, CustomTable
from mecanum_env.simulator.bench import bench_motion, replay_bench
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.inputs import simulate_drive
from tests.effects.conftest import channels

LEVELS = np.array([0.0, 60.0, 3.0, -60.0, 0.0])


def settled(model):
    """Return the speed [rpm] at the end of each level, and its spread over the last half second."""
    clock, speed = bench_motion(model, np.arange(5) * 2.0, LEVELS, 10.0)
    ends = [speed[(clock > 2 * i + 1.5) & (clock < 2 * i + 2.0)] for i in range(5)]
    return np.array([end.mean() for end in ends]), np.array([np.ptp(end) for end in ends])


@pytest.mark.parametrize(
    ("station", "formula", "expected"),
    [
        ("command", "2", [2, 62, 5, -58, 2]),
        ("command", "-0.1 * command", [0, 54, 2.7, -54, 0]),
        ("set_point", "-4 * sign(command)", [0, 56, -1, -56, 0]),
        ("set_point", "100", [100, 135, 103, 40, 100]),  # before the saturation
        ("load", "2", [2, 62, 5, -58, 2]),
        ("load", "-0.5 * speed", [0, 40, 2, -40, 0]),  # the value at the wheel's speed, not the command's
        ("load", "-5 * speed", [0, 10, 0.5, -10, 0]),
        ("load", "-5 * sign(speed)", [0, 55, 0, -55, 0]),  # holds the wheel at small commands
        ("load", "0.1 * command", [0, 66, 3.3, -66, 0]),
        ("sensor", "-0.02 * speed", [0, 60, 3, -60, 0]),
    ],
)
def test_speeds_settle_where_the_formula_says(base, station, formula, expected):
    means, spreads = settled(base.with_custom(CustomEffect(station, formula)))
    np.testing.assert_allclose(means, expected, atol=1e-3)
    np.testing.assert_allclose(spreads, 0.0, atol=1e-3)


def test_the_dead_band_sees_the_changed_command_and_the_set_point_does_not(base):
    plain = base.with_effect("command_deadband", threshold_rpm=10.0)
    before, _ = settled(plain.with_custom(CustomEffect("command", "8")))
    behind, _ = settled(plain.with_custom(CustomEffect("set_point", "8")))
    np.testing.assert_allclose(before, [0, 68, 11, -52, 0], atol=1e-3)
    np.testing.assert_allclose(behind, [8, 68, 8, -52, 8], atol=1e-3)


def test_several_effects_of_a_station_add_up(base):
    table = CustomTable("command", (-100.0, 0.0, 100.0), (-10.0, 0.0, 10.0))
    both = base.with_custom(CustomEffect("set_point", "1"), CustomEffect("set_point", table=table))
    np.testing.assert_allclose(settled(both)[0], [1, 67, 4.3, -65, 1], atol=1e-3)


def test_time_counts_from_the_start(base):
    model = base.with_custom(CustomEffect("load", "5 * exp(-time / 2)"))
    clock, speed = bench_motion(model, np.array([0.0]), np.array([0.0]), 6.0)
    np.testing.assert_allclose(speed[240:], 5 * np.exp(-clock[240:] / 2), atol=0.01)


def test_the_angle_is_that_of_the_wheel(base):
    model = base.with_custom(CustomEffect("load", "4 * sin(3 * angle)"))
    clock, speed = bench_motion(model, np.array([0.0]), np.array([50.0]), 4.0)
    angle = np.cumsum(speed) * (clock[1] - clock[0]) * RAD_S_PER_RPM
    np.testing.assert_allclose(speed[480:], 50 + 4 * np.sin(3 * angle[480:]), atol=0.25)


def test_a_sensor_adds_to_the_measured_wheel_speeds_alone(base):
    model = base.with_custom(CustomEffect("sensor", "0.1 * speed * sin(angle) + time"))
    clock = np.arange(200) * 0.01
    true = {"speed_fl_rpm": 40 + 0 * clock, "vx_m_s": 0.3 + 0 * clock}
    shown = measured(model, clock, true)
    angle = 40 * RAD_S_PER_RPM * clock
    np.testing.assert_allclose(shown["speed_fl_rpm"], 40 + 4 * np.sin(angle) + clock, atol=1e-9)
    np.testing.assert_array_equal(shown["vx_m_s"], true["vx_m_s"])
    assert without_sensors(model).custom == ()


def test_a_sensor_sees_before_it_is_late(base):
    model = base.with_custom(CustomEffect("sensor", "10 * time")).with_effect("sensor_latency", delay_s=0.5)
    shown = replay_bench(model, np.array([0.0, 1.0, 2.0]), np.zeros(3))
    np.testing.assert_allclose(shown, [0.0, 5.0, 15.0], atol=1e-6)


@pytest.mark.parametrize("plant", ["bench", "rollers", "planar"])
@pytest.mark.parametrize("station", ["command", "set_point", "load", "sensor"])
def test_every_plant_simulates_every_station(base, plain, plant, station):
    found = channels(base.with_custom(CustomEffect(station, "-0.2 * speed * abs(sin(3 * angle))")), plant)
    assert np.max(np.abs(found - plain(plant))) > 1.0
    nothing = channels(base.with_custom(CustomEffect(station, "0 * speed")), plant)
    np.testing.assert_array_equal(nothing, plain(plant))


def test_a_load_without_the_plugin_is_refused(base):
    with pytest.raises(InputError, match="a custom load need the plugin"):
        bench_spec(base.with_custom(CustomEffect("load", "1")), drive="servo")


def test_commands_alone_do_not_give_the_set_points_of_a_formula_over_the_speed(base):
    def setpoints(formula):
        model = base.with_custom(CustomEffect("set_point", formula))
        return simulate_drive(drive_parameters(model), np.full(400, 5.0), 0.01)

    assert setpoints("command")[-1] == pytest.approx(10.0, abs=1e-6)
    with pytest.raises(InputError, match="uses the wheel's speed or angle"):
        setpoints("speed")
