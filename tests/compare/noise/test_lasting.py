"""Noise that lasts as long as a command is held, and runs that begin with a change from rest."""

from __future__ import annotations

import numpy as np
import pytest

from sysid.compare.measured import changes_from_rest, observe
from sysid.compare.noise import measure_noise, with_lasting
from sysid.logs import BenchCommand, Dataset, Run

LEVELS = np.array([20.0, -40.0, 60.0, -20.0, 40.0, -60.0, 30.0, -30.0] * 3)
HOLD_S = 2.0


def recording(offsets: np.ndarray) -> Dataset:
    """Return one run that holds the levels in turn, each off by its own of the `offsets` [rpm]."""
    time = np.arange(0.0, HOLD_S * LEVELS.size, 0.02)
    hold = np.minimum((time / HOLD_S).astype(int), LEVELS.size - 1)
    speed = LEVELS[hold] + offsets[hold] + np.random.default_rng(1).normal(0.0, 1.0, time.size)
    run = Run("run.csv", "run", "fit", time, BenchCommand(LEVELS[hold]), {"speed_rpm": speed})
    return Dataset("logs", (run,), ())


def lasting_rpm(data: Dataset) -> float:
    observations = observe(data)
    command = np.repeat(LEVELS, round(HOLD_S / 0.02))
    parts = [block.value - command[block.rows].mean(axis=1) for block in observations.blocks]
    noise = measure_noise(data, observations)
    return with_lasting(noise, observations, parts, parts).lasting.get("speed_rpm", 0.0)


def test_an_offset_of_each_hold_is_found_with_its_size() -> None:
    offsets = np.random.default_rng(2).normal(0.0, 2.0, LEVELS.size)
    assert lasting_rpm(recording(offsets)) == pytest.approx(2.0, rel=0.4)


def test_white_noise_does_not_last() -> None:
    assert lasting_rpm(recording(np.zeros(LEVELS.size))) == 0.0


def test_a_smooth_function_of_the_command_is_no_noise() -> None:
    assert lasting_rpm(recording(-2.0 * np.sign(LEVELS) - 0.05 * LEVELS)) == 0.0


def test_a_run_that_starts_at_rest_with_a_command_begins_with_a_change() -> None:
    time = 0.02 * np.arange(100)
    speed = np.where(time < 0.1, 0.0, 50.0)
    run = Run("run.csv", "run", "fit", time, BenchCommand(np.full(100, 50.0)), {"speed_rpm": speed})
    times, levels = changes_from_rest(run)
    assert times.tolist() == [0.0, 0.0]
    assert levels[:, 0].tolist() == [0.0, 50.0]
