"""The robot's promises, machine-independent and short; `benchmarks/physics.py` prints the figures."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from tqdm import tqdm

from mecanum_env.kinematics import command_to_wheels
from mecanum_env.mjcf import TRAINING_TIMESTEP_S, robot_spec
from mecanum_env.mjcf.geometry import sideways_ratio
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.inputs import simulate_drive
from sysid.studies.motion import (
    coast_energy,
    follow,
    heading_drift_rad,
    largest_rise,
    paper_like_commands,
    path_difference,
    random_commands,
    start,
    steady_drive,
    warnings_of,
)

FORWARD, BACKWARD, LEFT, TURN = (80, 0, 0), (80, 180, 0), (80, 90, 0), (0, 0, 80)
DIAGONALS = [(80, 45, 0), (80, 135, 0), (80, -45, 0), (80, -135, 0)]


@pytest.fixture(scope="module")
def coarse(packaged):
    return robot_spec(packaged, TRAINING_TIMESTEP_S, visuals=False).compile()


@pytest.fixture(scope="module")
def fine(packaged):
    return robot_spec(packaged, 1 / 960, visuals=False).compile()


@pytest.mark.parametrize("command", [FORWARD, BACKWARD, (10, 0, 0), (130, 0, 0)])
def test_forward_the_wheels_roll_without_loss(rollers, packaged, command):
    assert steady_drive(rollers, packaged.robot, command, 1.5).ratio == pytest.approx(1.0, abs=0.01)


def test_sideways_the_rollers_give_up_sinc_pi_over_n(rollers, packaged):
    ratio = steady_drive(rollers, packaged.robot, LEFT, 1.5).ratio
    assert ratio == pytest.approx(sideways_ratio(packaged.robot.rollers_per_wheel), rel=0.01)


@pytest.mark.parametrize("command", [TURN, *DIAGONALS[:2], (60, 30, 30)])
def test_turning_and_diagonal_drives_are_as_the_rollers_geometry_says(rollers, packaged, command):
    drive = steady_drive(rollers, packaged.robot, command, 1.5)
    assert drive.ratio == pytest.approx(drive.expected_ratio, rel=0.01)


def test_the_base_hardly_bounces(rollers, packaged):
    assert steady_drive(rollers, packaged.robot, FORWARD, 1.5).bounce_m <= 50e-6


@pytest.mark.parametrize(("command", "degrees"), [(FORWARD, 0.5), *((c, 1.0) for c in [LEFT, *DIAGONALS])])
def test_the_heading_holds_over_three_metres(rollers, command, degrees):
    assert abs(np.rad2deg(heading_drift_rad(rollers, command))) <= degrees


@pytest.mark.parametrize("seed", range(3))
def test_the_path_hardly_depends_on_the_time_step(coarse, fine, seed):
    commands = paper_like_commands(seed)
    assert path_difference(follow(fine, commands), follow(coarse, commands)) <= 0.01


def test_a_slipping_wheel_does_not_ring(packaged):
    """On a floor with little grip its speed changes smoothly.

    MuJoCo's own clamp, as the plain servo has it, makes it jump to and fro at the step rate while it spins.
    """
    slippery = replace(packaged, robot=replace(packaged.robot, friction=0.3))
    plugin, servo = (np.diff(wheel_speeds(slippery, drive)) for drive in ("plugin", "servo"))
    assert reversals(servo) > 20
    assert reversals(plugin) == 0
    assert np.abs(plugin).max() < 15 * RAD_S_PER_RPM < np.abs(servo).max()


def test_planar_and_rollers_drive_the_same_path(rollers, planar):
    commands = paper_like_commands(seed=1)
    assert path_difference(follow(rollers, commands), follow(planar, commands)) <= 0.03


@pytest.mark.parametrize("command", [FORWARD, LEFT, DIAGONALS[0], TURN, (60, 30, 30)])
def test_coasting_never_gains_energy(rollers, command):
    energy = coast_energy(rollers, command, 1.0)
    assert largest_rise(energy) <= 0.020
    assert energy[-1] < energy[0]


def test_ten_seconds_of_random_commands_raise_no_warning(rollers):
    assert warnings_of(random_drive(rollers, 100)) == {}


@pytest.mark.slow
def test_an_hour_of_random_commands_raises_no_warning(rollers):
    data = random_drive(rollers, 36_000)
    assert warnings_of(data) == {}
    assert np.all(np.isfinite(data.qpos))
    # Still on its wheels.
    assert data.body("base").xmat[8] > 0.99
    assert data.body("base").xpos[2] == pytest.approx(0.0762, abs=1e-3)


def wheel_speeds(model, drive: str) -> np.ndarray:
    """Return the speed [rad/s] of a wheel at each substep of a start to 130 rpm, 0.3 s long."""
    mj_model = robot_spec(model, drive=drive, visuals=False).compile()
    data = start(mj_model)
    steps = round(0.3 / mj_model.opt.timestep)
    setpoints = simulate_drive(model.wheel.drive_parameters(), np.full(steps, 130.0), 1 / 480)
    speeds = np.empty(steps)
    for i, setpoint in enumerate(setpoints * RAD_S_PER_RPM):
        data.ctrl[:] = 130.0 if drive == "plugin" else setpoint
        mujoco.mj_step(mj_model, data)
        speeds[i] = data.joint("wheel_fl").qvel[0]
    return speeds


def reversals(changes: np.ndarray) -> int:
    """Return how often a change of more than 10 rpm is followed by its opposite."""
    large = np.abs(changes) > 10 * RAD_S_PER_RPM
    return int(np.sum((changes[1:] * changes[:-1] < 0) & large[1:] & large[:-1]))


def random_drive(mj_model: mujoco.MjModel, count: int) -> mujoco.MjData:
    data = start(mj_model)
    for command in tqdm(random_commands(count, seed=0, v_rpm=100, vc_rpm=60), disable=count < 1000):
        data.ctrl[:] = command_to_wheels(*command)
        mujoco.mj_step(mj_model, data, nstep=round(0.1 / mj_model.opt.timestep))
    return data
