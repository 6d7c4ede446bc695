"""The drive's memory is part of MuJoCo's state: saved, restored, copied, pickled, reset, set."""

import copy
import pickle

import mujoco
import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.plugin.layout import (
    STATE,
    STATE_SIZE,
    drive_state,
    set_steady,
    state_slice,
    write_parameters,
)
from mecanum_env.units import RAD_S_PER_RPM

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS


@pytest.fixture
def mjmodel(compile_wheels, free_model):
    # The torque limit acts half of the time.
    return compile_wheels(free_model(delay_s=0.123, servo_integral_n_m_rad=5.0, torque_limit_n_m=0.3), n=2)


def go_on(mjmodel, data, n=300, seed=0):
    """Step on under random commands; return all of the state at each substep."""
    rng = np.random.default_rng(seed)
    states = np.empty((n, mujoco.mj_stateSize(mjmodel, FULL)))
    for state in states:
        data.ctrl[:] = rng.uniform(-150.0, 150.0, mjmodel.nu)
        mujoco.mj_step(mjmodel, data)
        mujoco.mj_getState(mjmodel, data, state, FULL)
    return states


def running(mjmodel):
    data = mujoco.MjData(mjmodel)
    go_on(mjmodel, data, 317, seed=9)  # in the middle of a tick and of a command
    return data


def test_a_restored_state_goes_on_bit_for_bit(mjmodel):
    data = running(mjmodel)
    saved = np.empty(mujoco.mj_stateSize(mjmodel, FULL))
    mujoco.mj_getState(mjmodel, data, saved, FULL)
    expected = go_on(mjmodel, data)
    other = mujoco.MjData(mjmodel)
    for target in (data, other):
        mujoco.mj_setState(mjmodel, target, saved, FULL)
        np.testing.assert_array_equal(go_on(mjmodel, target), expected)


@pytest.mark.parametrize("how", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_of_model_and_data_go_on_bit_for_bit(mjmodel, how):
    data = running(mjmodel)
    twin_model, twin = how(mjmodel), how(data)
    expected = go_on(mjmodel, data)
    np.testing.assert_array_equal(go_on(twin_model, twin), expected)
    del mjmodel, data  # what is left must not hang on what is gone
    mujoco.mj_resetData(twin_model, twin)
    mujoco.mj_step(twin_model, twin)


def test_a_copied_model_has_its_own_parameters(mjmodel, free_model, stable_law):
    twin = copy.copy(mjmodel)
    other = free_model(law=stable_law(np.random.default_rng(5)))
    for actuator in (0, 1):
        write_parameters(twin, actuator, other)
    before = go_on(mjmodel, mujoco.MjData(mjmodel))
    assert np.abs(go_on(twin, mujoco.MjData(twin)) - before).max() > 0.1
    np.testing.assert_array_equal(go_on(mjmodel, mujoco.MjData(mjmodel)), before)


def test_a_saved_binary_model_behaves_alike(mjmodel, tmp_path):
    path = str(tmp_path / "model.mjb")
    mujoco.mj_saveModel(mjmodel, path)
    again = mujoco.MjModel.from_binary_path(path)
    np.testing.assert_array_equal(go_on(again, mujoco.MjData(again)), go_on(mjmodel, mujoco.MjData(mjmodel)))


def test_reset_puts_the_drives_at_rest(mjmodel):
    data = running(mjmodel)
    mujoco.mj_resetData(mjmodel, data)
    np.testing.assert_array_equal(data.plugin_state, 0.0)
    np.testing.assert_array_equal(go_on(mjmodel, data), go_on(mjmodel, mujoco.MjData(mjmodel)))


def test_a_steady_start_stays_steady(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(delay_s=0.123), n=2)
    data = running(mjmodel)
    set_steady(mjmodel, data, [40.0, -25.0])
    data.qvel[:] = np.array([40.0, -25.0]) * RAD_S_PER_RPM
    data.qfrc_applied[:] = 0.0
    for _ in range(500):
        data.ctrl[:] = 40.0, -25.0
        mujoco.mj_step(mjmodel, data)
        np.testing.assert_allclose(data.qvel / RAD_S_PER_RPM, [40.0, -25.0], rtol=0.0, atol=1e-9)
    assert drive_state(mjmodel, data)["integral"] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_the_state_has_the_documented_names(mjmodel):
    data = mujoco.MjData(mjmodel)
    data.plugin_state[state_slice(mjmodel, 1)] = np.arange(STATE_SIZE)
    assert [drive_state(mjmodel, data)[name][1] for name in STATE] == list(range(len(STATE)))


@pytest.mark.parametrize("speeds", [[1.0, 2.0, 3.0], [np.nan, 1.0], np.inf, [[1.0, 2.0]]])
def test_impossible_steady_speeds_are_refused(mjmodel, speeds):
    with pytest.raises(InputError, match="speeds"):
        set_steady(mjmodel, mujoco.MjData(mjmodel), speeds)
