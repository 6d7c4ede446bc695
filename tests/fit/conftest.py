"""Bench and robot logs with a known truth."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.kinematics import TWIST
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import RobotPlant, drive
from mecanum_env.wheel_drive.drive import DriveParameters
from mecanum_env.wheel_drive.inputs import latched_commands
from sysid.compare.predicted.robot import commands_of
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run

LAW = paper_model().wheel.law
STEPS = (40.0, -80.0, 130.0, 20.0, -60.0)
SPLITS = ("fit", "fit", "fit", "validation", "test")


def bench_run(
    name: str,
    levels: np.ndarray,
    *,
    rng: np.random.Generator,
    law: WheelLaw = LAW,
    noise_rpm: float = 0.3,
    hold_s: float = 0.4,
    rate_hz: float = 120.0,
    delay_s: float = 0.0,
    ceiling_rpm: float = 135.0,
    offset_s: float = 0.0,
    split: str = "fit",
) -> Run:
    """Return a run of levels held in turn, the law's own ticks interpolated at the samples."""
    seconds = hold_s * len(levels)
    time = np.arange(0.0, seconds - 1e-9, 1.0 / rate_hz)
    index = np.minimum(((time - offset_s) / hold_s + 1e-9).astype(int), len(levels) - 1)
    command = np.where(time < offset_s - 1e-9, 0.0, np.asarray(levels, float)[index])
    ticks = int(np.ceil(seconds / law.sample_period_s))
    period = 0.1 if offset_s == 0.0 else law.sample_period_s
    path = DriveParameters(law, period, 0.0, ceiling_rpm, delay_s)
    r = latched_commands(path, time, command, ticks)
    speed = np.interp(time / law.sample_period_s, np.arange(ticks + 1), law.simulate(r))
    speed = speed + noise_rpm * rng.standard_normal(speed.size)
    return Run(name, name.split(".")[0], split, time, BenchCommand(command), {"speed_rpm": speed})


@pytest.fixture(scope="session")
def bench() -> Callable[..., Dataset]:
    """Make a bench dataset of five runs of random whole levels; keywords go to `bench_run`."""

    def make(largest_rpm: float = 130.0, seed: int = 0, **more: object) -> Dataset:
        rng = np.random.default_rng(seed)
        runs = []
        for i, split in enumerate(SPLITS):
            levels = np.concatenate([[0.0], np.rint(rng.uniform(-largest_rpm, largest_rpm, 7))])
            runs.append(bench_run(f"run_{i}.csv", levels, rng=rng, split=split, **more))
        return Dataset("synthetic bench", tuple(runs), ())

    return make


@pytest.fixture(scope="session")
def robot_logs() -> Callable[..., Dataset]:
    """Drive a model through random body commands and log wheel speeds, body velocities on request."""

    def make(
        model: Model,
        *,
        runs: int = 5,
        seconds: float = 3.0,
        noise_rpm: float = 0.3,
        body: bool = False,
        plant: RobotPlant = "planar",
    ) -> Dataset:
        rng = np.random.default_rng(0)
        made = []
        for i in range(runs):
            time = np.arange(0.0, seconds + 1e-9, 0.02)
            levels = np.stack(
                [rng.uniform(-60, 60, 8), rng.choice([0.0, 45.0, 90.0], 8), rng.uniform(-50, 50, 8)], axis=1
            )
            levels[0] = 0.0
            rows = np.rint(levels)[np.minimum((time / 0.4 + 1e-9).astype(int), 7)]
            run = Run(f"run_{i}.csv", f"run_{i}", SPLITS[i % 5], time, BodyCommand(*rows.T), {})
            true = drive(
                model, commands_of(run, model.wheel.command_period_s), seconds, plant=plant
            ).channels_at(time)
            channels = {
                name: values + noise_rpm * rng.standard_normal(values.size)
                for name, values in true.items()
                if name.startswith("speed_")
            }
            if body:
                channels |= {name: true[name] + 0.003 * rng.standard_normal(time.size) for name in TWIST}
            made.append(replace(run, channels=channels))
        return Dataset("synthetic robot", tuple(made), ())

    return make


@pytest.fixture
def examples() -> Path:
    """Return the bundled example logs."""
    return Path(__file__).parents[2] / "examples" / "logs"
