"""Textbook signatures of backlash and of friction near rest."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.mjcf import bench_spec, planar_spec, robot_spec
from mecanum_env.plugin.layout import write_parameters
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import RAD_S_PER_RPM

TIME = np.arange(0.0, 2.0, 1 / 480)
STAIRS = np.select([TIME < 0.5, TIME < 1.0, TIME < 1.5], [30.0, 60.0, -60.0], -20.0)


def slipped_deg(model, base, command, start, end):
    """Return the angle that the wheel with an effect gains on that without, from start to end."""
    between = np.clip(TIME, start, end - 1e-9) == TIME
    ahead = replay_bench(model, TIME, command) - replay_bench(base, TIME, command)
    return np.sum(ahead[between]) * RAD_S_PER_RPM / 480 * 180 / np.pi


@pytest.mark.parametrize("gap", [1.0, 4.0, 15.0])
def test_each_reversal_costs_the_gap_and_the_first_start_half_of_it(base, gap):
    model = base.with_effect("backlash", gap_deg=gap)
    # The motor turns through the gap before the wheel follows. Then the wheel must catch up, which costs
    # inertia / servo times the jump in speed as well.
    assert slipped_deg(model, base, STAIRS, 0.0, 0.5) == pytest.approx(-gap / 2, rel=0.02, abs=0.05)
    assert slipped_deg(model, base, STAIRS, 0.5, 1.0) == pytest.approx(0.0, abs=1e-3)
    assert slipped_deg(model, base, STAIRS, 1.0, 1.5) == pytest.approx(gap, rel=0.02, abs=0.15)


def test_in_the_gap_the_wheel_coasts(base):
    speed = replay_bench(base.with_effect("backlash", gap_deg=15.0), TIME, STAIRS)
    coasting = (TIME > 1.0) & (TIME < 1.03)
    np.testing.assert_allclose(speed[coasting], 60.0, atol=0.01)


def test_steady_motion_knows_no_backlash(base):
    ahead = replay_bench(base.with_effect("backlash", gap_deg=15.0), TIME, STAIRS) - replay_bench(
        base, TIME, STAIRS
    )
    for end in (0.5, 1.0, 1.5, 2.0):
        late = np.abs(TIME - end + 0.05) < 0.05
        assert np.max(np.abs(ahead[late])) < 0.01


def test_a_wheel_that_turns_when_the_log_starts_has_closed_its_gap(base):
    model = base.with_effect("backlash", gap_deg=10.0)
    going, plain = (replay_bench(m, TIME, np.full(TIME.shape, 80.0), initial_rpm=40.0) for m in (model, base))
    np.testing.assert_allclose(going, plain, atol=0.01)


def test_backlash_and_friction_compose(base):
    """Friction pushes the wheel to the side from which it is driven, and slows it in the gap."""
    rubbing = base.with_effect("coulomb_friction", torque_n_m=0.2)
    model = rubbing.with_effect("backlash", gap_deg=15.0)
    speed = replay_bench(model, TIME, STAIRS)
    lost = 0.2 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert speed[TIME < 0.99][-1] == pytest.approx(60 - lost, abs=0.01)
    coasting = (TIME > 1.0) & (TIME < 1.025)
    assert speed[coasting][-1] < 58.0


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_on_the_floor_a_reversal_comes_later(base, plant):
    commands = BodyCommands.from_rows([(0.0, 60, 0, 0), (0.6, -60, 0, 0)])
    loose, tight = (
        drive(m, commands, 1.2, plant=plant) for m in (base.with_effect("backlash", gap_deg=4.0), base)
    )
    turned = [path.time_s[np.argmax((path.time_s > 0.6) & (path.twist[:, 0] < 0))] for path in (loose, tight)]
    assert turned[0] > turned[1] + 0.01
    assert loose.twist[-1, 0] == pytest.approx(tight.twist[-1, 0], abs=0.02)


@pytest.fixture
def sticky(base):
    """Return a wheel that takes commands in fractions of 1 rpm and sticks with 0.3 N m."""
    fine = replace(base, wheel=replace(base.wheel, command_quantum_rpm=0.0))
    return fine.with_effect("stiction", breakaway_n_m=0.3, stribeck_rpm=3.0)


def reached(model, command):
    return replay_bench(model, TIME, np.full(TIME.shape, float(command)))[-1]


def test_a_stuck_wheel_starts_only_beyond_the_breakaway(base, sticky):
    edge = 0.3 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert abs(reached(sticky, 0.9 * edge)) < 0.005
    assert reached(sticky, 1.2 * edge) > 0.1


@pytest.mark.parametrize("command", [1.0, 3.0, -2.0, 6.0, 40.0])
def test_friction_falls_with_speed_as_stribeck_says(base, sticky, command):
    speed = reached(sticky, command)
    torque = base.robot.servo_n_m_s_rad * (command - speed) * RAD_S_PER_RPM
    assert torque == pytest.approx(np.sign(command) * 0.3 * np.exp(-((speed / 3.0) ** 2)), abs=1e-3)


def test_stiction_comes_on_top_of_coulomb_friction(base, sticky):
    both = sticky.with_effect("coulomb_friction", torque_n_m=0.1)
    lost = 0.1 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert reached(both, 40.0) == pytest.approx(40.0 - lost, abs=1e-3)
    assert abs(reached(both, 2 * lost)) < 0.005


def test_with_integral_action_a_stuck_wheel_comes_free_at_last(sticky):
    integrating = replace(sticky, robot=replace(sticky.robot, servo_integral_n_m_rad=50.0))
    command = np.full(TIME.shape, 0.4)
    speed = replay_bench(integrating, TIME, command)
    assert abs(speed[TIME < 0.05][-1]) < 0.01
    assert np.max(speed) > 0.3
    assert abs(reached(sticky, 0.4)) < 0.005


def test_drives_without_the_plugin_refuse_what_lies_behind_the_law(base):
    behind = {"backlash": "gap_deg", "stiction": "breakaway_n_m", "coulomb_friction": "torque_n_m"}
    for name, values in ((name, {parameter: 0.1}) for name, parameter in behind.items()):
        with pytest.raises(InputError, match='need the plugin, drive="plugin"'):
            bench_spec(base.with_effect(name, **values), drive="servo")


def test_the_planar_plant_without_plugins_refuses_the_friction_of_rollers(base):
    model = base.with_effect("roller_friction", torque_n_m=0.05)
    with pytest.raises(InputError, match=r'effects\.roller_friction needs the plugin, drive="plugin"'):
        planar_spec(model, drive="servo")
    robot_spec(model, drive="servo")


def test_friction_can_be_written_into_a_compiled_model(base):
    model = base.with_effect("stiction", breakaway_n_m=0.1).with_effect("coulomb_friction", torque_n_m=0.2)
    rewritten, anew = bench_spec(base).compile(), bench_spec(model).compile()
    write_parameters(rewritten, 0, model, torque_limit_n_m=np.inf)
    np.testing.assert_array_equal(rewritten.actuator_user, anew.actuator_user)


def test_a_wheel_sticks_as_long_as_it_can_and_then_needs_less_to_go_on(sticky):
    edge = 0.3 / sticky.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    speed = replay_bench(sticky, TIME, np.where(TIME < 0.5, 0.95 * edge, 6.0))
    assert abs(speed[TIME < 0.5][-1]) < 1e-9
    assert speed[-1] > 5.9


@pytest.fixture
def integrating(base):
    """Return a drive with integral action that unwinds slowly."""
    return replace(base, robot=replace(base.robot, servo_integral_n_m_rad=25.0))


def test_the_integral_does_not_wind_up_in_the_gap(base, integrating):
    """The motor follows the law in the gap, so the wheel moves as without integral action."""
    loose, plain = (
        replay_bench(m.with_effect("backlash", gap_deg=15.0), TIME, STAIRS) for m in (integrating, base)
    )
    assert np.max(np.abs(loose - plain)) < 0.5
    # In the gap the two hardly differ; outside, only by the impact at the end of it.
    assert np.max(np.abs((loose - plain)[(TIME > 1.0) & (TIME < 1.03)])) < 0.05


def test_in_the_gap_the_motor_gives_up_what_the_load_had_asked_for(integrating):
    """The unloaded motor empties the integral that friction has charged: the wheel returns to its speed."""
    model = integrating.with_effect("coulomb_friction", torque_n_m=0.3).with_effect("backlash", gap_deg=10.0)
    speed = replay_bench(model, TIME, STAIRS)
    for end, command in ((0.5, 30.0), (1.0, 60.0), (1.5, -60.0)):
        assert speed[end > TIME][-1] == pytest.approx(command, abs=0.6)


def test_on_a_slope_friction_holds_a_robot_or_slows_its_creep(base, steady):
    """Wheels stand perfectly still if the friction exceeds the slope's pull, and creep otherwise."""
    need = base.robot.mass_kg * 9.81 * np.sin(np.radians(5.0)) * base.robot.wheel_radius_m / 4
    slope = base.with_effect("floor_slope", slope_deg=5.0, heading_deg=0.0)
    for plant in ("rollers", "planar"):
        for friction in (0.5, 1.5, 3.0):
            model = slope.with_effect("coulomb_friction", torque_n_m=friction * need)
            wheels = steady(model, 0, seconds=1.0, plant=plant).wheels_rpm[-200:]
            creep = max(0.0, 1.0 - friction) * need / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
            np.testing.assert_allclose(wheels, creep, atol=0.02 if creep == 0.0 else 0.25 * creep)
            assert np.max(np.abs(np.diff(wheels, axis=0))) < 1e-3


@pytest.mark.parametrize("command", [(60, 0, 0), (60, 30, 0), (0, 0, 30)])
def test_planar_and_rollers_lose_the_same_to_friction(base, steady, command):
    model = base.with_effect("coulomb_friction", torque_n_m=0.5)
    lost = [
        np.abs(steady(base, *command, plant=plant).wheels_rpm[-200:].mean(axis=0))
        - np.abs(steady(model, *command, plant=plant).wheels_rpm[-200:].mean(axis=0))
        for plant in ("rollers", "planar")
    ]
    np.testing.assert_allclose(lost[1], 0.5 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM, rtol=1e-3)
    assert np.mean(lost[0]) == pytest.approx(np.mean(lost[1]), rel=0.03)
