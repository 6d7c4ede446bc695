"""Poses that start anywhere: their noise is found, and their motion is simulated once."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray
from sysid.compare.measured import EDGE_S, observe
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import SimulationSettings, Simulator
from sysid.compare.predicted.robot import CompiledRobot
from sysid.logs import BodyCommand, Dataset, Run

MODEL = paper_model()
SIGMA = {"x_m": 0.003, "y_m": 0.003, "yaw_rad": 0.005}
STEP_S = 0.02


def logs(yaws_rad: tuple[float, ...], seed: int = 0, late_s: float = 0.0) -> Dataset:
    """Return repeats of one curve with a noisy pose that start in several directions, a little late."""
    rng = np.random.default_rng(seed)
    runs = []
    for number, yaw in enumerate(yaws_rad):
        clock = np.arange(0.0, 4.0, STEP_S)
        time = clock + np.append(0.0, rng.uniform(0.0, late_s, clock.size - 1)) if late_s else clock
        moving = np.clip(time - 0.3, 0.0, None)
        heading = 0.5 * moving
        x, y = np.sin(heading), 1.0 - np.cos(heading)
        pose = {
            "x_m": math.cos(yaw) * x - math.sin(yaw) * y + number,
            "y_m": math.sin(yaw) * x + math.cos(yaw) * y - number,
            "yaw_rad": heading + yaw,
        }
        noisy = {name: values + SIGMA[name] * rng.standard_normal(time.size) for name, values in pose.items()}
        command = BodyCommand(*(np.where(clock < 0.3, 0.0, value) for value in (60.0, 0.0, 10.0)))
        runs.append(Run(f"{number}.csv", "curve", "fit", time, command, noisy))
    return Dataset("poses", tuple(runs), ())


def noise_of(dataset: Dataset) -> Noise:
    return measure_noise(dataset, observe(dataset))


def of_displacements(sigma: float) -> float:
    """Return the noise of the difference of two means, from that of a sample."""
    return sigma * math.sqrt(2.0 / (2.0 * EDGE_S / STEP_S))


def near(noise: Noise) -> dict[str, float]:
    return {name: noise.sigma[name] / of_displacements(sigma) for name, sigma in SIGMA.items()}


@pytest.mark.parametrize("late_s", [0.0, 2e-5])
def test_repeats_of_a_pose_may_start_anywhere(late_s: float) -> None:
    noise = noise_of(logs((0.0, 1.0, -2.0, 3.0), late_s=late_s))
    assert noise.from_repeats
    assert near(noise) == pytest.approx(dict.fromkeys(SIGMA, 1.0), rel=0.4)


def test_without_repeats_the_samples_of_a_pose_tell_its_noise_and_not_its_motion() -> None:
    noise = noise_of(logs((0.5,)))
    assert set(noise.source.values()) == {"scatter"}
    assert near(noise) == pytest.approx(dict.fromkeys(SIGMA, 1.0), rel=0.4)


def counted(monkeypatch: pytest.MonkeyPatch, model: Model) -> int:
    """Return how many motions are simulated for two runs that start in different directions."""
    used: list[FloatArray | None] = []
    motion = CompiledRobot.motion
    monkeypatch.setattr(CompiledRobot, "motion", lambda *given: used.append(None) or motion(*given))
    dataset = logs((0.0, 1.0))
    short = tuple(
        replace(
            run,
            time_s=run.time_s[:50],
            command=BodyCommand(*(values[:50] for values in run.command.columns().values())),
            channels={name: values[:50] for name, values in run.channels.items()},
        )
        for run in dataset.runs
    )
    Simulator(observe(replace(dataset, runs=short)), SimulationSettings(plant="planar")).predictions(model)
    return len(used)


def test_where_a_run_starts_matters_on_a_slope_only(monkeypatch: pytest.MonkeyPatch) -> None:
    assert counted(monkeypatch, MODEL) == 1
    assert counted(monkeypatch, MODEL.with_effect("floor_slope", slope_deg=2.0)) == 2
