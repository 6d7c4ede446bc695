"""Friction of the free wheel: what Coulomb says, at any step, and never more than to a stop."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import paper_model
from mecanum_env.plugin.layout import drive_state
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.parameters import USER

STEP = 1 / 480


@pytest.fixture(scope="session")
def rubbing(compile_wheels):
    """Return a builder of a free wheel with friction, whose inertia the drive knows."""

    def build(
        coulomb: float = 0.0, breakaway: float = 0.0, stribeck: float = 0.5, **values
    ) -> mujoco.MjModel:
        paper = paper_model()
        model = replace(paper, robot=replace(paper.robot, **values))
        mjmodel = compile_wheels(model)
        mjmodel.actuator_user[0, USER.index("inertia_kg_m2")] = mjmodel.dof_M0[0]
        names = ("coulomb_n_m", "breakaway_n_m", "stribeck_rad_s")
        mjmodel.actuator_user[0, [USER.index(name) for name in names]] = coulomb, breakaway, stribeck
        return mjmodel

    return build


def drive(mjmodel, commands, load=0.0, start=0.0):
    """Return the speeds [rad/s] at the end of each substep of commands [rpm], under a load [N m]."""
    data = mujoco.MjData(mjmodel)
    data.qvel[0] = start
    speeds = []
    for command in commands:
        data.ctrl[0], data.qfrc_applied[0] = command, load
        mujoco.mj_step(mjmodel, data)
        speeds.append(data.qvel[0])
    return np.array(speeds)


def test_a_wheel_that_reverses_into_friction_stops_and_sticks(rubbing):
    """0.517 N m hold a servo of 0.8 up to 6.2 rpm: 4 rpm must not move the wheel. MuJoCo's friction did."""
    mjmodel = rubbing(0.517, servo_n_m_s_rad=0.8)
    speeds = drive(mjmodel, np.repeat([-60.0, 4.0], 480))
    assert np.max(np.abs(speeds[-240:])) < 1e-12
    assert speeds[479] == pytest.approx(-60 * RAD_S_PER_RPM + 0.517 / 0.8, abs=1e-6)
    assert np.max(speeds) < 1e-12  # nor did it pass through zero


@given(seed=st.integers(0, 2**32 - 1), coulomb=st.floats(0.0, 1.0), servo=st.sampled_from([0.3, 0.8, 5.0]))
def test_friction_only_ever_slows_the_motion_without_it(rubbing, seed, coulomb, servo):
    """Each substep ends between rest and where it would without friction, T h / (J + h kv) short of it."""
    mjmodel, free = (rubbing(c, servo_n_m_s_rad=servo) for c in (coulomb, 0.0))
    rng = np.random.default_rng(seed)
    one, other = mujoco.MjData(mjmodel), mujoco.MjData(free)
    most = coulomb * STEP / (mjmodel.dof_M0[0] + STEP * servo)
    for command in np.repeat(rng.uniform(-20.0, 20.0, 6), 48):
        for name in ("qvel", "plugin_state"):
            getattr(other, name)[:] = getattr(one, name)
        for mj_model, data in ((mjmodel, one), (free, other)):
            data.ctrl[0] = command
            mujoco.mj_step(mj_model, data)
        wanted = np.copysign(max(abs(other.qvel[0]) - most, 0.0), other.qvel[0])
        assert one.qvel[0] == pytest.approx(wanted, abs=1e-9)


@pytest.mark.parametrize("command", [10.0, 60.0, -60.0])
@pytest.mark.parametrize("load", [0.0, 0.2])
def test_steady_motion_loses_friction_over_stiffness(rubbing, command, load):
    speed = drive(rubbing(0.3, servo_n_m_s_rad=0.8), np.full(960, command), load)[-1]
    assert speed == pytest.approx(
        command * RAD_S_PER_RPM + (load - np.copysign(0.3, command)) / 0.8, abs=1e-6
    )


@pytest.mark.parametrize("load", [0.29, -0.29, 0.31])
def test_a_load_moves_a_stuck_wheel_only_beyond_friction(rubbing, load):
    speed = drive(rubbing(0.3, servo_n_m_s_rad=0.8), np.zeros(960), load)[-1]
    assert speed == pytest.approx(max(0.0, load - 0.3) / 0.8, abs=1e-6)


def test_friction_acts_on_the_wheel_beside_the_limited_torque(rubbing):
    mjmodel = rubbing(0.1, torque_limit_n_m=0.3)
    speeds = drive(mjmodel, np.full(60, 130.0))
    given_torque = mjmodel.dof_M0[0] * np.diff(speeds) / STEP
    limited = slice(35, 47)
    np.testing.assert_allclose(given_torque[limited], 0.3 - 0.1, rtol=0.02)


def test_no_friction_is_bit_for_bit_nothing(rubbing, compile_wheels):
    mjmodel = rubbing()
    plain = compile_wheels(paper_model())
    plain.actuator_user[0, USER.index("inertia_kg_m2")] = mjmodel.actuator_user[
        0, USER.index("inertia_kg_m2")
    ]
    commands = np.repeat(np.random.default_rng(2).uniform(-130.0, 130.0, 10), 48)
    np.testing.assert_array_equal(drive(mjmodel, commands), drive(plain, commands))


def test_with_its_inertia_fed_forward_the_free_wheel_follows_the_setpoint(rubbing):
    mjmodel = rubbing(torque_limit_n_m=1e6)
    data = mujoco.MjData(mjmodel)
    for command in np.repeat(np.random.default_rng(5).uniform(-130.0, 130.0, 10), 48):
        data.ctrl[0] = command
        mujoco.mj_step(mjmodel, data)
        assert data.qvel[0] == pytest.approx(drive_state(mjmodel, data)["setpoint"][0], abs=1e-12)
