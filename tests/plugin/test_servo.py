"""The servo under load: droop, integral action and anti-windup; test_torque_limit.py has the limit."""

import mujoco
import numpy as np
import pytest

from mecanum_env.plugin.layout import drive_state, wheel_actuators
from mecanum_env.units import RAD_S_PER_RPM

STEP = 1 / 480


def drive(mjmodel, data, command, load, seconds):
    """Hold a command [rpm] against a load torque [N m]; return the wheel speeds [rad/s] at each substep."""
    speeds = []
    for _ in range(round(seconds / STEP)):
        data.ctrl[0] = command
        data.qfrc_applied[0] = -load
        mujoco.mj_step(mjmodel, data)
        speeds.append(data.qvel[0])
    return np.array(speeds)


@pytest.mark.parametrize("kv", [0.5, 5.0])
def test_a_proportional_servo_droops_by_load_over_stiffness(compile_wheels, free_model, kv):
    mjmodel = compile_wheels(free_model(servo_n_m_s_rad=kv, torque_limit_n_m=6.0))
    speed = drive(mjmodel, mujoco.MjData(mjmodel), 60.0, 1.0, 3.0)[-1]
    assert 60.0 * RAD_S_PER_RPM - speed == pytest.approx(1.0 / kv, rel=1e-9)


def test_an_integral_servo_removes_the_droop(compile_wheels, free_model):
    mjmodel = compile_wheels(
        free_model(servo_n_m_s_rad=5.0, servo_integral_n_m_rad=20.0, torque_limit_n_m=6.0)
    )
    data = mujoco.MjData(mjmodel)
    speed = drive(mjmodel, data, 60.0, 1.0, 8.0)[-1]
    assert speed == pytest.approx(60.0 * RAD_S_PER_RPM, abs=1e-9)
    assert drive_state(mjmodel, data)["integral"][0] * 20.0 == pytest.approx(1.0, rel=1e-9)


def test_an_unloaded_integral_servo_barely_acts(compile_wheels, free_model):
    """The integral sees the setpoint of the same instant, so following an acceleration charges it little."""
    plain = compile_wheels(free_model())
    integral = compile_wheels(free_model(servo_integral_n_m_rad=20.0))
    one, two = (drive(m, mujoco.MjData(m), 100.0, 0.0, 1.0) for m in (plain, integral))
    assert np.abs(one - two).max() < 0.01 * 100.0 * RAD_S_PER_RPM


def test_the_integral_stops_at_the_torque_limit(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(torque_limit_n_m=1.0, servo_integral_n_m_rad=20.0))
    data = mujoco.MjData(mjmodel)
    drive(mjmodel, data, 60.0, 3.0, 0.5)  # more than the drive can hold: the wheel is turned backwards
    early = drive_state(mjmodel, data)["integral"][0]
    drive(mjmodel, data, 60.0, 3.0, 5.0)
    assert drive_state(mjmodel, data)["integral"][0] == early
    # Unloaded again it is back within a second and does not overshoot by what five seconds would have stored.
    back = drive(mjmodel, data, 60.0, 0.0, 60.0)
    target = 60.0 * RAD_S_PER_RPM
    assert back[-1] == pytest.approx(target, abs=1e-6)
    assert back.max() < 1.2 * target


def test_a_servo_without_anti_windup_overshoots_by_what_it_has_stored(compile_wheels, free_model):
    """Held back for a second it stores the error of that second, or the share of it that it winds up by."""
    target, held = 60.0 * RAD_S_PER_RPM, 1.0
    peaks = []
    for windup in (0.0, 0.5, 1.0):
        servo = {"torque_limit_n_m": 1.0, "servo_integral_n_m_rad": 20.0, "servo_windup": windup}
        mjmodel = compile_wheels(free_model(**servo))
        data = mujoco.MjData(mjmodel)
        backwards = drive(mjmodel, data, 60.0, 3.0, held)
        stored = np.sum(target - backwards[round(0.3 / STEP) :]) * STEP
        assert drive_state(mjmodel, data)["integral"][0] >= windup * stored
        back = drive(mjmodel, data, 60.0, 0.0, 60.0)
        assert back[-1] == pytest.approx(target, abs=1e-3)
        peaks.append(back.max() / target)
    assert peaks[0] < 1.2 < peaks[1] < peaks[2]


def test_the_integral_waits_while_actuation_is_off(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(servo_integral_n_m_rad=20.0))
    data = mujoco.MjData(mjmodel)
    mjmodel.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION
    speeds = drive(mjmodel, data, 60.0, 0.0, 2.0)
    np.testing.assert_array_equal(speeds, 0.0)
    assert abs(drive_state(mjmodel, data)["integral"][0]) < 0.01
    assert drive_state(mjmodel, data)["w0"][0] == pytest.approx(60.0, abs=1e-6)  # the law runs on


def test_every_wheel_has_its_own_drive(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(), n=4)
    assert wheel_actuators(mjmodel) == [0, 1, 2, 3]
    data = mujoco.MjData(mjmodel)
    data.ctrl[:] = [10.0, -20.0, 40.0, 130.0]
    mujoco.mj_step(mjmodel, data, 960)
    np.testing.assert_allclose(data.qvel / RAD_S_PER_RPM, data.ctrl, atol=1e-6)
