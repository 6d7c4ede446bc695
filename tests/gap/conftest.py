"""Small bench studies whose truth is known: the paper's wheel, with and without an effect."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.units import FloatArray
from sysid.gap.search.scores import ScoredSet
from sysid.logs import BenchCommand, Dataset, Run, Split

NOISE_RPM = 0.5
SPLITS: tuple[Split, ...] = ("fit", "fit", "validation", "fit", "test")

MakeLogs = Callable[..., Dataset]


def commands(rng: np.random.Generator, count: int = 5) -> list[FloatArray]:
    """Return command sequences of 2 s, one value per 0.1 s, with reversals and small ones."""
    found = []
    for _ in range(count):
        levels = rng.integers(-120, 121, 5).astype(float)
        levels[2] = rng.integers(4, 12)
        found.append(np.concatenate([np.zeros(2), np.repeat(levels, [5, 4, 4, 3, 2])]))
    return found


def a_set(score: float, *names: str) -> ScoredSet:
    """Return a scored set of which only score and names are known."""
    numbers = 5 if "static_map" in names else len(names)
    fitted: Any = SimpleNamespace(names=names, candidate=SimpleNamespace(parameter_count=numbers))
    return ScoredSet(fitted, np.array([score]))


@pytest.fixture(scope="session")
def bench_logs() -> MakeLogs:
    """Return a maker of bench logs: what the model does, with noise, three repeats, from a seed.

    On request stamps are uneven (each sample late by up to `late_s`), speeds are in whole steps (`step_rpm`),
    and a logged voltage falls and recovers by up to `falls_v`.
    """

    def make(
        model: Model,
        seed: int = 0,
        repeats: int = 3,
        noise_rpm: float = NOISE_RPM,
        late_s: float = 0.0,
        step_rpm: float = 0.0,
        falls_v: float = 0.0,
    ) -> Dataset:
        rng = np.random.default_rng(seed)
        runs = []
        for i, (levels, split) in enumerate(zip(commands(rng), SPLITS, strict=True)):
            time = np.arange(10 * levels.size + 1) * 0.01
            command = np.append(np.repeat(levels, 10), levels[-1])
            levels_v = np.append(0.0, rng.uniform(0.0, falls_v, 4)) if falls_v else np.zeros(5)
            battery_v = 24.0 - np.interp(time, np.linspace(0.0, time[-1], 5), levels_v)
            speed = replay_bench(model, time, command, battery_v=battery_v)
            for k in range(repeats):
                stamps = time
                if late_s:
                    stamps = time + np.append(0.0, rng.uniform(0.0, late_s, time.size - 1))
                    speed = replay_bench(model, time, command, sample_times_s=stamps)
                measured = speed + noise_rpm * rng.standard_normal(time.size)
                if step_rpm:
                    measured = np.rint(measured / step_rpm) * step_rpm
                channels = {"speed_rpm": measured} | ({"battery_v": battery_v} if falls_v else {})
                name = f"run{i}_{k}.csv"
                runs.append(Run(name, f"run{i}", split, stamps, BenchCommand(command), channels))
        return Dataset("test bench", tuple(runs), (), f"seed {seed}")

    return make


@pytest.fixture(scope="session")
def base() -> Model:
    """Return the paper's wheel."""
    return paper_model()
