from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.units import FloatArray
from sysid.logs import Run
from sysid.logs.noise import noise_from_repeats

BenchRun = Callable[..., Run]
Step = Callable[..., FloatArray]
Repeats = Callable[..., list[Run]]


@pytest.fixture(scope="session")
def repeats(bench_run: BenchRun, step_command: Step) -> Repeats:
    """Make so many repeats of one step with white noise."""

    def make(rng: np.random.Generator, std: float, count: int) -> list[Run]:
        command = step_command(40, after=2000)
        return [
            bench_run(f"{r}.csv", command, command + std * rng.standard_normal(command.size), group="g")
            for r in range(count)
        ]

    return make


def test_no_repeats_give_no_noise(bench_run: BenchRun, step_command: Step) -> None:
    assert (
        noise_from_repeats(
            [bench_run("a.csv", step_command(40), group="a"), bench_run("b.csv", step_command(80), group="b")]
        )
        is None
    )


@pytest.mark.parametrize("count", [2, 3, 5])
def test_noise_is_recovered_without_bias(count: int, repeats: Repeats) -> None:
    noise = noise_from_repeats(repeats(np.random.default_rng(count), 0.5, count))
    assert noise is not None
    item = noise["speed_rpm"]
    assert item.degrees_of_freedom == (count - 1) * 2020
    assert item.std == pytest.approx(0.5, abs=4 * 0.5 * item.relative_error)


@settings(max_examples=20, deadline=None)
@given(shift=st.floats(0.0, 0.0099), rate=st.sampled_from([0.007, 0.01, 0.013]))
def test_noise_is_recovered_where_stamps_differ(
    shift: float, rate: float, repeats: Repeats, bench_run: BenchRun
) -> None:
    rng = np.random.default_rng(3)
    first, second = repeats(rng, 0.5, 2)
    time = shift + rate * np.arange(int(20.0 / rate))
    values = np.where(time >= 0.2, 40.0, 0.0)
    command = bench_run(
        "1.csv", values, values + 0.5 * rng.standard_normal(time.size), time_s=time, group="g"
    )
    # The step is a real difference between runs that change one sample apart: compare after it.
    late = [_after(first, 0.3), _after(command, 0.3)]
    noise = noise_from_repeats(late)
    assert noise is not None
    assert noise["speed_rpm"].std == pytest.approx(0.5, rel=0.1)
    assert second.group == first.group


def _after(run: Run, time_s: float) -> Run:
    speed = np.where(run.time_s >= time_s, run.channels["speed_rpm"], np.nan)
    return replace(run, channels={"speed_rpm": speed})


def test_missing_samples_are_left_out(repeats: Repeats) -> None:
    one, other = repeats(np.random.default_rng(0), 0.5, 2)
    speed = one.channels["speed_rpm"].copy()
    speed[100:1100] = np.nan
    noise = noise_from_repeats([replace(one, channels={"speed_rpm": speed}), other])
    assert noise is not None
    assert noise["speed_rpm"].degrees_of_freedom == 1020


def test_a_late_start_of_the_recording_is_aligned(bench_run: BenchRun, step_command: Step) -> None:
    command = step_command(40, before=20)
    late = step_command(40, before=50)
    curve = np.minimum(40.0, np.arange(150) * 1.0)
    runs = [
        bench_run("a.csv", command, np.concatenate([np.zeros(20), curve[:100]]), group="g"),
        bench_run("b.csv", late, np.concatenate([np.zeros(50), curve[:100]]), group="g"),
    ]
    noise = noise_from_repeats(runs)
    assert noise is not None
    assert noise["speed_rpm"].std == pytest.approx(0.0, abs=1e-12)


def test_a_heading_that_passes_half_a_turn_is_no_noise(bench_run: BenchRun, step_command: Step) -> None:
    base = bench_run("a.csv", step_command(40), group="g")
    yaw = np.linspace(0.0, 9.0, 120)
    wrapped = np.angle(np.exp(1j * yaw))
    runs = [
        replace(base, channels={"yaw_rad": yaw}),
        replace(base, file="b.csv", channels={"yaw_rad": wrapped}),
    ]
    noise = noise_from_repeats(runs)
    assert noise is not None
    assert noise["yaw_rad"].std == pytest.approx(0.0, abs=1e-12)
