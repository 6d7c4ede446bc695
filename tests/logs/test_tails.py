"""Samples that count less: outliers, heavy tails, noise that grows with the speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, Dataset, Run
from sysid.logs.tail_laws import sensor_noise
from sysid.logs.tails import weighted_down


def bench_run(noise: FloatArray, speed_rpm: float = 60.0) -> Run:
    time = 0.02 * np.arange(noise.size)
    command = np.where(time >= 0.1, speed_rpm, 0.0)
    return Run("run.csv", "run", "fit", time, BenchCommand(command), {"speed_rpm": command + noise})


def dataset(*runs: Run) -> Dataset:
    return Dataset("logs", runs, ())


def test_normal_noise_leaves_a_dataset_as_it_is() -> None:
    data = dataset(bench_run(np.random.default_rng(0).normal(size=1000)))
    found, tails = weighted_down(data)
    assert found is data
    assert not tails


def test_outliers_count_little_and_their_share_is_said() -> None:
    noise = np.random.default_rng(1).normal(size=1000)
    noise[200::100] += 30.0
    found, tails = weighted_down(dataset(bench_run(noise)))
    weights = found.runs[0].weights["speed_rpm"]
    assert np.all(weights[200::100] < 0.02)
    assert np.median(weights) > 0.8
    assert tails["speed_rpm"].outliers == pytest.approx(0.008, abs=0.004)


def test_a_single_wild_sample_soon_after_a_change_counts_little_too() -> None:
    noise = np.random.default_rng(2).normal(size=1000)
    noise[[16, 300, 500, 700, 900]] -= 50.0
    found, _ = weighted_down(dataset(bench_run(noise)))
    assert found.runs[0].weights["speed_rpm"][16] < 0.02


def test_a_wild_sample_near_a_change_is_seen_beside_the_noise_of_its_speed() -> None:
    rng = np.random.default_rng(5)
    slow, fast = bench_run(rng.normal(size=600), 10.0), bench_run(4.0 * rng.normal(size=600), 100.0)
    fast.command.wheels_rpm[500:] = 0.0
    fast.channels["speed_rpm"][500:] -= 100.0
    # Soon after the start, and the last but one before the stop: one of its four neighbours is at rest.
    fast.channels["speed_rpm"][[15, 498]] -= 90.0
    found, _ = weighted_down(dataset(slow, fast))
    weights = found.runs[1].weights["speed_rpm"]
    assert np.all(weights[[15, 498]] < 0.2 * np.median(weights[50:450]))


def test_noise_that_grows_with_the_speed_counts_less_at_speed() -> None:
    rng = np.random.default_rng(3)
    slow, fast = bench_run(rng.normal(size=600), 10.0), bench_run(4.0 * rng.normal(size=600), 100.0)
    found, tails = weighted_down(dataset(slow, fast))
    slow_weight, fast_weight = (np.median(run.weights["speed_rpm"]) for run in found.runs)
    assert fast_weight / slow_weight == pytest.approx(1.0 / 16.0, rel=0.5)
    assert tails["speed_rpm"].growth > 0.0


def test_normal_noise_that_is_rounded_to_coarse_steps_has_no_tails() -> None:
    rng = np.random.default_rng(4)
    runs = [bench_run(np.round(rng.normal(0.3, 0.6, 1000) / 1.7) * 1.7, speed) for speed in (17.0, 34.0)]
    _, tails = weighted_down(dataset(*runs))
    assert not tails


def test_counts_of_an_encoder_at_uneven_stamps_are_no_outliers() -> None:
    rng = np.random.default_rng(6)
    runs = []
    for speed in (60.5, 88.5):
        run = bench_run(np.zeros(600), speed)
        # One count in a sampling interval is 4 rpm: few samples differ from the others, by a whole count.
        stamps = run.time_s + rng.uniform(0.0, 2e-5, run.time_s.size)
        counts = np.diff(np.floor(np.cumsum(run.channels["speed_rpm"] + 0.2) / 4.0), prepend=0.0)
        measured = 4.0 * counts * 0.02 / np.diff(stamps, prepend=-0.02)
        runs.append(replace(run, channels={"speed_rpm": np.round(measured, 2)}))
    found, tails = weighted_down(dataset(*runs))
    assert all(law.outliers == 0.0 for law in tails.values())
    assert all(np.min(run.weights.get("speed_rpm", np.ones(1))) > 0.5 for run in found.runs)
    assert sensor_noise(runs, "speed_rpm").step == pytest.approx(4.0, rel=0.1)


def test_the_step_of_a_sensor_is_that_of_the_numbers_where_these_follow_a_law() -> None:
    noise = np.round(np.random.default_rng(7).standard_t(3.0, 2000), 1)
    found = sensor_noise([bench_run(noise)], "speed_rpm")
    assert found.step == pytest.approx(0.1)
    assert found.tails is not None
    assert found.tails.freedom == pytest.approx(3.0, abs=1.0)
