"""The torque limit: on what the wheel gets, not on what is reported, and without ringing."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import Robot, paper_model
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, drive_state, set_steady, write_parameters
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.inputs import simulate_drive

STEP = 1 / 480
KV = 5.0


def drive(mjmodel, commands, loads=0.0, data=None):
    """Step through commands [rpm] against loads [N m]; return the speeds [rad/s] at each substep."""
    data = mujoco.MjData(mjmodel) if data is None else data
    speeds = []
    for command, load in np.broadcast(commands, loads):
        data.ctrl[0], data.qfrc_applied[0] = command, -load
        mujoco.mj_step(mjmodel, data)
        speeds.append(data.qvel[0])
    return np.array(speeds)


def torques(mjmodel, speeds, loads=0.0):
    """Return what the drive gave the free wheel in each substep [N m], by its acceleration from rest."""
    acceleration = np.diff(speeds, prepend=0.0) / mjmodel.opt.timestep
    return mjmodel.dof_M0[0] * acceleration + loads


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("limit", [0.05, 0.1])
@pytest.mark.parametrize("load", [0.0, 0.03])
def test_a_free_wheel_accelerates_by_the_limit(compile_wheels, free_model, sign, limit, load):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=limit))
    given_torque = torques(mjmodel, drive(mjmodel, np.full(80, 130.0 * sign), load * sign), load * sign)
    # Limited all the time; 60 substeps on, 0.86^60 of the lag is left.
    np.testing.assert_allclose(given_torque[60:], sign * limit, rtol=1e-3)
    assert np.abs(given_torque).max() <= limit * (1 + 1e-9)


@pytest.mark.parametrize("timestep", [1 / 240, 1 / 480, 1 / 960])
@pytest.mark.parametrize("kv", [1.0, 5.0])
def test_the_lag_of_the_limit_decays_as_documented(compile_wheels, free_model, timestep, kv):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.1, servo_n_m_s_rad=kv), timestep=timestep)
    missing = 0.1 - torques(mjmodel, drive(mjmodel, np.full(16, 130.0)))
    stiffness = kv * timestep
    factor = stiffness / (mjmodel.dof_M0[0] + stiffness)
    np.testing.assert_allclose(missing[6:] / missing[5:-1], factor, rtol=1e-6)


@given(seed=st.integers(0, 2**32 - 1), limit=st.floats(0.1, 1.0), ki=st.sampled_from([0.0, 20.0]))
def test_the_error_of_the_limit_is_bounded_by_the_change_of_acceleration(compile_wheels, seed, limit, ki):
    robot = Robot(torque_limit_n_m=limit, servo_integral_n_m_rad=ki)
    mjmodel = compile_wheels(replace(paper_model(), robot=robot))
    rng = np.random.default_rng(seed)
    commands, loads = np.repeat(rng.uniform(-130, 130, 5), 48), np.repeat(rng.uniform(-0.5, 0.5, 5), 48)
    speeds = drive(mjmodel, commands, loads)
    jump = np.diff(speeds, n=2, prepend=[0.0, 0.0])
    excess = np.abs(torques(mjmodel, speeds, loads)) - limit
    assert np.all(excess <= KV * np.abs(jump) + 1e-9)


def test_a_free_wheel_does_not_ring_after_saturation(compile_wheels, free_model):
    """MuJoCo's own clamp rings here; the wheel's speed must not turn back on its way to the setpoint."""
    model = free_model(torque_limit_n_m=0.3)
    n = 240
    plugin = drive(compile_wheels(model), np.full(n, 130.0))
    setpoints = simulate_drive(model.wheel.drive_parameters(), np.full(n, 130.0), STEP)
    native = drive(compile_wheels(model, native=True), setpoints * RAD_S_PER_RPM)
    assert turns(native) > 10
    assert turns(plugin) <= 2  # over the law's own overshoot and back
    assert np.abs(plugin - setpoints * RAD_S_PER_RPM)[-1] < 1e-3


def turns(speeds) -> int:
    changes = np.diff(speeds)
    return int(np.sum((changes[1:] * changes[:-1] < 0) & (np.abs(np.diff(changes)) > 1e-3)))


def test_without_implicit_damping_the_limit_is_exact(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.1, servo_n_m_s_rad=0.5))
    mjmodel.opt.integrator = mujoco.mjtIntegrator.mjINT_EULER
    given_torque = torques(mjmodel, drive(mjmodel, np.full(40, 130.0)))
    np.testing.assert_allclose(given_torque[5:], 0.1, rtol=1e-9)


def test_a_speed_set_by_hand_does_not_count_as_acceleration(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.3))
    data = mujoco.MjData(mjmodel)
    drive(mjmodel, np.full(480, 0.0), data=data)
    data.qvel[0] = 10.0
    mujoco.mj_step(mjmodel, data)
    assert data.actuator_force[0] == -0.3


@pytest.mark.parametrize("limit", [NO_TORQUE_LIMIT, np.inf])
def test_no_limit_is_a_native_servo_without_one(compile_wheels, free_model, limit):
    model = free_model(servo_n_m_s_rad=KV)
    unlimited, native = compile_wheels(model), compile_wheels(model, native=True)
    unlimited.actuator_user[0, 2] = limit
    native.actuator_forcelimited[0] = False
    commands = np.repeat([130.0, -130.0, 130.0], 48)
    loads = np.repeat([0.0, 8.0, -8.0], 48)
    setpoints = simulate_drive(model.wheel.drive_parameters(), commands, STEP) * RAD_S_PER_RPM
    np.testing.assert_allclose(
        drive(unlimited, commands, loads), drive(native, setpoints, loads), rtol=0.0, atol=1e-12
    )


def test_reset_and_steady_starts_know_of_no_acceleration(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.1))
    data = mujoco.MjData(mjmodel)
    for forget in (
        lambda: mujoco.mj_resetData(mjmodel, data),
        lambda: set_steady(mjmodel, data, 30.0),
    ):
        drive(mjmodel, np.full(50, 130.0), data=data)
        assert drive_state(mjmodel, data)["change"][0] > 0.01
        forget()
        assert drive_state(mjmodel, data)["change"][0] == 0.0


def test_a_limit_rewritten_while_running_acts(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.15))
    data = mujoco.MjData(mjmodel)
    before = drive(mjmodel, np.full(20, 130.0), data=data)[-1]
    write_parameters(mjmodel, 0, free_model(torque_limit_n_m=0.05))
    speeds = drive(mjmodel, np.full(80, 130.0), data=data)
    given_torque = mjmodel.dof_M0[0] * np.diff(speeds, prepend=before) / STEP
    np.testing.assert_allclose(given_torque[60:], 0.05, rtol=1e-3)


def test_a_change_of_speed_over_another_timestep_does_not_count(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=0.1))
    data = mujoco.MjData(mjmodel)
    drive(mjmodel, np.full(50, 130.0), data=data)
    assert data.actuator_force[0] > 0.2
    mjmodel.opt.timestep = STEP / 2
    mujoco.mj_step(mjmodel, data)
    assert data.actuator_force[0] == 0.1
