from dataclasses import replace

import mujoco
import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.plugin.layout import drive_state
from mecanum_env.simulator import compile_bench, replay_bench
from mecanum_env.simulator.bench import law_of_bench
from mecanum_env.units import RAD_S_PER_RPM
from mecanum_env.wheel_drive.parameters import USER


def commands(seed=0, n=25):
    """Random commands that hold for 0.02 to 0.3 s, within what the wheel can do."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.uniform(0.02, 0.3, n)), rng.uniform(-100, 100, n)


def physics_clock(mj_model, time):
    step = mj_model.opt.timestep
    return np.arange(int(np.ceil((time[-1] - time[0]) / step)) + 1) * step


@pytest.mark.parametrize("initial", [0.0, 37.0, -60.0])
def test_the_free_wheel_is_the_law(paper, initial):
    time, command = commands()
    bench = compile_bench(paper)
    clock = physics_clock(bench, time)
    law = law_of_bench(paper, time, command, clock, initial)
    wheel = replay_bench(paper, time, command, sample_times_s=time[0] + clock, initial_rpm=initial)
    assert np.max(np.abs(wheel - law)) < 1e-9


def test_the_plugins_setpoint_is_the_law(paper):
    time, command = commands(1)
    bench = compile_bench(paper)
    clock = physics_clock(bench, time)
    law = law_of_bench(paper, time, command, clock)
    data = mujoco.MjData(bench)
    held = command[np.searchsorted(time - time[0], clock[:-1] + 1e-9, side="right") - 1]
    for n, ctrl in enumerate(held):
        data.ctrl[0] = ctrl
        mujoco.mj_step(bench, data)
        setpoint = drive_state(bench, data)["setpoint"][0] / RAD_S_PER_RPM
        assert setpoint == pytest.approx(law[n + 1], abs=1e-9)


def test_the_drive_knows_the_wheels_inertia(paper):
    bench = compile_bench(paper)
    known = bench.actuator_user[0, USER.index("inertia_kg_m2")]
    assert known == pytest.approx(bench.body("wheel").inertia[1], rel=1e-12)


def test_stamps_from_any_first_one_give_the_same(paper):
    time, command = commands(2)
    one = replay_bench(paper, time - time[0], command)
    two = replay_bench(paper, time - time[0] + 1000.0, command)
    np.testing.assert_allclose(two, one, atol=1e-6)


def test_a_missing_command_holds_the_one_before(paper):
    time = np.arange(0.0, 1.0, 0.05)
    command = np.where(time < 0.5, 60.0, 20.0)
    gaps = command.copy()
    gaps[[1, 2, 7, 11, 15]] = np.nan
    np.testing.assert_array_equal(replay_bench(paper, time, gaps), replay_bench(paper, time, command))


def test_before_the_first_command_the_wheel_goes_on(paper):
    time = np.arange(0.0, 1.0, 0.05)
    command = np.where(time < 0.5, np.nan, 20.0)
    speed = replay_bench(paper, time, command, initial_rpm=60.0)
    np.testing.assert_allclose(speed[time < 0.5], 60.0, atol=1e-9)
    assert speed[-1] == pytest.approx(20.0, abs=0.1)


def test_a_log_without_any_command_keeps_its_speed(paper):
    time = np.arange(0.0, 0.5, 0.1)
    speed = replay_bench(paper, time, np.full(time.shape, np.nan), initial_rpm=30.0)
    np.testing.assert_allclose(speed, 30.0, atol=1e-9)


def test_samples_may_lie_anywhere_after_the_start(paper):
    time, command = commands(3)
    samples = time[0] + np.array([0.0, 0.0031, 0.4, 0.1234, 1.0])
    speed = replay_bench(paper, time, command, sample_times_s=samples)
    order = np.argsort(samples)
    np.testing.assert_array_equal(
        replay_bench(paper, time, command, sample_times_s=samples[order]), speed[order]
    )
    assert speed[0] == 0


def test_a_wheel_may_have_its_own_law(paper, slow_law):
    slow = replace(paper, wheels={"rr": slow_law})
    time, command = np.arange(0.0, 0.5, 0.02), np.full(25, 60.0)
    common, own = (replay_bench(slow, time, command, wheel=w)[-1] for w in (None, "rr"))
    assert common == pytest.approx(60.0, abs=0.5)
    assert own == pytest.approx(60.0 * (1 - np.exp(-time[-1] / 0.5)), abs=0.5)


def test_latency_acts_on_the_bench_too(paper):
    late = paper.with_effect("command_latency", delay_s=0.1)
    time, command = np.arange(0.0, 0.6, 0.01), np.full(60, 60.0)
    plain, delayed = replay_bench(paper, time, command), replay_bench(late, time, command)
    np.testing.assert_allclose(delayed[10:], plain[:-10], atol=1e-6)
    clock = physics_clock(compile_bench(late), time)
    law = np.interp(time, clock, law_of_bench(late, time, command, clock))
    assert np.max(np.abs(law - delayed)) < 1.0


@pytest.mark.parametrize(
    ("time", "command", "extra", "said"),
    [
        ([0.0, 1.0], [1.0], {}, "one equal length"),
        ([], [], {}, "one equal length"),
        ([0.0, 1.0, 1.0], [1.0] * 3, {}, "stamp 3 is 1 s, must be later than 1 s"),
        ([0.0, np.nan], [1.0, 1.0], {}, "finite"),
        ([0.0, 1.0], [1.0, np.inf], {}, "infinite"),
        ([0.0, 1.0], [1.0, 1.0], {"initial_rpm": np.nan}, "finite"),
        ([5.0, 6.0], [1.0, 1.0], {"sample_times_s": np.array([4.0])}, "a sample at 4 s"),
        ([5.0, 6.0], [1.0, 1.0], {"sample_times_s": np.array([])}, "at least one time"),
        ([0.0, 1.0], [1.0, 1.0], {"gap_share": 1.5}, "gap_share = 1.5, must be from -1 to 1"),
        ([0.0, 1.0], [1.0, 1.0], {"gap_share": np.nan}, "gap_share = nan, must be from -1 to 1"),
    ],
)
def test_an_impossible_log_is_refused(paper, time, command, extra, said):
    with pytest.raises(InputError, match=said):
        replay_bench(paper, np.array(time), np.array(command), **extra)
