"""Empty cells of a recording are no evidence: a wheel as modelled stays one without a gap."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from mecanum_env.simulator import replay_bench
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start, observe, start_of
from sysid.compare.measured.observations import MOST_SAMPLES
from sysid.compare.noise import measure_noise
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run
from tests.gap.conftest import NOISE_RPM, SPLITS, MakeLogs, commands

FEW = GapOptions(only=("direction_asymmetry", "acceleration_limit"), next_experiment=False)


def long_logs(model: Model, repeats: int) -> Dataset:
    """Return bench logs of 4 s with more rows than are compared one by one."""
    rng = np.random.default_rng(3)
    runs = []
    for i, (levels, split) in enumerate(zip(commands(rng), SPLITS, strict=True)):
        command = np.repeat(levels, 40)
        time = np.arange(command.size) * 0.005
        speed = replay_bench(model, time, command)
        assert time.size > MOST_SAMPLES
        for k in range(repeats):
            channels = {"speed_rpm": speed + NOISE_RPM * rng.standard_normal(time.size)}
            runs.append(Run(f"run{i}_{k}.csv", f"run{i}", split, time, BenchCommand(command), channels))
    return Dataset("long bench", tuple(runs), (), "long")


def with_holes(dataset: Dataset, share: float, rows: int, seed: int = 5) -> Dataset:
    """Return the logs with a share of their cells empty, `rows` at a time."""
    rng = np.random.default_rng(seed)

    def emptied(values: FloatArray) -> FloatArray:
        holes = rng.choice(values.size - rows, round(share * values.size / rows), replace=False)
        left = np.array(values)
        left[(holes[:, None] + np.arange(rows)).ravel()] = np.nan
        return left

    def cells(channels: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {name: emptied(values) for name, values in channels.items()}

    return replace(dataset, runs=tuple(replace(run, channels=cells(run.channels)) for run in dataset.runs))


@pytest.mark.parametrize("repeats", [1, 3])
@pytest.mark.parametrize(("share", "rows"), [(0.1, 1), (0.3, 1), (0.3, 20)])
def test_empty_cells_are_no_gap(base: Model, repeats: int, share: float, rows: int) -> None:
    assert analyse(with_holes(long_logs(base, repeats), share, rows), base, FEW).verdict == "no_gap"


def test_a_recording_that_begins_late_does_not_begin_in_motion(bench_logs: MakeLogs, base: Model) -> None:
    run = bench_logs(base).runs[0]
    run.channels["speed_rpm"][: int(np.argmax(np.abs(run.channels["speed_rpm"]))) + 1] = np.nan
    assert start_of(run) == Start()


@pytest.mark.parametrize("rows", [1, 10])
def test_neighbours_across_a_hole_do_not_tell_the_noise(bench_logs: MakeLogs, base: Model, rows: int) -> None:
    whole = bench_logs(base, repeats=1)
    holed = with_holes(whole, 0.3, rows)
    before, after = (measure_noise(data, observe(data)).sigma["speed_rpm"] for data in (whole, holed))
    assert after == pytest.approx(before, rel=0.15)
