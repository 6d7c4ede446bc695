"""Bench logs through a link that delays every change of the command by a known time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.simulator.bench import bench_motion
from mecanum_env.units import FloatArray
from sysid.compare.links import LinkClock
from sysid.logs import BenchCommand, Dataset, Run

MakeLogs = Callable[[FloatArray], Dataset]
MakeDelays = Callable[..., FloatArray]
_NOISE_RPM, _INTERVAL_S = 0.5, 0.03
LATE_NOISE_RPM = 0.3  # of `each_late`


@pytest.fixture
def model() -> Model:
    """Return a model without delay."""
    return paper_model()


@pytest.fixture
def at_once(model: Model) -> LinkClock:
    """Return the clock of a drive that takes commands at once."""
    return LinkClock(model.wheel.law.sample_period_s, None)


@pytest.fixture
def delayed(model: Model, at_once: LinkClock) -> MakeLogs:
    """Return a function from delays [s], (n, 2), to runs of one step up and one down each."""
    fine = replace(model, wheel=replace(model.wheel, command_period_s=at_once.tick_s))

    def logs(delays: FloatArray) -> Dataset:
        rng, runs = np.random.default_rng(5), []
        for index, own in enumerate(delays):
            speed = 30.0 + 10.0 * (index % 5)
            time = np.cumsum(rng.uniform(0.9, 1.1, 120) * _INTERVAL_S)
            time -= time[0]
            given = time[np.searchsorted(time, [0.5, 2.0])]
            acts = np.concatenate([[0.0], given + own])
            clock, true = bench_motion(fine, acts, np.array([0.0, speed, 0.0]), float(time[-1]))
            measured = np.interp(time, clock, true) + _NOISE_RPM * rng.normal(size=time.size)
            command = BenchCommand(np.where((time >= given[0]) & (time < given[1]), speed, 0.0))
            split = ("fit", "validation", "test")[min(2, index % 4)] if index % 4 else "fit"
            runs.append(Run(f"r{index}", f"g{index}", split, time, command, {"speed_rpm": measured}))
        return Dataset("logs", tuple(runs), ())

    return logs


@pytest.fixture
def spread_delays() -> MakeDelays:
    """Return a function that draws ten pairs of delays [s] with a mean and a spread."""

    def draw(seed: int, *, spread_s: float = 0.03, mean_s: float = 0.12) -> FloatArray:
        drawn = np.random.default_rng(seed).uniform(-1.0, 1.0, (10, 2)) * np.sqrt(3.0) * spread_s
        return np.asarray(mean_s + drawn)

    return draw


@pytest.fixture
def each_late(model: Model) -> MakeLogs:
    """Return a function from delays [s], (n,), to runs of one step up and one down, each late by its own."""

    def logs(delays: FloatArray) -> Dataset:
        rng, runs = np.random.default_rng(3), []
        time = np.arange(0.0, 3.0, 0.01)
        command = np.where((time >= 0.5) & (time < 1.7), 90.0, 0.0)
        for index, delay_s in enumerate(delays):
            late = model.with_effect("command_latency", delay_s=float(delay_s))
            speed = replay_bench(late, time, command) + LATE_NOISE_RPM * rng.standard_normal(time.size)
            log = BenchCommand(command)
            runs.append(Run(f"r{index}", f"g{index}", "fit", time, log, {"speed_rpm": speed}))
        return Dataset("logs", tuple(runs), ())

    return logs
