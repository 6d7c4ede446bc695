"""Sensors that are late alone: the search says which of a robot's channels come later than the others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model, forms_of, paper_model
from mecanum_env.model.effect_names import form_of
from sysid.compare.predicted import SimulationSettings, predict
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import BodyCommand, Dataset, Run, Split
from sysid.logs.runs import UNITS

MODEL = paper_model()
TIME = np.arange(0.0, 2.0, 0.02)
LEVELS = np.array(
    [
        [(0, 0, 0), (60, 0, 0), (20, 90, 10), (70, 180, 0), (0, 0, 30)],
        [(0, 0, 0), (50, 45, 0), (0, 0, -30), (40, 0, 15), (60, 270, 0)],
        [(0, 0, 0), (40, 0, 30), (70, 90, 0), (30, 180, -20), (0, 0, 0)],
    ],
    float,
)
SPLITS: tuple[Split, ...] = ("fit", "validation", "test")
CHANNELS = tuple(name for name in UNITS if name not in ("speed_rpm", "battery_v"))
DELAY_S = 0.06


def logs(model: Model) -> Dataset:
    """Return robot runs of all channels, twice each, of what a model does on the planar plant, with noise."""
    rng = np.random.default_rng(0)
    runs = []
    for number, (levels, split) in enumerate(zip(LEVELS, SPLITS, strict=True)):
        rows = np.repeat(levels, TIME.size // len(levels), axis=0)
        empty = {name: np.zeros(TIME.size) for name in CHANNELS}
        run = Run("", f"run{number}", split, TIME, BodyCommand(*rows.T), empty)
        true = predict(model, run, settings=SimulationSettings(plant="planar"))
        for repeat in range(2):
            noise = {name: 0.5 if name.startswith("speed_") else 0.005 for name in true}
            noisy = {n: values + noise[n] * rng.standard_normal(TIME.size) for n, values in true.items()}
            runs.append(replace(run, file=f"run{number}_{repeat}.csv", channels=noisy))
    return Dataset("late sensors", tuple(runs), (), "made here")


@pytest.mark.parametrize("late", forms_of("sensor_latency"), ids=form_of)
def test_which_channels_are_late_is_told(late: str) -> None:
    dataset = logs(MODEL.with_effect(late, delay_s=DELAY_S))
    options = GapOptions(only=("sensor_latency",), max_effects=1, plant="planar", next_experiment=False)
    report = analyse(dataset, MODEL, options)
    assert report.verdict == "named"
    (found,) = report.effects
    assert found.name == late
    assert found.forms_tied == ()
    assert found.parameters["delay_s"].value == pytest.approx(DELAY_S, abs=0.005)


def test_robot_searches_try_every_group_of_channels() -> None:
    dataset = logs(MODEL.with_effect("sensor_latency/pose", delay_s=DELAY_S))
    options = GapOptions(only=("sensor_latency", "sensor_lowpass", "speed_gain"), plant="planar")
    report = analyse(dataset, MODEL, replace(options, max_effects=2, next_experiment=False))
    assert [found.name for found in report.effects] == ["sensor_latency/pose"]
