"""The noise that decisions use is found without a look at the test runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from mecanum_env.simulator import replay_bench
from sysid.compare.measured import observe
from sysid.compare.noise import Noise, measure_noise
from sysid.logs import BenchCommand, Dataset, Run
from tests.gap.conftest import NOISE_RPM, MakeLogs


def _noise(dataset: Dataset) -> Noise:
    deciding = dataset.split("fit") + dataset.split("validation") or dataset.runs
    return measure_noise(dataset, observe(replace(dataset, runs=deciding)))


def _with_loud_test_runs(dataset: Dataset) -> Dataset:
    rng = np.random.default_rng(4)
    for run in dataset.split("test"):
        run.channels["speed_rpm"][:] += 10.0 * NOISE_RPM * rng.standard_normal(run.time_s.size)
    return dataset


@pytest.mark.parametrize("late_s", [0.0, 2e-5])
def test_repeats_of_test_runs_do_not_change_the_noise(
    bench_logs: MakeLogs, base: Model, late_s: float
) -> None:
    quiet, loud = bench_logs(base, late_s=late_s), _with_loud_test_runs(bench_logs(base, late_s=late_s))
    assert _noise(loud) == _noise(quiet)


@pytest.mark.parametrize("late_s", [0.0, 2e-5])
def test_where_only_test_runs_have_repeats_neighbouring_samples_tell_the_noise(
    bench_logs: MakeLogs, base: Model, late_s: float
) -> None:
    logs = _with_loud_test_runs(bench_logs(base, late_s=late_s))
    runs = tuple(run for run in logs.runs if run.split == "test" or run.file.endswith("_0.csv"))
    noise = _noise(replace(logs, runs=runs))
    assert noise.source == {"speed_rpm": "motion"}
    assert noise.sigma["speed_rpm"] == pytest.approx(NOISE_RPM, rel=0.3)


def test_where_all_runs_are_test_runs_their_repeats_count(bench_logs: MakeLogs, base: Model) -> None:
    logs = bench_logs(base, late_s=2e-5)
    only = replace(logs, runs=tuple(replace(run, split="test") for run in logs.runs))
    assert _noise(only).from_repeats


def test_a_change_of_the_command_is_no_noise_where_commands_are_held_for_hardly_longer_than_they_settle(
    base: Model,
) -> None:
    """Of each hold one or two samples are settled; what follows is the next change."""
    rng, runs = np.random.default_rng(3), []
    for index in range(4):
        time_s = np.arange(0.0, 12.0, 0.04)
        levels = 60.0 * rng.choice([-1.0, 1.0], 22) * rng.uniform(0.5, 2.0, 22)
        command = levels[np.minimum((time_s / 0.56).astype(int), levels.size - 1)]
        speed = replay_bench(base, time_s, command) + NOISE_RPM * rng.standard_normal(time_s.size)
        runs.append(Run(f"r{index}", f"g{index}", "fit", time_s, BenchCommand(command), {"speed_rpm": speed}))
    noise = _noise(Dataset("short holds", tuple(runs), ()))
    assert noise.source == {"speed_rpm": "motion"}
