"""Studies of logs that show each command in the first row after it was given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator.bench import bench_motion
from sysid.compare.links import with_stamps
from sysid.compare.links.in_model import late_between_rows
from sysid.gap import GapOptions, analyse
from sysid.logs import BenchCommand, Dataset, Run

ROW_S, LATE_S = 0.04, 0.004
"""Time between rows, and how late a tick of the law takes commands on average."""


def logs(model: Model, seed: int) -> Dataset:
    """Return five sequences, each driven twice, whose commands are given between rows 40 ms apart."""
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 480.0))
    rng, runs = np.random.default_rng(seed), []
    time = np.arange(0.0, 4.0, ROW_S)
    for index, split in enumerate(("fit", "fit", "validation", "fit", "test")):
        sent = 0.2 + 0.5 * np.arange(7) + rng.uniform(0.0, 0.2, 7)
        levels = np.append(0.0, rng.permutation([-110.0, -80.0, -45.0, -10.0, 35.0, 70.0, 105.0]))
        clock, true = bench_motion(fine, np.append(0.0, sent), levels, float(time[-1]))
        command = BenchCommand(levels[np.searchsorted(sent, time + 1e-9, side="right")])
        for repeat in range(2):
            speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
            runs.append(Run(f"r{index}_{repeat}", f"g{index}", split, time, command, {"speed_rpm": speed}))
    return Dataset("rows", tuple(runs), (), f"seed {seed}")


@pytest.fixture
def stamped() -> Model:
    """Return the wheel of the logs, and that these show commands in the first row after they were given."""
    model = paper_model()
    wheel = replace(model.wheel, command_period_s=model.wheel.law.sample_period_s)
    return with_stamps(replace(model, wheel=wheel), LATE_S)


OPTIONS = GapOptions(next_experiment=False)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_logs_of_the_model_have_no_gap(stamped: Model, seed: int) -> None:
    report = analyse(logs(paper_model(), seed), stamped, OPTIONS)
    assert report.verdict == "no_gap"
    assert any("in the first row after it was given" in note for note in report.notes)


def test_a_smaller_gain_is_found(stamped: Model) -> None:
    report = analyse(logs(paper_model().with_effect("speed_gain", gain=0.93), 2), stamped, OPTIONS)
    assert report.verdict in ("named", "ambiguous")
    assert any("speed_gain" in names for names in report.candidates)
    assert late_between_rows(report.model) == LATE_S
    assert report.gap.after < 0.5 * report.gap.before
