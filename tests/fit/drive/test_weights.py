"""Weights of noise that grows with the speed, where a law explains the logs and where it does not."""

from __future__ import annotations

import numpy as np
import pytest

from sysid.fit import FitOptions, fit_dataset
from sysid.logs import BenchCommand, Dataset, Run
from sysid.logs.runs import Split


def logs(bend: float) -> Dataset:
    """Return runs of a lag with 2 % noise, hardly any at rest, that loses the share `bend` at 100 rpm."""
    rng = np.random.default_rng(0)

    def run(name: str, split: Split) -> Run:
        held = np.repeat(rng.choice([-100.0, -60.0, 0.0, 60.0, 100.0], 8), 60)
        command = np.concatenate([np.zeros(10), held])
        speed = np.zeros(command.size)
        for k in range(1, command.size):
            asked = command[k - 1] * (1.0 - bend * abs(command[k - 1]) / 100.0)
            speed[k] = 0.8 * speed[k - 1] + 0.2 * asked
        noise = rng.normal(size=speed.size) * np.hypot(0.02, 0.02 * speed)
        return Run(
            f"{name}.csv",
            name,
            split,
            0.02 * np.arange(speed.size),
            BenchCommand(command),
            {"speed_rpm": speed + noise},
        )

    splits: tuple[Split, ...] = ("fit", "fit", "fit", "validation", "test")
    return Dataset("logs", tuple(run(f"run_{i}", split) for i, split in enumerate(splits)), ())


@pytest.mark.parametrize(("bend", "least", "most"), [(0.0, 0.0, 0.05), (0.5, 0.2, 1.0)])
def test_noise_that_grows_decides_the_weights_only_where_the_law_comes_near_it(
    bend: float, least: float, most: float
) -> None:
    fit = fit_dataset(logs(bend), FitOptions(starts=1, effects="off"))
    run = fit.dataset.runs[0]
    fast = np.abs(run.channels["speed_rpm"]) > 40.0
    assert least <= np.median(run.weights["speed_rpm"][fast]) <= most
