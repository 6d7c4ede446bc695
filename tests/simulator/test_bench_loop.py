"""The bench without MuJoCo moves its wheel as MuJoCo does, bit for bit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE, Effect, Parameter, registered
from mecanum_env.effects.apply import changed_model, drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.mjcf.physics import wheel_inertia
from mecanum_env.model import paper_model
from mecanum_env.plugin.layout import NO_TORQUE_LIMIT, chain_parameters
from mecanum_env.plugin.library import parameter_names
from mecanum_env.simulator.bench import bench_motions, replay_bench
from mecanum_env.simulator.commands import hold
from mecanum_env.simulator.free_wheel import (
    BenchRun,
    BenchRuns,
    FreeWheel,
    FreeWheels,
    compile_bench,
    mujoco_bench_motion,
)
from mecanum_env.simulator.supply import Supply
from mecanum_env.simulator.trajectory import SimulationDivergedError
from mecanum_env.wheel_drive.drive import longest_delay_s
from mecanum_env.wheel_drive.free_wheel import free_wheel_speeds
from mecanum_env.wheel_drive.parameters import CHAIN
from tests.effects.conftest import clear_model
from tests.set_points import LAW_EFFECTS, SET_POINT_EFFECTS, some_of

ANSWERS = st.one_of(st.just(0.0), st.floats(0.0, 0.2))
EFFECTS = {
    "command_latency": {"delay_s": st.floats(0.0, 2.0)},
    "command_latency/jitter": {"delay_s": st.floats(0.0, 0.15), "jitter_s": st.floats(0.0, 0.15)},
    "command_loss": {"share": st.floats(0.0, 1.0)},
    **SET_POINT_EFFECTS,
    **LAW_EFFECTS,
    "load_inertia": {"ratio": st.floats(1.0, 40.0)},
    "load_inertia/integral": {"ratio": st.floats(1.0, 40.0)},
    "weak_servo": {"servo_n_m_s_rad": st.floats(0.02, 20.0)},
    "backlash": {"gap_deg": st.floats(0.0, 20.0)},
    "backlash/rest": {"gap_deg": st.floats(0.0, 20.0), "slowing_rpm_s": st.floats(1.0, 1e5)},
    "backlash/spring": {
        "gap_deg": st.floats(0.0, 20.0),
        "swing_hz": st.floats(0.1, 50.0),
        "damping": st.floats(0.0, 1.0),
        "friction_deg": st.floats(0.0, 10.0),
    },
    "coulomb_friction": {"torque_n_m": st.floats(0.0, 1.0), "answer_s": ANSWERS},
    "coulomb_friction/washed_out": {"torque_n_m": st.floats(0.0, 1.0), "washout_s": st.floats(0.05, 5.0)},
    "stiction": {"breakaway_n_m": st.floats(0.0, 1.0), "stribeck_rpm": st.floats(0.5, 30.0)},
    "stiction/washed_out": {"breakaway_n_m": st.floats(0.0, 1.0), "answer_s": ANSWERS},
    "viscous_friction": {"damping_n_m_s_rad": st.floats(0.0, 0.5)},
    "viscous_friction/washed_out": {"damping_n_m_s_rad": st.floats(0.0, 0.5), "answer_s": ANSWERS},
    "warm_up/friction": {"share": st.floats(0.0, 1.0), "time_constant_s": st.floats(0.1, 10.0)},
    "warm_up/cold_friction": {
        "torque_n_m": st.floats(0.0, 2.0),
        "damping_n_m_s_rad": st.floats(0.0, 2.0),
        "time_constant_s": st.floats(0.1, 10.0),
    },
    "torque_ripple": {
        "per_turn": st.floats(1.0, 24.0),
        "share": st.floats(0.0, 0.5),
        "torque_n_m": st.floats(0.0, 1.0),
        "phase_deg": st.floats(-180.0, 180.0),
    },
    "torque_ripple/washed_out": {
        "per_turn": st.floats(1.0, 24.0),
        "torque_n_m": st.floats(0.0, 1.0),
        "answer_s": ANSWERS,
        "washout_s": st.floats(0.05, 5.0),
    },
}


def random_run(rng: np.random.Generator, initial_rpm: float = 0.0) -> BenchRun:
    time = np.cumsum(rng.uniform(0.01, 0.3, 12))
    command = np.where(rng.random(12) < 0.1, np.nan, rng.uniform(-140.0, 140.0, 12))
    duration_s = float(time[-1] - time[0]) + rng.uniform(0.0, 0.5)
    falling = Supply(time - time[0], np.cumsum(rng.uniform(-0.5, 0.2, 12)))
    supply, gap_share = rng.choice([None, falling]), rng.uniform(-1.0, 1.0)
    return BenchRun(time, command, duration_s, initial_rpm, supply, gap_share)


def by_mujoco(model, run, timestep_s=None):
    return mujoco_bench_motion(compile_bench(model, timestep_s=timestep_s), run)


@settings(deadline=None)
@given(
    effects=some_of(EFFECTS),
    integral=st.sampled_from([0.0, 0.3, 20.0]),
    sample_period_s=st.sampled_from([1 / 120, 0.01, 0.0073, 0.05]),
    command_period_s=st.sampled_from([0.1, 0.02, 0.033]),
    timestep_s=st.sampled_from([None, 1 / 960, 1 / 133, 0.0031]),
    initial_rpm=st.sampled_from([0.0, 45.0, -80.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_the_motion_is_mujocos_bit_for_bit(
    effects, integral, sample_period_s, command_period_s, timestep_s, initial_rpm, seed
):
    model = paper_model()
    law = replace(model.wheel.law, sample_period_s=sample_period_s)
    if "command_latency" in effects:
        latency = min(effects["command_latency"]["delay_s"], longest_delay_s(command_period_s, 0.05))
        effects = {**effects, "command_latency": {"delay_s": latency}}
    model = replace(
        model,
        wheel=replace(model.wheel, law=law, command_period_s=command_period_s),
        robot=replace(model.robot, servo_integral_n_m_rad=integral),
        effects=effects,
    )
    run = random_run(np.random.default_rng(seed), initial_rpm)
    clock, speed = bench_motions([model], [run], timestep_s=timestep_s)[0][0]
    expected_clock, expected = by_mujoco(model, run, timestep_s)
    np.testing.assert_array_equal(clock, expected_clock)
    np.testing.assert_array_equal(speed, expected)


@settings(deadline=None, max_examples=15)
@given(
    effects=some_of(EFFECTS),
    integral=st.sampled_from([0.0, 20.0]),
    timestep_s=st.sampled_from([None, 1 / 133]),
    initial_rpm=st.sampled_from([0.0, 45.0]),
    seed=st.integers(0, 2**32 - 1),
)
@example(
    effects={"backlash/spring": {"gap_deg": 2.2e-311}}, integral=0.0, timestep_s=None, initial_rpm=0.0, seed=0
)
def test_the_reference_moves_the_wheel_bit_for_bit(effects, integral, timestep_s, initial_rpm, seed):
    paper = paper_model()
    model = replace(paper, robot=replace(paper.robot, servo_integral_n_m_rad=integral), effects=effects)
    run = random_run(np.random.default_rng(seed), initial_rpm)
    clock, speed = bench_motions([model], [run], timestep_s=timestep_s)[0][0]
    np.testing.assert_array_equal(reference_speed(model, run, clock), speed)


def reference_speed(model, run, clock):
    """Return the free wheel's speed as `mecanum_env.law` alone computes it."""
    changed, step = changed_model(model, "bench"), clock[1]
    time, command, initial = run.given
    held = hold(time, command, clock[:-1], before=initial)
    row = chain_parameters(changed, None, NO_TORQUE_LIMIT, wheel_inertia(changed.robot))
    wheel = row[CHAIN.index("inertia_kg_m2")], drive_parameters(changed).load.viscous_n_m_s_rad
    lost_v = None if run.supply is None else run.supply.lost_at(clock[:-1])[None]
    started = (held[None], np.array([initial]), lost_v, run.gap_share)
    return free_wheel_speeds(row[None], np.array([wheel]), step, *started)[0, 0]


@pytest.mark.parametrize("name", [name for name, effect in CATALOGUE.items() if effect.acts_in("bench")])
def test_no_effect_of_the_catalogue_needs_mujoco_on_the_bench(name):
    """MuJoCo takes many times as long, and a search simulates wheels thousands of times."""
    assert FreeWheel.of(clear_model(name)).mj_model is None


def test_models_and_runs_of_one_call_do_not_disturb_each_other(paper):
    rng = np.random.default_rng(5)
    runs = [random_run(rng, speed) for speed in (0.0, 30.0, -60.0)]
    slower = replace(paper.wheel.law, sample_period_s=1 / 70)
    models = [
        paper.with_effect("backlash", gap_deg=5.0),
        replace(paper, wheel=replace(paper.wheel, law=slower)),  # with another physics step
        paper.with_effect("coulomb_friction", torque_n_m=0.2),
    ]
    together = bench_motions(models, runs)
    for model, motions in zip(models, together, strict=True):
        for run, (clock, speed) in zip(runs, motions, strict=True):
            expected_clock, expected = by_mujoco(model, run)
            np.testing.assert_array_equal(clock, expected_clock)
            np.testing.assert_array_equal(speed, expected)


@pytest.mark.parametrize(
    "limits",
    [
        {"acceleration_limit/s_curve": ("limit_rpm_s", "brake_rpm_s", "jerk_rpm_s2")},
        {
            "speed_saturation/supply": ("limit_rpm", "motor_s"),
            "acceleration_limit/drive": ("limit_rpm_s", "brake_rpm_s"),
        },
    ],
)
def test_wheels_that_are_computed_at_once_move_as_each_alone(paper, limits):
    rng = np.random.default_rng(2)
    runs = [random_run(rng) for _ in range(3)]
    # Not in the order of the chain.
    parameters = {**limits, "speed_gain": ("gain",), "command_latency": ("delay_s",)}
    of_name = {"motor_s": 0.2, "gain": 1.3, "delay_s": 0.25, "limit_rpm": 150.0, "jerk_rpm_s2": 5e3}
    effects = {
        effect: {name: of_name.get(name, 400.0) * rng.uniform(0.5, 1.0, 5) for name in names}
        for effect, names in parameters.items()
    }
    laws = np.array(paper.wheel.law.coefficients)[:, None] * rng.uniform(0.9, 1.0, 5)
    laws[0, 1] = 1.5  # unstable
    effects["command_latency"]["delay_s"][3] = 70 * paper.wheel.command_period_s  # too long for any drive
    found = list(FreeWheels.of(paper, laws, effects).motions(BenchRuns(runs)))
    assert [motions is None for motions in found] == [False, True, False, True, False]
    for i in (0, 2, 4):
        law = WheelLaw.from_coefficients(laws[:, i], paper.wheel.law.sample_period_s)
        values = {name: {key: one[i] for key, one in given.items()} for name, given in effects.items()}
        alone = replace(paper, wheel=replace(paper.wheel, law=law), effects=values)
        for (clock, speed), (expected_clock, expected) in zip(
            found[i], bench_motions([alone], runs)[0], strict=True
        ):
            np.testing.assert_array_equal(clock, expected_clock)
            np.testing.assert_allclose(speed, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("name", ["sensor_lowpass", "torque_ripple", "viscous_friction", "weak_servo"])
def test_wheels_with_effects_beyond_the_drive_are_not_computed_at_once(paper, name):
    with pytest.raises(ValueError, match="must all change nothing but the drive"):
        FreeWheels.of(paper, np.zeros((6, 2)), {name: {}})


def test_wheels_that_depend_on_their_run_are_not_computed_at_once(paper):
    with pytest.raises(ValueError, match="must act in every run alike"):
        FreeWheels.of(paper, np.zeros((6, 2)), {"battery_sag/voltage": {"per_volt": np.array([0.0, 0.1])}})


def test_each_wheel_has_its_own_law(paper, slow_law):
    run = random_run(np.random.default_rng(0))
    own = replace(paper, wheels={"rr": slow_law})
    alone = replace(paper, wheel=replace(paper.wheel, law=slow_law))
    expected = bench_motions([alone], [run])[0][0][1]
    np.testing.assert_array_equal(bench_motions([own], [run], wheel="rr")[0][0][1], expected)


def test_the_library_has_the_parameters_that_the_layout_names():
    assert parameter_names() == CHAIN


def test_a_delay_that_no_drive_remembers_is_refused(paper):
    longest = longest_delay_s(paper.wheel.command_period_s)
    run = random_run(np.random.default_rng(0))
    with pytest.raises(InputError, match="delay_s"):
        bench_motions([paper.with_effect("command_latency", delay_s=longest)], [run])


def test_an_unstable_law_is_refused(paper):
    unstable = replace(paper, wheel=replace(paper.wheel, law=replace(paper.wheel.law, A=1.5)))
    with pytest.raises(InputError, match="unstable"):
        bench_motions([unstable], [random_run(np.random.default_rng(0))])


def test_a_state_that_is_no_longer_finite_is_an_error(paper):
    law = replace(paper.wheel.law, D=1e9)
    with pytest.raises(SimulationDivergedError, match="diverged after 0"):
        bench_motions(
            [replace(paper, wheel=replace(paper.wheel, law=law))], [random_run(np.random.default_rng(0))]
        )


def test_an_effect_of_ones_own_may_change_the_mujoco_model(paper):
    def drag(spec, values, _model, _plant):
        spec.joint("wheel").damping[0] += values["drag"]

    effect = Effect(
        name="drag",
        station="load",
        acts_on="wheel joint",
        parameters=(Parameter("drag", "N m s/rad", 0.0, (0.0, 1.0)),),
        summary="As viscous friction.",
        signature="As viscous friction.",
        change_spec=drag,
    )
    run = random_run(np.random.default_rng(1))
    with registered(effect):
        own = replay_bench(paper.with_effect("drag", drag=0.1), run.time_s, run.command_rpm)
    builtin = paper.with_effect("viscous_friction", damping_n_m_s_rad=0.1)
    np.testing.assert_array_equal(own, replay_bench(builtin, run.time_s, run.command_rpm))
