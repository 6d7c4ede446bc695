"""Programs in the plugin: the Python reference bit for bit, in the bench's loop and in MuJoCo."""

import mujoco
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.model import CustomEffect, CustomTable
from mecanum_env.plugin.layout import FIRST_PROGRAM, USER_SIZE, drive_state, require_valid, write_parameters
from mecanum_env.plugin.library import evaluate_program
from mecanum_env.simulator.bench import bench_motion
from mecanum_env.simulator.free_wheel import BenchRun, compile_bench, mujoco_bench_motion
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.formula import compile_formula
from mecanum_env.wheel_drive.program import CODES, INPUTS, PROGRAM_SIZE, evaluate, table_program

FORMULAS = (
    "-0.08 * speed * sin(3 * angle)",
    "sign(speed) * exp(-abs(speed) / 7) - 0.3 * max(command, 12, time)",
    "cos(angle) ** 3 / (1 + speed ** 2) + min(voltage, 2)",
    "speed ** 0.7 + exp(command)",
)
CUSTOM = (
    CustomEffect("load", "-0.08 * speed * sin(3 * angle) + 2 * sin(7 * time)"),
    CustomEffect("set_point", "3 * sin(time * 5) + 0.02 * speed"),
    CustomEffect("command", table=CustomTable("command", (-100.0, -5.0, 5.0, 100.0), (4.0, 0.0, 0.0, -6.0))),
)


@pytest.mark.parametrize("text", FORMULAS)
@given(seed=st.integers(0, 2**32 - 1))
def test_the_plugin_gives_the_same_bits(text, seed):
    rng = np.random.default_rng(seed)
    given_numbers = rng.normal(size=(40, len(INPUTS))) * 10.0 ** rng.uniform(-3, 4, (40, len(INPUTS)))
    program = compile_formula(text)
    reference = evaluate(program, dict(zip(INPUTS, given_numbers.T, strict=True)))
    np.testing.assert_array_equal(evaluate_program(program, given_numbers), reference)


@given(seed=st.integers(0, 2**32 - 1))
def test_the_plugin_gives_the_same_bits_of_a_table(seed):
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 17))
    knots = np.cumsum(rng.uniform(0.01, 30.0, size)) - 100.0
    program = table_program("speed", knots.tolist(), rng.normal(size=size).tolist())
    speeds = np.concatenate([rng.uniform(-300.0, 400.0, 50), knots])
    rows = np.zeros((speeds.size, len(INPUTS)))
    rows[:, INPUTS.index("speed")] = speeds
    np.testing.assert_array_equal(evaluate_program(program, rows), evaluate(program, {"speed": speeds}))


@given(seed=st.integers(0, 2**32 - 1))
def test_any_numbers_run_without_harm(seed):
    rng = np.random.default_rng(seed)
    numbers = rng.integers(-1, len(CODES) + 2, PROGRAM_SIZE).astype(float)
    values = evaluate_program(tuple(numbers.tolist()), rng.normal(size=(3, len(INPUTS))))
    assert np.all(np.isfinite(values))
    try:
        expected = evaluate(tuple(numbers.tolist()), {})
    except InputError:
        np.testing.assert_array_equal(values, 0.0)
    else:
        assert np.isfinite(expected)


def test_what_is_no_program_is_refused(compile_wheels, free_model):
    model = free_model()
    mjmodel = compile_wheels(model.with_custom(CUSTOM[0]))
    mjmodel.actuator_user[0, FIRST_PROGRAM + 2 * PROGRAM_SIZE] = 77.0
    with pytest.raises(InputError, match=r"custom effect of the station load = user\[224\]"):
        require_valid(mjmodel)


def test_a_model_without_custom_effects_keeps_its_size(compile_wheels, free_model):
    assert compile_wheels(free_model()).nuser_actuator == USER_SIZE


def test_programs_come_and_go_in_a_compiled_model(compile_wheels, free_model):
    plain, custom = free_model(), free_model().with_custom(*CUSTOM)
    rewritten = compile_wheels(custom)
    write_parameters(rewritten, 0, plain)
    np.testing.assert_array_equal(rewritten.actuator_user[0, USER_SIZE:], 0.0)
    write_parameters(rewritten, 0, custom)
    np.testing.assert_array_equal(rewritten.actuator_user, compile_wheels(custom).actuator_user)
    with pytest.raises(InputError, match="nuser_actuator = 128, must be"):
        write_parameters(compile_wheels(plain), 0, custom)


@pytest.mark.parametrize("timestep_s", [1 / 480, 0.002])
def test_bench_and_mujoco_give_the_same_bits(paper, timestep_s):
    rng = np.random.default_rng(5)
    model = (
        paper.with_custom(*CUSTOM)
        .with_effect("backlash", gap_deg=3.0)
        .with_effect("coulomb_friction", torque_n_m=0.2)
    )
    time_s, command = np.arange(30) * 0.25, rng.uniform(-130.0, 130.0, 30)
    clock, speed = bench_motion(model, time_s, command, 8.0, timestep_s=timestep_s)
    compiled = compile_bench(model, timestep_s=timestep_s)
    also, reference = mujoco_bench_motion(compiled, BenchRun(time_s, command, 8.0))
    np.testing.assert_allclose(also, clock, atol=1e-12)
    np.testing.assert_array_equal(speed, reference)


@pytest.mark.parametrize("text", ["-0.3 * speed * sin(2 * angle)", "0.5 * command * sin(time)", "1 + time"])
def test_a_load_is_a_torque_of_servo_times_its_value(compile_wheels, free_model, text):
    """The torque is recomputed from the wheel's own speed, angle and time, and adds to the servo's."""
    model = free_model(torque_limit_n_m=1e9).with_custom(CustomEffect("load", text))
    mjmodel = compile_wheels(model)
    data, program, kv = mujoco.MjData(mjmodel), compile_formula(text), model.robot.servo_n_m_s_rad
    plain = compile_wheels(free_model(torque_limit_n_m=1e9))
    twin, h = mujoco.MjData(plain), mjmodel.opt.timestep
    for n in range(300):
        state = drive_state(mjmodel, data)
        # The twin without the effect is in the same state: what differs is the load.
        twin.plugin_state[:], twin.qvel[:], twin.qpos[:] = data.plugin_state, data.qvel, data.qpos
        before = float(data.qvel[0])
        twin.ctrl[0] = data.ctrl[0] = 80.0 if n < 150 else -40.0
        mujoco.mj_step(plain, twin)
        mujoco.mj_step(mjmodel, data)
        now = drive_state(mjmodel, data)
        given_now = {
            "speed": before / RAD_S_PER_RPM,
            "angle": state["angle"][0],
            "time": n * h,
            "command": now["r1"][0],
        }
        expected = kv * RAD_S_PER_RPM * float(evaluate(program, given_now))
        added = float(data.actuator_force[0] - twin.actuator_force[0])
        assert added == pytest.approx(expected, abs=1e-9)
    assert data.qpos[0] == pytest.approx(float(drive_state(mjmodel, data)["angle"][0]), abs=1e-9)
