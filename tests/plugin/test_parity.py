"""The plugin is the Python reference, bit for bit, and a native servo fed by it moves the wheel alike."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.model import Model, Robot, Wheel
from mecanum_env.plugin.layout import (
    ARRIVALS,
    COMMANDS,
    LOST_VOLTAGE,
    RING,
    STATE,
    USER,
    drive_state,
    state_slice,
)
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.inputs import simulate_drive
from tests.set_points import LAW_EFFECTS, SET_POINT_EFFECTS, some_of


def run(mjmodel, commands):
    """Step through commands (n, wheels); return setpoints [rad/s] and joint speeds, (n, wheels), and data."""
    data = mujoco.MjData(mjmodel)
    setpoints, speeds = [], []
    for command in commands:
        data.ctrl[:] = command
        mujoco.mj_step(mjmodel, data)
        setpoints.append(drive_state(mjmodel, data)["setpoint"])
        speeds.append(data.qvel.copy())
    return np.array(setpoints), np.array(speeds), data


@given(
    seed=st.integers(0, 2**32 - 1),
    sample_period_s=st.sampled_from([1 / 120, 0.01, 0.0073, 1 / 480, 0.001, 0.05]),
    command_period_s=st.sampled_from([0.1, 0.02, 1 / 120, 0.033, 0.005]),
    timestep=st.sampled_from([1 / 480, 1 / 240, 0.002, 0.0031, 0.02]),
    delay_periods=st.one_of(st.just(0.0), st.floats(0.0, 20.0)),
    jitter_periods=st.just(0.0) | st.floats(0.0, 2.5),
    loss=st.just(0.0) | st.floats(0.0, 1.0),
    link_seed=st.integers(0, 2**53),
    quantum=st.sampled_from([0.0, 1.0, 0.3]),
    saturation=st.sampled_from([135.0, 40.0, np.inf]),
    shaping=some_of({**SET_POINT_EFFECTS, **LAW_EFFECTS, "load_inertia": {"ratio": st.just(1.001)}}),
)
def test_state_equals_the_reference_bit_for_bit(
    compile_wheels,
    stable_law,
    stepped_drive,
    seed,
    sample_period_s,
    command_period_s,
    timestep,
    delay_periods,
    jitter_periods,
    loss,
    link_seed,
    quantum,
    saturation,
    shaping,
):
    rng = np.random.default_rng(seed)
    law = stable_law(rng, sample_period_s)
    wheel = Wheel(law, command_period_s, quantum, saturation)
    latency = {"delay_s": delay_periods * command_period_s, "jitter_s": jitter_periods * command_period_s}
    link = {"command_latency/jitter": latency, "command_loss": {"share": loss}}
    model = Model(wheel, Robot(), {**link, **shaping})
    mjmodel = compile_wheels(model, timestep=timestep)
    mjmodel.actuator_user[0, USER.index("link_seed")] = link_seed
    parameters = replace(drive_parameters(model), link_seed=link_seed)
    data, drive = mujoco.MjData(mjmodel), stepped_drive(parameters, timestep)
    where = state_slice(mjmodel, 0)
    # Some commands are repeated: only changes have a delay of their own.
    commands, setpoints = np.repeat(rng.uniform(-160.0, 160.0, 75), rng.integers(0, 5, 75))[:150], []
    lost_v = np.repeat(rng.uniform(-1.0, 4.0, 15), 10)[: commands.size]
    for command, lost in zip(commands, lost_v, strict=True):
        data.ctrl[0], data.userdata[LOST_VOLTAGE] = command, lost
        mujoco.mj_step(mjmodel, data)
        setpoint = drive.step(command, lost)
        kept = dict(zip(STATE, data.plugin_state[where], strict=False))
        assert (kept["substeps"], kept["ticks"], kept["latches"]) == (
            drive.substeps,
            drive.ticks,
            drive.latches,
        )
        law = drive.law
        assert [kept[name] for name in ("w0", "w1", "w2", "r1", "r2", "ramp", "slope", "sent")] == [
            float(x)
            for x in (
                law.w0,
                law.w1,
                law.w2,
                law.r1,
                law.r2,
                *vars(drive.ramp).values(),
                drive.latched.sent_rpm[..., -1],
            )
        ]
        assert kept["setpoint"] == float(setpoint) * RAD_S_PER_RPM
        setpoints.append(float(setpoint))
    whole = simulate_drive(parameters, commands, timestep, lost_v=lost_v)
    np.testing.assert_allclose(whole, setpoints, rtol=0.0, atol=1e-9)
    newest = np.arange(drive.latches - min(drive.latches, RING), drive.latches)
    for part, expected in (
        (COMMANDS, drive.latched.received_rpm),
        (ARRIVALS, drive.latched.arrivals_s),
    ):
        ring = data.plugin_state[where][part]
        np.testing.assert_array_equal(ring[newest % RING], expected[-newest.size :])


@pytest.mark.parametrize("delay_s", [0.0, 0.037])
def test_motion_equals_a_native_velocity_servo_fed_per_substep(compile_wheels, free_model, delay_s):
    model = free_model(delay_s, torque_limit_n_m=50.0)  # never reached
    commands = np.repeat(np.random.default_rng(3).uniform(-150.0, 150.0, (30, 2)), 48, axis=0)
    setpoints, speeds, _ = run(compile_wheels(model, n=2), commands)
    reference = simulate_drive(drive_parameters(model), commands.T, 1 / 480).T
    np.testing.assert_array_equal(setpoints, reference * RAD_S_PER_RPM)
    native = compile_wheels(model, n=2, native=True)
    data = mujoco.MjData(native)
    for setpoint, speed in zip(setpoints, speeds, strict=True):
        data.ctrl[:] = setpoint
        mujoco.mj_step(native, data)
        np.testing.assert_allclose(data.qvel, speed, rtol=0.0, atol=1e-12)


def test_the_command_is_latched_every_period_only(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model())
    # A command that changes at every substep: only those at 0, 0.1, 0.2 ... s count (48 substeps apart).
    commands = np.random.default_rng(1).uniform(-130.0, 130.0, (480, 1))
    held = np.repeat(commands[::48], 48, axis=0)
    np.testing.assert_array_equal(run(mjmodel, commands)[0], run(mjmodel, held)[0])


def test_commands_are_rounded_half_to_even_then_limited(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model())
    for command, latched in [
        (0.5, 0.0),
        (1.5, 2.0),
        (-2.5, -2.0),
        (134.6, 135.0),
        (300.0, 135.0),
        (-1e9, -135.0),
    ]:
        _, _, data = run(mjmodel, [[command]])
        assert data.plugin_state[state_slice(mjmodel, 0)][COMMANDS][0] == latched


@pytest.mark.usefixtures("in_tmp_path")
@pytest.mark.parametrize("command", [np.nan, np.inf, -np.inf, 1e11])
def test_an_absurd_command_counts_as_none(compile_wheels, free_model, command):
    _, speeds, _ = run(compile_wheels(free_model()), [[command]] * 200)
    np.testing.assert_array_equal(speeds, 0.0)


def test_ctrlrange_limits_the_command(wheels_spec, free_model):
    spec = wheels_spec(free_model())
    spec.actuators[0].ctrlrange = [-20.0, 20.0]
    spec.actuators[0].ctrllimited = mujoco.mjtLimited.mjLIMITED_TRUE
    _, speeds, _ = run(spec.compile(), [[100.0]] * 480)
    assert speeds[-1, 0] / RAD_S_PER_RPM == pytest.approx(20.0, abs=1e-6)


def test_forward_does_not_change_the_state(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model())
    _, _, data = run(mjmodel, [[70.0]] * 100)
    before = data.plugin_state.copy()
    data.ctrl[0] = -50.0
    for _ in range(3):
        mujoco.mj_forward(mjmodel, data)
    np.testing.assert_array_equal(data.plugin_state, before)


def test_the_clocks_do_not_drift_over_an_hour(compile_wheels, free_model):
    mjmodel = compile_wheels(free_model(), timestep=1 / 240)
    data = mujoco.MjData(mjmodel)
    hour = 3600 * 240
    # Not an hour of stepping: the state of a drive that has run for one, less a second.
    where = state_slice(mjmodel, 0)
    mujoco.mj_step(mjmodel, data)
    state = data.plugin_state[where]
    state[:3] = hour - 240, (hour - 240) / 2, (hour - 240) / 24
    for n in range(240):
        mujoco.mj_step(mjmodel, data)
        assert state[1] == (hour - 240 + n) // 2 + 1
        assert state[2] == (hour - 240 + n) // 24 + 1
