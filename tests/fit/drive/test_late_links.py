"""A fit to bench logs whose commands arrive late by a time of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.simulator.bench import bench_motion
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import BenchCommand, Dataset, Run

MEAN_S, SPREAD_S = 0.1, 0.04
QUICK = FitOptions(starts=1, effects="off")


def logs(spread_s: float) -> Dataset:
    """Return runs of five steps each through a link that delays them by a mean and a spread [s]."""
    model = paper_model()
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 240.0))
    rng, runs = np.random.default_rng(3), []
    for index in range(8):
        time, given = np.arange(0.0, 6.0, 0.02), np.arange(0.5, 5.5, 1.0)
        levels = np.append(0.0, rng.choice([-1, 1], given.size) * rng.integers(30, 110, given.size))
        late = MEAN_S + spread_s * rng.uniform(-1.0, 1.0, given.size) * np.sqrt(3.0)
        clock, true = bench_motion(fine, np.append(0.0, given + late), levels, float(time[-1]))
        speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
        command = BenchCommand(levels[np.searchsorted(given, time + 1e-9, side="right")])
        split = ("fit", "fit", "validation", "test")[index % 4]
        runs.append(Run(f"r{index}", f"g{index}", split, time, command, {"speed_rpm": speed}))
    return Dataset("link", tuple(runs), ())


def test_the_law_is_fitted_beside_the_delay_of_each_command() -> None:
    fit = fit_dataset(logs(SPREAD_S), QUICK)
    assert fit.link is not None
    assert fit.link.delays.spread_s == pytest.approx(SPREAD_S, rel=0.4)
    described = fitted_model(fit)
    assert described.effects["command_latency/jitter"]["jitter_s"] == fit.link.delays.spread_s
    assert described.wheel.command_period_s == fit.link.given.wheel.command_period_s
    assert any("acts at a time of its own" in note for note in fit.notes)


def test_one_delay_for_all_commands_is_no_late_link() -> None:
    fit = fit_dataset(logs(0.0), QUICK)
    assert fit.link is None
    assert fitted_model(fit).effects["command_latency"]["delay_s"] == pytest.approx(MEAN_S, abs=0.01)
