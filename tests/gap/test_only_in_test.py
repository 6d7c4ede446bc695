"""What only the test runs show, which do not decide, is no "no gap"."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mecanum_env.model import Model
from sysid.gap.only_in_test import odd_test_runs
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import Dataset
from tests.gap.conftest import MakeLogs


def slowed(dataset: Dataset, fewest: int) -> Dataset:
    """Return logs of which so many test runs show a wheel that is a fifth too slow."""
    runs, left = [], fewest
    for run in dataset.runs:
        if run.split == "test" and left:
            run, left = replace(run, channels={"speed_rpm": 0.8 * run.channels["speed_rpm"]}), left - 1
        runs.append(run)
    return replace(dataset, runs=tuple(runs), sha256="slowed")


def test_a_gap_in_the_test_runs_alone_is_unexplained(bench_logs: MakeLogs, base: Model) -> None:
    options = GapOptions(next_experiment=False, fitted_on=bench_logs(base, seed=1))
    report = analyse(slowed(bench_logs(base, seed=1), 3), base, options)
    assert report.verdict == "unexplained"
    assert any("test runs differ from the logs of the fit" in note for note in report.notes)


def test_one_odd_test_run_is_no_gap_and_is_pointed_out(bench_logs: MakeLogs, base: Model) -> None:
    logs = slowed(bench_logs(base, seed=1), 1)
    report = analyse(logs, base, GapOptions(next_experiment=False, fitted_on=bench_logs(base, seed=1)))
    assert report.verdict == "no_gap"
    (note,) = [note for note in report.notes if "as any other run" in note]
    assert f"the model misses {logs.split('test')[0].file} (" in note


def test_test_runs_like_the_others_are_not_pointed_out(bench_logs: MakeLogs, base: Model) -> None:
    logs, fitted_on = bench_logs(base, seed=2), bench_logs(base, seed=1)
    assert odd_test_runs(logs, base, fitted_on) == ""
    assert odd_test_runs(logs, base, None) == ""


def test_a_run_without_one_measured_speed_says_nothing_of_others(bench_logs: MakeLogs, base: Model) -> None:
    logs = slowed(bench_logs(base, seed=2), 1)
    first = logs.split("fit")[0]
    nothing = replace(first, channels={"speed_rpm": np.full_like(first.time_s, np.nan)})
    logs = replace(logs, runs=tuple(nothing if run is first else run for run in logs.runs))
    assert "the model misses" in odd_test_runs(logs, base, None)
