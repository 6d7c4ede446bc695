"""Textbook signatures of friction, load, grip, geometry and slope."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects.apply import changed_model
from mecanum_env.kinematics import command_to_twist
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import RAD_S_PER_RPM

TIME = np.arange(0.0, 1.0, 0.01)


def bench_steady(model, command):
    return replay_bench(model, TIME, np.full(TIME.shape, float(command)))[-20:].mean()


def speed_along(path, command, model, after=1.0):
    """Return the mean velocity along the commanded direction over the ideal one."""
    ideal = command_to_twist(*command, model.robot)
    twist = path.twist[path.time_s >= after].mean(axis=0)
    return twist @ ideal / (ideal @ ideal)


def loss(steady, model, base, *command, plant="rollers"):
    """Return the part of the speed that an effect costs."""
    with_it, without = (speed_along(steady(m, *command, plant=plant), command, base) for m in (model, base))
    return 1 - with_it / without


@pytest.mark.parametrize("command", [20, 60, 120, -60])
def test_coulomb_friction_costs_a_free_wheel_torque_over_servo(base, command):
    model = base.with_effect("coulomb_friction", torque_n_m=0.3)
    lost = 0.3 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM
    assert bench_steady(model, command) == pytest.approx(command - np.sign(command) * lost, abs=1e-3)


@pytest.mark.parametrize("command", [20, 60, 120, -60])
def test_viscous_friction_costs_a_free_wheel_the_same_share_at_every_speed(base, command):
    model = base.with_effect("viscous_friction", damping_n_m_s_rad=0.2)
    kv = base.robot.servo_n_m_s_rad
    assert bench_steady(model, command) == pytest.approx(command * kv / (kv + 0.2), rel=1e-4)


@pytest.mark.parametrize(
    ("name", "values"),
    [("coulomb_friction", {"torque_n_m": 0.1}), ("viscous_friction", {"damping_n_m_s_rad": 0.05})],
)
def test_with_integral_action_friction_leaves_no_loss(base, name, values):
    integrating = replace(base, robot=replace(base.robot, servo_integral_n_m_rad=50.0))
    model = integrating.with_effect(name, **values)
    assert bench_steady(model, 60) == pytest.approx(60, abs=0.02)
    command = np.full(TIME.shape, 60.0)
    start = replay_bench(model, TIME, command) - replay_bench(integrating, TIME, command)
    assert np.min(start) < -0.1


def test_a_held_wheel_does_not_creep(base):
    # The servo pulls with less than the friction: 0.5 rpm of error is 0.26 N m.
    fine = replace(base, wheel=replace(base.wheel, command_quantum_rpm=0.0))
    speed = replay_bench(fine.with_effect("coulomb_friction", torque_n_m=0.3), TIME, np.full(TIME.shape, 0.5))
    assert np.max(np.abs(speed)) < 0.005


def test_coulomb_friction_costs_less_the_faster(base, steady):
    model = base.with_effect("coulomb_friction", torque_n_m=0.3)
    losses = [loss(steady, model, base, v, 0, 0) for v in (20, 40, 80)]
    assert losses[0] > 1.5 * losses[1] > 2.0 * losses[2] > 0.005


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_viscous_friction_costs_the_same_share_on_the_floor(base, steady, plant):
    kv, damping = base.robot.servo_n_m_s_rad, 0.1
    model = base.with_effect("viscous_friction", damping_n_m_s_rad=damping)
    for command in ((30, 0, 0), (80, 0, 0), (60, 90, 0), (0, 0, 40)):
        lost = loss(steady, model, base, *command, plant=plant)
        assert lost == pytest.approx(1 - kv / (kv + damping), abs=0.006)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_roller_friction_costs_sideways_but_not_forward(base, steady, plant):
    model = base.with_effect("roller_friction", damping_n_m_s_rad=0.003, torque_n_m=0.02)
    assert loss(steady, model, base, 60, 90, 0, plant=plant) > 0.02
    assert abs(loss(steady, model, base, 60, 0, 0, plant=plant)) < 0.002


@pytest.mark.parametrize("values", [{"torque_n_m": 0.08}, {"damping_n_m_s_rad": 0.002}])
@pytest.mark.parametrize("rollers", [6, 10])
def test_roller_friction_slows_the_wheels_without_slip_as_on_rollers(base, values, rollers):
    base = replace(base, robot=replace(base.robot, rollers_per_wheel=rollers))
    rough = base.with_effect("roller_friction", **values)

    def slower_rpm(plant, *command):
        """Return how much the friction slows the wheels down, in the mean of the last second."""
        with_it, without = (
            np.mean(np.abs(drive(model, BodyCommands.constant(*command), 2.0, plant=plant).wheels_rpm[-480:]))
            for model in (rough, base)
        )
        return without - with_it

    for command in ((60, 90, 0), (0, 0, 40)):
        assert slower_rpm("planar", *command) == pytest.approx(slower_rpm("rollers", *command), rel=0.15)


def test_low_grip_spins_the_wheels_in_a_hard_start_and_spares_a_gentle_one(base):
    model = base.with_effect("low_grip", friction=0.1)
    ramp = BodyCommands.from_rows([(0.1 * i, 4.0 * i, 0, 0) for i in range(16)])
    for commands, slips in ((BodyCommands.constant(80), True), (ramp, False)):
        slippery, sound = (drive(m, commands, 1.5) for m in (model, base))
        rolled = slippery.wheels_rpm.mean(axis=1) * RAD_S_PER_RPM * base.robot.wheel_radius_m
        slip = np.max(np.abs(rolled - slippery.twist[:, 0]))
        assert (slip > 0.2) if slips else (slip < 0.03)
        assert slippery.twist[-1, 0] == pytest.approx(sound.twist[-1, 0], abs=0.005)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_payload_slows_the_rise_but_not_the_speed(base, steady, plant):
    loaded, empty = (
        steady(m, 80, 0, 0, plant=plant).twist[:, 0]
        for m in (base.with_effect("payload", mass_kg=15.0), base)
    )
    reached = empty[-100:].mean()
    assert loaded[-100:].mean() == pytest.approx(reached, rel=2e-3)
    rises = [int(np.argmax(vx > 0.9 * reached)) for vx in (loaded, empty)]
    assert rises[0] > 1.3 * rises[1]


def test_a_high_payload_tips_weight_backwards_in_a_start(base, steady):
    grip = base.with_effect("low_grip", friction=0.25)
    low, high = (
        steady(grip.with_effect("payload", mass_kg=10.0, height_m=h), 100, 0, 0, seconds=0.25)
        for h in (0.1, 0.6)
    )
    front = [path.wheels_rpm[:, :2].mean() - path.wheels_rpm[:, 2:].mean() for path in (low, high)]
    assert front[1] > front[0] + 1.0


@pytest.mark.parametrize("plant", ["rollers", "planar"])
def test_a_weight_to_the_left_turns_a_start_left_and_a_stop_right(base, plant):
    # With more grip than needed: an unloaded wheel that slips would turn the robot further.
    model = replace(base, robot=replace(base.robot, friction=2.0))
    commands = BodyCommands.from_rows([(0, 40, 0, 0), (0.7, 0, 0, 0)])
    path = drive(model.with_effect("com_offset", y_m=0.03), commands, 1.0, plant=plant)
    rate = path.twist[:, 2]
    starting, stopping = path.time_s < 0.1, (path.time_s > 0.7) & (path.time_s < 0.8)
    assert rate[starting].mean() > 0.01
    assert rate[stopping].mean() < -0.01
    other = drive(model.with_effect("com_offset", y_m=-0.03), commands, 1.0, plant=plant)
    assert other.twist[starting, 2].mean() < -0.01


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize("command", [(60, 0, 0), (60, 90, 0), (0, 0, 40)])
def test_larger_wheels_move_the_body_further_at_the_same_wheel_speed(base, steady, plant, command):
    path = steady(base.with_effect("wheel_radius", scale=1.1), *command, plant=plant)
    plain = steady(base, *command, plant=plant)
    assert speed_along(path, command, base) / speed_along(plain, command, base) == pytest.approx(
        1.1, abs=0.004
    )
    late = path.time_s >= 1.0
    np.testing.assert_allclose(
        path.wheels_rpm[late].mean(axis=0), plain.wheels_rpm[late].mean(axis=0), atol=0.2
    )


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize(("command", "ratio"), [((60, 0, 0), 1.0), ((60, 90, 0), 1.0), ((0, 0, 40), 1 / 1.2)])
def test_a_wider_track_slows_rotation_only(base, steady, plant, command, ratio):
    wide, plain = (
        speed_along(steady(m, *command, plant=plant), command, base)
        for m in (base.with_effect("track_width", scale=1.2), base)
    )
    assert wide / plain == pytest.approx(ratio, abs=0.004)


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize("scale", [0.95, 1.05])
def test_a_robot_whose_wheels_have_most_of_its_yaw_inertia_may_be_wider(base, steady, plant, scale):
    wheels_alone = base.robot.yaw_inertia_kg_m2 - robot_masses(base.robot).base.moments[2]
    light = replace(base, robot=replace(base.robot, yaw_inertia_kg_m2=1.01 * wheels_alone))
    turning = (0, 0, 40)
    wide, plain = (
        speed_along(steady(m, *turning, plant=plant), turning, base)
        for m in (light.with_effect("track_width", scale=scale), light)
    )
    assert wide / plain == pytest.approx(1.0 / scale, abs=0.004)
    robot = changed_model(light.with_effect("track_width", scale=scale), plant).robot
    assert robot.yaw_inertia_kg_m2 == pytest.approx(scale**2 * light.robot.yaw_inertia_kg_m2)
    assert robot.mass_kg == light.robot.mass_kg


@pytest.mark.parametrize("plant", ["rollers", "planar"])
@pytest.mark.parametrize("heading", [0, 90, 180, -45])
def test_a_slope_pulls_downhill_in_the_world(base, steady, plant, heading):
    model = base.with_effect("floor_slope", slope_deg=4.0, heading_deg=heading)
    path, level = (steady(m, 0, 0, 0, plant=plant) for m in (model, base))
    moved = path.pose[-1, :2] - level.pose[-1, :2]
    downhill = np.array([np.cos(np.deg2rad(heading)), np.sin(np.deg2rad(heading))])
    assert moved @ downhill > 1e-3
    assert np.linalg.norm(moved - (moved @ downhill) * downhill) < 0.1 * moved @ downhill
    # At rest the servos' droop holds gravity, m g sin(slope).
    weight = base.robot.mass_kg * 9.81 * np.sin(np.deg2rad(4.0))
    radius = base.robot.wheel_radius_m
    creep = weight * radius / 4 / base.robot.servo_n_m_s_rad * radius
    assert moved @ downhill / path.time_s[-1] == pytest.approx(creep, rel=0.15)


def test_the_slope_goes_with_the_world_not_with_the_body(base):
    model = base.with_effect("floor_slope", slope_deg=5.0, heading_deg=0.0)
    turn = BodyCommands.from_rows([(0, 60, 0, 0), (1.0, 0, 0, 60), (3.0, 60, 0, 0)])
    hilly, level = (drive(m, turn, 4.0, plant="planar") for m in (model, base))
    gained = np.mean(hilly.wheels_rpm - level.wheels_rpm, axis=1)
    for seconds in (0.8, 3.8):
        at = np.abs(hilly.time_s - seconds) < 0.1
        heading = level.pose[at, 2].mean()
        assert gained[at].mean() == pytest.approx(0.62 * np.cos(heading), abs=0.15)


def test_a_weak_servo_rises_later_under_load_only(base, steady):
    model = base.with_effect("weak_servo", servo_n_m_s_rad=0.5)
    weak, strong = (steady(m, 80, 0, 0).twist[:, 0] for m in (model, base))
    reached = strong[-100:].mean()
    rises = [int(np.argmax(vx > 0.9 * reached)) for vx in (weak, strong)]
    assert rises[0] > 1.2 * rises[1]
    assert weak[-50:].mean() == pytest.approx(reached, rel=0.01)
    assert bench_steady(model, 60) == pytest.approx(bench_steady(base, 60), abs=0.01)
    resisted = [
        60 - bench_steady(m.with_effect("coulomb_friction", torque_n_m=0.3), 60) for m in (model, base)
    ]
    assert resisted[0] == pytest.approx(10 * resisted[1], rel=0.01)


def test_effects_compose(base, steady):
    """The friction's droop, larger wheels and a payload act at once, each as it does alone."""
    model = (
        base.with_effect("coulomb_friction", torque_n_m=0.3)
        .with_effect("wheel_radius", scale=1.1)
        .with_effect("payload", mass_kg=10.0)
    )
    path = steady(model, 60, 0, 0)
    late = path.time_s >= 1.2
    wheels = path.wheels_rpm[late].mean()
    assert wheels == pytest.approx(60 - 0.3 / base.robot.servo_n_m_s_rad / RAD_S_PER_RPM, abs=0.1)
    radius = 1.1 * base.robot.wheel_radius_m
    assert path.twist[late, 0].mean() == pytest.approx(wheels * RAD_S_PER_RPM * radius, rel=3e-3)
    assert float(np.sum(path.mj_model.body_mass)) == pytest.approx(base.robot.mass_kg + 10.0)
