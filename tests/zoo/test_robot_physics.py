"""The laws of a robot on roller wheels, on a plain robot whose numbers a test can compute with."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sysid.studies.zoo.drives.drive import Controller, Drive, Gear, Link, Motor, Sensor
from sysid.studies.zoo.robots.body import GRAVITY_M_S2, plant_of
from sysid.studies.zoo.robots.contact import contact_across_m, contact_forces, normal_loads, roller_turn
from sysid.studies.zoo.robots.robot import Body, Floor, Robot, Rollers, Wheels
from sysid.studies.zoo.robots.simulate import move

RADIUS, MASS, HALF_BASE, HALF_TRACK = 0.05, 10.0, 0.15, 0.12
TOP_RPM = 60.0
SURFACE = RADIUS * TOP_RPM * 2.0 * math.pi / 60.0
"""Speed of a wheel's rim at the command of every test [m/s]."""


def plain(count=12, /, **changes):
    """A robot of 10 kg with stiff PI drives and no losses, with fields of its parts changed."""
    carried = MASS * RADIUS**2 / 4.0
    motor = Motor(
        resistance_ohm=20.0, inductance_h=1e-3, back_emf_v_s=1.0, inertia_kg_m2=0.3 * carried, supply_v=24.0
    )
    robot = Robot(
        wheels=Wheels(RADIUS, width_m=0.04, rollers=count),
        rollers=Rollers(),
        body=Body(HALF_BASE, HALF_TRACK, MASS, 0.15),
        floor=Floor(creep_m_s=0.005),
        drive=Drive(
            motor,
            Gear(wheel_inertia_kg_m2=0.1 * carried),
            Controller("pi", loop_hz=500.0, kp=1.0, ki=10.0),
            Sensor(sample_s=0.02),
            Link(period_s=0.1),
        ),
    )
    return replace(
        robot, **{part: replace(getattr(robot, part), **fields) for part, fields in changes.items()}
    )


def held(command, seconds=3.0):
    return np.tile(np.array(command, float), (round(seconds / 0.1), 1))


def settled(robot, command, seed=0):
    """Mean and standard deviation of the twist in the second half of a held command."""
    motion = move(robot, held(command), np.random.default_rng(seed))
    late = motion.twist[motion.time_s > 1.5]
    return late.mean(axis=0), late.std(axis=0)


def held_wheels(**floor):
    """A robot whose wheels cannot turn, with rollers whose axes stay at 45 degrees."""
    robot = plain(1000, floor=floor, wheels={"width_m": 0.0})
    gear = replace(robot.drive.gear, wheel_coulomb_n_m=1000.0)
    return replace(robot, drive=replace(robot.drive, gear=gear))


def test_forwards_the_body_is_as_fast_as_the_rims():
    mean, _ = settled(plain(5), (TOP_RPM, 0, 0))
    assert mean == pytest.approx([SURFACE, 0, 0], abs=2e-3 * SURFACE)


@pytest.mark.parametrize("rollers", [6, 12])
def test_sideways_a_tilted_roller_shortens_the_way_by_the_mean_of_its_cosine(rollers):
    mean, _ = settled(plain(rollers), (TOP_RPM, 90, 0))
    half = math.pi / rollers
    assert mean == pytest.approx([0, SURFACE * math.sin(half) / half, 0], abs=0.01 * SURFACE)


def test_a_turn_has_the_yaw_rate_of_the_rims_over_both_arms():
    mean, _ = settled(plain(30), (0, 0, TOP_RPM))
    assert mean[2] == pytest.approx(SURFACE / (HALF_BASE + HALF_TRACK), rel=0.01)
    assert np.hypot(*mean[:2]) < 0.01 * SURFACE


def test_roller_friction_and_a_blocked_wheel_cost_speed_sideways_but_not_forwards():
    losing = plain(rollers={"viscous_n_s_m": 15.0}), plain(rollers={"blocked_wheel": 1, "blocked_n_s_m": 1e3})
    weak = Controller("p", loop_hz=500.0, kp=0.5, feed_forward=1.0)
    for robot in losing:
        robot = replace(robot, drive=replace(robot.drive, controller=weak))
        assert settled(robot, (TOP_RPM, 0, 0))[0][0] > 0.93 * SURFACE
        assert settled(robot, (TOP_RPM, 90, 0))[0][1] < 0.9 * SURFACE


def test_the_floor_never_gives_energy():
    rng = np.random.default_rng(0)
    plant = plant_of(plain(rollers={"coulomb_n": 1.0, "viscous_n_s_m": 5.0}, floor={"rolling_n": 1.0}))
    wheels, wrench = np.zeros((4, 5)), np.zeros(3)
    for scale in np.logspace(-4, 1, 200):
        twist, angles = scale * rng.standard_normal(3), rng.uniform(0.0, 6.0, 4)
        speeds, loads = scale / RADIUS * rng.standard_normal(4), rng.uniform(0.0, 50.0, 4)
        contact_forces(plant, twist, angles, speeds, loads, wheels, wrench)
        assert wrench @ twist + wheels[:, 0] @ speeds <= 0.0


def test_a_robot_that_rolls_down_freely_gains_no_more_than_its_height_gives():
    robot = plain(7, floor={"slope_deg": 4.0, "downhill_deg": 60.0})
    free = replace(robot.drive.motor, back_emf_v_s=1e-9)
    robot = replace(robot, drive=replace(robot.drive, motor=free))
    motion = move(robot, held((0, 0, 0)), np.random.default_rng(0))
    turning = robot.drive.gear.wheel_inertia_kg_m2 + free.inertia_kg_m2
    wheels = sum(turning * wheel.wheel_rad_s**2 for wheel in motion.wheels)
    energy = 0.5 * (motion.twist**2 @ [MASS, MASS, 0.15] + wheels)
    energy -= motion.pose[:, :2] @ plant_of(robot).downhill_n
    assert np.max(np.diff(energy)) < 1e-3 * np.ptp(0.5 * wheels)
    assert np.hypot(*motion.pose[-1, :2]) > 0.5


@pytest.mark.parametrize("downhill_deg", [0.0, 90.0])
def test_held_wheels_stand_on_a_slope_below_their_grip_and_slide_above_it(downhill_deg):
    # Rollers at 45 degrees hold with grip N cos 45 along either direction.
    standing = held_wheels(slope_deg=15.0, grip=0.45, downhill_deg=downhill_deg)
    sliding = held_wheels(slope_deg=25.0, grip=0.45, downhill_deg=downhill_deg)
    speeds = [
        np.hypot(*move(robot, held((0, 0, 0), 1.0), np.random.default_rng(0)).twist[:, :2].T)
        for robot in (standing, sliding)
    ]
    assert np.max(speeds[0]) < 2.0 * standing.floor.creep_m_s
    motion = move(sliding, held((0, 0, 0), 1.0), np.random.default_rng(0))
    gained = (speeds[1][-1] - speeds[1][-500]) / (motion.time_s[-1] - motion.time_s[-500])
    slope = math.radians(25.0)
    wanted = GRAVITY_M_S2 * (math.sin(slope) - 0.45 * math.cos(slope) / math.sqrt(2.0))
    assert gained == pytest.approx(wanted, rel=0.03)


def test_a_payload_slows_the_start_and_nothing_else():
    weak = Controller("open_duty", loop_hz=500.0, feed_forward=1.0)
    light = replace(plain(), drive=replace(plain().drive, controller=weak))
    laden = replace(light, body=replace(light.body, payload_kg=10.0))
    motions = [move(robot, held((TOP_RPM, 0, 0), 6.0), np.random.default_rng(0)) for robot in (light, laden)]
    half = [motion.time_s[np.argmax(motion.twist[:, 0] > 0.5 * SURFACE)] for motion in motions]
    # The time constant is the inertia at a wheel over the motor's damping.
    assert half[1] / half[0] == pytest.approx((20.0 / 4 + 0.4 * 10.0 / 4) / (1.4 * 10.0 / 4), rel=0.03)
    assert motions[1].twist[-1, 0] == pytest.approx(motions[0].twist[-1, 0], rel=5e-3)


def test_low_grip_makes_the_wheels_spin_and_limits_the_acceleration():
    slipping = []
    for grip in (0.9, 0.1):
        motion = move(plain(floor={"grip": grip}), held((TOP_RPM, 0, 0), 0.3), np.random.default_rng(0))
        rims = RADIUS * np.mean([wheel.wheel_rad_s for wheel in motion.wheels], axis=0)
        slipping.append(np.max(rims - motion.twist[:, 0]))
        # Along the rolling direction a roller at 45 degrees pulls with at most grip N cos 45.
        rise = np.max(np.diff(motion.twist[:, 0]) / np.diff(motion.time_s))
        assert rise < 1.05 * grip * GRAVITY_M_S2 / math.sqrt(2.0)
    assert slipping[0] < 0.03
    assert slipping[1] > 0.1


def test_more_rollers_run_more_smoothly():
    ripples = [
        np.mean([settled(plain(rollers), (TOP_RPM, 90, 0), seed)[1] for seed in range(4)])
        for rollers in (4, 7, 12)
    ]
    assert ripples[0] > 1.5 * ripples[1] > 1.5**2 * ripples[2]


def test_the_contact_crosses_the_wheel_once_per_roller_and_comes_back_in_the_handover():
    plant = plant_of(plain(8))
    turns = np.array([roller_turn(plant, angle) for angle in np.linspace(0.0, 2.0 * math.pi, 20001)])
    across = np.array([contact_across_m(plant, turn) for turn in turns])
    assert np.sum(np.abs(np.diff(turns)) > 0.5) == 8
    assert np.max(np.abs(np.diff(across))) < 0.01 * plant.half_width_m
    assert np.max(across) == pytest.approx((1.0 - plant.handover) * plant.half_width_m, rel=1e-2)


def test_smaller_wheels_on_the_left_turn_a_robot_left():
    robot = plain(wheels={"radius_scale": (0.98, 1.0, 0.98, 1.0)})
    mean, _ = settled(robot, (TOP_RPM, 0, 0))
    assert mean[2] == pytest.approx(0.01 * SURFACE / (HALF_BASE + HALF_TRACK), rel=0.1)


def test_the_loads_carry_the_weight_and_balance_its_moments():
    robot = plain(body={"com_x_m": 0.03, "com_y_m": -0.02, "com_height_m": 0.08, "twist": 0.05})
    plant, loads = plant_of(robot), np.zeros(4)
    normal_loads(plant, 20.0, -10.0, loads)
    x, y = (plant.place_m + plant.com_m).T
    assert loads.sum() == pytest.approx(MASS * GRAVITY_M_S2)
    assert loads @ x == pytest.approx(plant.weight_n * 0.03 - 20.0 * 0.08)
    assert loads @ y == pytest.approx(-plant.weight_n * 0.02 + 10.0 * 0.08)
    assert loads[0] + loads[3] == pytest.approx(0.55 * plant.weight_n)


def test_a_centre_of_mass_beside_the_middle_turns_a_robot_that_starts():
    weak = Controller("open_duty", loop_hz=500.0, feed_forward=1.0)
    robot = plain(body={"com_y_m": 0.05})
    robot = replace(robot, drive=replace(robot.drive, controller=weak))
    motion = move(robot, held((TOP_RPM, 0, 0), 6.0), np.random.default_rng(0))
    # The mass on the left lags behind while the motors pull evenly.
    assert np.max(motion.twist[:, 2]) > 0.02
    assert abs(motion.twist[-1, 2]) < 2e-3


@pytest.mark.parametrize("command", [(TOP_RPM, 0, 0), (TOP_RPM, 60, 20), (0, 0, TOP_RPM)])
def test_half_the_step_gives_the_same_path(command):
    robot = plain(8, floor={"rolling_n": 0.2}, body={"com_x_m": 0.02})
    coarse, fine = (
        move(robot, held(command), np.random.default_rng(1), step_s=step_s) for step_s in (1e-4, 5e-5)
    )
    assert coarse.pose[-1] == pytest.approx(fine.pose[-1], abs=5e-4)


@pytest.mark.parametrize(("radius", "mass"), [(0.03, 1.0), (0.1, 80.0)])
def test_small_and_large_robots_run_alike(radius, mass):
    robot = plain()
    scale = mass * radius**2 / (MASS * RADIUS**2)
    motor, gear, control = robot.drive.motor, robot.drive.gear, robot.drive.controller
    drive = replace(
        robot.drive,
        motor=replace(
            motor, resistance_ohm=motor.resistance_ohm / scale, inertia_kg_m2=motor.inertia_kg_m2 * scale
        ),
        gear=replace(gear, wheel_inertia_kg_m2=gear.wheel_inertia_kg_m2 * scale),
        controller=control,
    )
    size = radius / RADIUS
    body = Body(HALF_BASE * size, HALF_TRACK * size, mass, 0.15 * mass / MASS * size**2)
    wheels = replace(robot.wheels, radius_m=radius, width_m=0.04 * size)
    scaled = replace(robot, wheels=wheels, body=body, drive=drive)
    mean, spread = settled(scaled, (TOP_RPM, 0, 0))
    assert mean[0] == pytest.approx(SURFACE * size, rel=3e-3)
    assert spread[0] < 1e-3 * SURFACE * size
