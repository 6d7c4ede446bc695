"""Batches of models with different coefficients: each runs its own law, at any number of threads."""

import copy

import mujoco
import numpy as np
import pytest
from mujoco import batch, rollout

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.plugin.layout import STATE, state_slice, write_parameters
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.inputs import simulate_drive

FULL = mujoco.mjtState.mjSTATE_FULLPHYSICS
N_MODELS, N_STEPS = 6, 150


@pytest.fixture(scope="module")
def variants(stable_law):
    """Return what differs between the models of a batch: law, saturation, delay, servo, torque limit."""
    rng = np.random.default_rng(4)
    return [
        {
            "law": stable_law(rng),
            "saturation_rpm": rng.uniform(60.0, 135.0),
            "delay_s": rng.uniform(0.0, 0.2),
            "servo_n_m_s_rad": rng.uniform(1.0, 5.0),
            "torque_limit_n_m": rng.uniform(0.2, 1.5),  # the free wheel asks for 0.8
        }
        for _ in range(N_MODELS)
    ]


@pytest.fixture
def models(compile_wheels, free_model, variants):
    first = compile_wheels(free_model(), n=2)
    compiled = []
    for variant in variants:
        mjmodel = copy.copy(first)
        for actuator in (0, 1):
            write_parameters(mjmodel, actuator, free_model(**variant))
        compiled.append(mjmodel)
    return compiled


@pytest.fixture
def controls():
    return np.random.default_rng(7).uniform(-150.0, 150.0, (N_MODELS, N_STEPS, 2))


@pytest.fixture
def alone(models, controls):
    """Return the states (model, step, nstate) of each model stepped by itself."""
    states = np.empty((N_MODELS, N_STEPS, mujoco.mj_stateSize(models[0], FULL)))
    for mjmodel, control, run in zip(models, controls, states, strict=True):
        data = mujoco.MjData(mjmodel)
        for command, state in zip(control, run, strict=True):
            data.ctrl[:] = command
            mujoco.mj_step(mjmodel, data)
            mujoco.mj_getState(mjmodel, data, state, FULL)
    return states


def test_each_model_runs_its_own_law(models, free_model, variants, controls):
    for mjmodel, variant, control in zip(models, variants, controls, strict=True):
        data = mujoco.MjData(mjmodel)
        parameters = drive_parameters(free_model(**variant))
        expected = simulate_drive(parameters, control.T, mjmodel.opt.timestep).T * RAD_S_PER_RPM
        for command, setpoints in zip(control, expected, strict=True):
            data.ctrl[:] = command
            mujoco.mj_step(mjmodel, data)
            for actuator in (0, 1):
                state = data.plugin_state[state_slice(mjmodel, actuator)]
                assert state[STATE.index("setpoint")] == setpoints[actuator]


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_rollout_of_different_models(models, controls, alone, threads):
    start = np.zeros((N_MODELS, alone.shape[-1]))
    start[:, :] = initial_state(models[0])
    with rollout.Rollout(nthread=threads) as pool:
        states, _ = pool.rollout(models, [mujoco.MjData(models[0]) for _ in range(threads)], start, controls)
    np.testing.assert_array_equal(states, alone)
    assert differ(states[:, -1])


@pytest.mark.parametrize("threads", [1, 2, 4])
@pytest.mark.parametrize("persistent", [False, True])
def test_batch_of_different_models(models, controls, alone, threads, persistent):
    simulations = batch.Batch(models[0], N_MODELS, nthread=threads, persistent=persistent)
    simulations.set_models(models)
    check_batch(simulations, controls, alone)


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_batch_of_expanded_fields(models, controls, alone, threads):
    simulations = batch.Batch(models[0], N_MODELS, nthread=threads)
    for name in ("actuator_dynprm", "actuator_biasprm", "actuator_user"):
        simulations.expand(name)[:] = np.stack([getattr(mjmodel, name) for mjmodel in models])
    check_batch(simulations, controls, alone)


def check_batch(simulations, controls, alone):
    simulations.reset()
    plugin_state, qvel = simulations.bind("plugin_state"), simulations.bind("qvel")
    n = plugin_state.shape[-1]
    for step in range(N_STEPS):
        simulations.ctrl = controls[:, step]
        simulations.step()
        np.testing.assert_array_equal(plugin_state, alone[:, step, -n:])
        np.testing.assert_array_equal(qvel, alone[:, step, 3:5])  # after time and two positions
    assert differ(qvel)


def differ(rows) -> bool:
    return len(np.unique(np.round(rows, 9), axis=0)) == N_MODELS


def initial_state(mjmodel) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(mjmodel, FULL))
    mujoco.mj_getState(mjmodel, mujoco.MjData(mjmodel), state, FULL)
    return state
