"""Delays of single changes of a command, as latent values."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator.bench import bench_motion
from mecanum_env.units import FloatArray
from sysid.compare.late_links import aligned, on_aligned, without_delays
from sysid.compare.link_delays import link_delays
from sysid.compare.observations import observe
from sysid.compare.simulator import Simulator
from sysid.logs import BenchCommand, Dataset, Run

TICK = 1.0 / 120.0


def logs(delays: FloatArray, noise_rpm: float = 0.5, interval_s: float = 0.03) -> tuple[Model, Dataset]:
    """Return a model without delay, and runs of one step up and one down each, at delays of shape (n, 2)."""
    model = paper_model()
    fine = replace(model, wheel=replace(model.wheel, command_period_s=TICK))
    rng, runs = np.random.default_rng(5), []
    for index, own in enumerate(delays):
        speed = 30.0 + 10.0 * (index % 5)
        time = np.cumsum(rng.uniform(0.9, 1.1, 120) * interval_s)
        time -= time[0]
        given = time[np.searchsorted(time, [0.5, 2.0])]
        acts = np.concatenate([[0.0], given + own])
        clock, true = bench_motion(fine, acts, np.array([0.0, speed, 0.0]), float(time[-1]))
        measured = np.interp(time, clock, true) + noise_rpm * rng.normal(size=time.size)
        command = np.where((time >= given[0]) & (time < given[1]), speed, 0.0)
        split = ("fit", "validation", "test")[min(2, index % 4)] if index % 4 else "fit"
        runs.append(
            Run(f"r{index}", f"g{index}", split, time, BenchCommand(command), {"speed_rpm": measured})
        )
    return model, Dataset("logs", tuple(runs), ())


def spread_delays(seed: int, count: int, spread_s: float, mean_s: float = 0.12) -> FloatArray:
    drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 2)) * np.sqrt(3.0) * spread_s
    return np.asarray(mean_s + drawn)


def test_the_delay_of_each_change_is_found() -> None:
    truth = spread_delays(0, 10, 0.03)
    model, data = logs(truth)
    found = link_delays(without_delays(model), data.runs, None, TICK / 2.0)
    assert found.jitters
    np.testing.assert_allclose(found.delay_s, truth.ravel(), atol=0.02)
    assert found.spread_s == pytest.approx(float(np.std(truth)), rel=0.4)
    assert found.mean_s == pytest.approx(0.12, abs=0.02)


def test_a_common_delay_is_no_spread() -> None:
    model, data = logs(np.full((10, 2), 0.12))
    assert not link_delays(without_delays(model), data.runs, None, TICK / 2.0).jitters


def test_delays_up_to_half_a_second_are_found() -> None:
    truth = spread_delays(2, 10, 0.02, 0.42)
    model, data = logs(truth)
    found = link_delays(without_delays(model), data.runs, None, TICK / 2.0)
    np.testing.assert_allclose(found.delay_s, truth.ravel(), atol=0.02)


def test_changes_that_go_with_their_direction_are_no_jitter() -> None:
    truth = np.column_stack([np.full(10, 0.14), np.full(10, 0.09)])
    model, data = logs(truth)
    assert not link_delays(without_delays(model), data.runs, None, TICK / 2.0).jitters


def test_a_change_that_never_acts_is_lost() -> None:
    truth = spread_delays(3, 10, 0.03)
    truth[4] = 100.0
    model, data = logs(truth)
    found = link_delays(without_delays(model), data.runs, None, TICK / 2.0)
    assert found.lost[8]
    assert found.loss == pytest.approx(0.05, abs=0.051)


def test_aligned_logs_are_predicted_with_one_delay() -> None:
    model, data = logs(spread_delays(4, 10, 0.03))
    found = link_delays(without_delays(model), data.runs, None, TICK / 2.0)

    def error(logged: Dataset, period_s: float) -> float:
        observations = observe(logged)
        predicted = Simulator(observations).predictions(on_aligned(model, found.mean_s, period_s))
        parts = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
        return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))

    assert error(aligned(data, found, TICK / 2.0), TICK / 2.0) < 0.5 * error(data, TICK)
