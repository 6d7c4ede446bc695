"""Logs as recorders write them: stamps that differ between repeats, speeds in encoder counts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import sysid.compare.predicted.simulator as simulator
from mecanum_env.model import Model
from mecanum_env.simulator.free_wheel import BenchRun, BenchRuns, FreeWheel
from sysid.compare.measured import observe
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import Simulator
from sysid.compare.predicted.motion import Motion
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from tests.gap.conftest import NOISE_RPM, MakeLogs

FEW = GapOptions(only=("direction_asymmetry", "acceleration_limit"), next_experiment=False)


@pytest.mark.parametrize(
    "logs", [{"late_s": 2e-5}, {"late_s": 4e-3}, {"step_rpm": 1.5, "noise_rpm": 0.2}, {"step_rpm": 0.5}]
)
def test_an_effect_is_named_and_none_is_no_gap(
    bench_logs: MakeLogs, base: Model, logs: dict[str, float]
) -> None:
    reverse = base.with_effect("direction_asymmetry", reverse_ratio=0.9)
    found = analyse(bench_logs(reverse, seed=1, **logs), base, FEW)
    assert [effect.name for effect in found.effects] == ["direction_asymmetry"]
    assert found.verdict == "named"
    assert found.effects[0].parameters["reverse_ratio"].value == pytest.approx(0.9, abs=0.01)
    assert analyse(bench_logs(base, seed=2, **logs), base, FEW).verdict == "no_gap"


@pytest.mark.parametrize("late_s", [2e-5, 4e-3])
def test_the_noise_is_known_from_repeats(bench_logs: MakeLogs, base: Model, late_s: float) -> None:
    data = bench_logs(base, late_s=late_s)
    noise = measure_noise(data, observe(data))
    assert noise.from_repeats
    assert noise.degrees_of_freedom > 1000
    assert noise.sigma["speed_rpm"] == pytest.approx(NOISE_RPM, rel=0.1)


def test_a_quantised_speed_that_stays_constant_has_noise(bench_logs: MakeLogs, base: Model) -> None:
    data = bench_logs(base, noise_rpm=0.3, step_rpm=1.5)
    noise = measure_noise(data, observe(data))
    assert noise.scatter["speed_rpm"] >= 1.5 / np.sqrt(12.0)
    assert not noise.inconsistent_channels(3.0)


def test_a_note_points_at_repeats_that_differ_by_more_than_noise(bench_logs: MakeLogs, base: Model) -> None:
    data = bench_logs(base, noise_rpm=0.2)
    rng = np.random.default_rng(0)
    other = [
        replace(run, channels={"speed_rpm": run.channels["speed_rpm"] * (1.0 + 0.02 * rng.standard_normal())})
        for run in data.runs
    ]
    said = "changes from run to run"
    assert any(said in note for note in analyse(replace(data, runs=tuple(other)), base, FEW).notes)
    assert not any(said in note for note in analyse(data, base, FEW).notes)


def test_repeats_are_simulated_once(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulated: list[BenchRun] = []

    def counted(wheel: FreeWheel, runs: BenchRuns) -> list[Motion]:
        simulated.extend(runs.runs)
        return bench_motions_of(wheel, runs)

    bench_motions_of = simulator.bench_motions_of
    monkeypatch.setattr(simulator, "bench_motions_of", counted)
    observations = observe(bench_logs(base, late_s=4e-3))
    assert len(observations.situations) == 15
    parts = Simulator(observations).predictions(base)
    assert len(simulated) == 5
    for block, part in zip(observations.blocks, parts, strict=True):
        assert np.std(block.value - part) < 1.5 * NOISE_RPM
