"""Command latency: whole and fractional delays, continuity, and what a delay of 0 means."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.plugin.layout import STATE_SIZE, drive_state, set_steady
from mecanum_env.wheel_drive.drive import RING, DriveParameters, shaped_command
from mecanum_env.wheel_drive.inputs import LatchedLog, latched_commands, simulate_drive
from mecanum_env.wheel_drive.parameters import USER
from mecanum_env.wheel_drive.shaping import rounded

delays = st.floats(0.0, 0.35)
seeds = st.integers(0, 2**32 - 1)


PAPER = paper_model().wheel.drive_parameters()


@pytest.fixture
def parameters() -> DriveParameters:
    return PAPER


def commands(seed: int, n: int = 20) -> np.ndarray:
    return np.random.default_rng(seed).uniform(-150.0, 150.0, n)


def received(parameters: DriveParameters, command_rpm: np.ndarray) -> np.ndarray:
    return shaped_command(parameters, rounded(command_rpm, parameters.command_quantum_rpm), 0.0)


def test_without_delay_the_law_gets_the_last_latched_command(parameters):
    u = commands(1)
    r = latched_commands(parameters, np.arange(20) * 0.1, u, 240)
    np.testing.assert_array_equal(r, np.repeat(received(parameters, u), 12))


@pytest.mark.parametrize("ticks", [1, 7, 12, 30])
def test_a_delay_of_whole_ticks_shifts_the_input(parameters, ticks):
    u = commands(2)
    times = np.arange(20) * 0.1
    late = replace(parameters, delay_s=ticks / 120)
    expected = np.concatenate([np.zeros(ticks), latched_commands(parameters, times, u, 240)[:-ticks]])
    np.testing.assert_allclose(latched_commands(late, times, u, 240), expected, rtol=0.0, atol=1e-6)


@given(seed=seeds, delay_s=delays)
def test_what_is_latched_once_serves_every_delay(seed, delay_s):
    u, times, late = commands(seed), np.arange(20) * 0.1, replace(PAPER, delay_s=delay_s)
    log = LatchedLog.of(PAPER, times, u, 240, 30.0)
    np.testing.assert_array_equal(log.inputs(late), latched_commands(late, times, u, 240, 30.0))


@given(seed=seeds, ticks=st.integers(0, 40), part=st.floats(0.0, 1.0))
def test_a_fractional_delay_lies_between_its_neighbours(seed, ticks, part):
    parameters = PAPER
    u, times = commands(seed), np.arange(20) * 0.1
    low, high, between = (
        latched_commands(replace(parameters, delay_s=d / 120), times, u, 240)
        for d in (ticks, ticks + 1, ticks + part)
    )
    np.testing.assert_allclose(between, (1 - part) * low + part * high, rtol=0.0, atol=1e-4)


@given(seed=seeds, delay_s=delays, period=st.sampled_from([0.1, 0.037, 1 / 120, 0.004]))
def test_the_input_is_continuous_in_the_delay(seed, delay_s, period):
    parameters = replace(PAPER, command_period_s=period)
    delay_s = min(delay_s, 20 * period)
    u, times = commands(seed, 40), np.arange(40) * period
    step = 1e-6
    here, there = (
        latched_commands(replace(parameters, delay_s=d), times, u, 100) for d in (delay_s, delay_s + step)
    )
    # Each command's share of a tick moves by step / tau, with at most tau / period + 2 commands a tick.
    most = 300.0 * step * 120.0 * (1 / 120 / period + 2)
    assert np.abs(there - here).max() <= most


@given(seed=seeds, delay_s=delays)
def test_a_delay_keeps_the_sum_of_the_command(seed, delay_s):
    parameters = replace(PAPER, delay_s=delay_s)
    u = np.append(commands(seed), np.zeros(6))
    r = latched_commands(parameters, np.arange(26) * 0.1, u, 26 * 12)
    assert r.sum() == pytest.approx(12 * received(parameters, u).sum(), abs=1e-3)


@given(
    seed=seeds,
    delay_s=delays,
    jitter_s=st.just(0.0) | st.floats(0.0, 0.15),
    loss=st.just(0.0) | st.floats(0.0, 0.5),
    timestep=st.sampled_from([1 / 480, 0.003, 0.02]),
    initial=st.sampled_from([0.0, 33.0]),
)
def test_whole_runs_equal_single_steps(stepped_drive, seed, delay_s, jitter_s, loss, timestep, initial):
    parameters = replace(PAPER, delay_s=delay_s, jitter_s=jitter_s, loss=loss, link_seed=seed)
    given_rpm = np.repeat(np.random.default_rng(seed).uniform(-150.0, 150.0, (3, 6)), 30, axis=-1)
    drive = stepped_drive(parameters, timestep, np.full(3, initial))
    setpoints = [drive.step(command) for command in given_rpm.T]
    whole = simulate_drive(parameters, given_rpm, timestep, initial)
    np.testing.assert_array_equal(np.array(setpoints).T, whole)


@given(seed=seeds, delay_s=delays)
def test_a_log_gives_the_law_what_the_drive_gives_it(stepped_drive, seed, delay_s):
    """The log's commands come at any time; the drive sees the one that holds at each substep."""
    parameters = replace(PAPER, delay_s=delay_s)
    rng = np.random.default_rng(seed)
    time = np.concatenate([[0.0], np.cumsum(rng.uniform(0.01, 0.3, 12))])
    command = rng.uniform(-150.0, 150.0, 13)
    n = 480
    held = command[np.searchsorted(time, np.arange(n) / 480 + 1e-10, side="right") - 1]
    drive, inputs = stepped_drive(parameters, 1 / 480), []
    for k in range(n):
        drive.step(held[k])
        if k % 4 == 0:
            inputs.append(float(drive.law.r1))
    np.testing.assert_array_equal(latched_commands(parameters, time, command, n // 4), inputs)


def test_missing_samples_of_a_log_hold_the_command_before(parameters):
    late = replace(parameters, delay_s=0.05)
    r = latched_commands(late, [3.0, 3.1, 3.2, 3.3], [np.nan, 40.0, np.nan, 60.0], 60, initial_rpm=10.0)
    np.testing.assert_allclose(r, np.repeat([10.0, 40.0, 60.0], [18, 24, 18]), rtol=0.0, atol=1e-6)


def test_a_log_without_rows_or_of_unequal_columns_is_refused(parameters):
    with pytest.raises(InputError, match="equal length"):
        latched_commands(parameters, [], [], 10)
    with pytest.raises(InputError, match="equal length"):
        latched_commands(parameters, [0.0, 1.0], [1.0], 10)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("delay_s", -0.1),
        ("delay_s", 6.11),
        ("delay_s", np.nan),
        ("command_period_s", 0.0),
        ("command_quantum_rpm", -1.0),
        ("saturation_rpm", 0.0),
    ],
)
def test_impossible_drives_are_refused(parameters, name, value):
    with pytest.raises(InputError, match=name):
        replace(parameters, **{name: value})


@pytest.mark.parametrize("seconds", [0.0, 0.0123, 0.1, (RING - 3) * 0.1 - 1 / 480])
def test_the_plugin_acts_after_the_delay(compile_wheels, free_model, seconds):
    mjmodel = compile_wheels(free_model())
    mjmodel.actuator_user[0, USER.index("delay_s")] = seconds
    data = mujoco.MjData(mjmodel)
    data.ctrl[0] = 100.0
    first = 0
    while drive_state(mjmodel, data)["setpoint"][0] == 0.0:
        mujoco.mj_step(mjmodel, data)
        first += 1
    # A delay inside a tick acts on that tick in part: up to a tick before it is over.
    assert seconds - 1 / 120 < (first - 1) / 480 <= seconds + 1e-9


def test_commands_from_before_a_steady_start_still_arrive(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(delay_s=0.25))
    data = mujoco.MjData(mjmodel)
    set_steady(mjmodel, data, 60.0)
    inputs = []
    for _ in range(480):
        data.ctrl[0] = 20.0
        mujoco.mj_step(mjmodel, data)
        inputs.append(drive_state(mjmodel, data)["r1"][0])
    np.testing.assert_array_equal(inputs, np.repeat([60.0, 20.0], [120, 360]))
    assert data.plugin_state.size == STATE_SIZE
