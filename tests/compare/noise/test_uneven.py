"""Noise that is larger after a change of command is told from noise that is the same all the time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.measured import Observations, observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import Noise, measure_noise
from sysid.logs import Dataset
from tests.gap.conftest import NOISE_RPM, MakeLogs


def measured(logs: Dataset) -> tuple[Observations, Noise]:
    observations = observe(logs)
    return observations, measure_noise(logs, observations)


def shifted(logs: Dataset, most_s: float) -> Dataset:
    """Return logs in each of which the whole response is later by up to a time."""
    rng = np.random.default_rng(3)
    runs = []
    for run in logs.runs:
        speed = run.channels["speed_rpm"]
        later = np.interp(run.time_s - rng.uniform(0.0, most_s), run.time_s, speed)
        runs.append(replace(run, channels={"speed_rpm": later}))
    return replace(logs, runs=tuple(runs))


@pytest.fixture(scope="module")
def late(bench_logs: MakeLogs, base: Model) -> Dataset:
    return shifted(bench_logs(base), 0.1)


def test_noise_that_is_even_is_not_called_uneven(bench_logs: MakeLogs, base: Model) -> None:
    _, noise = measured(bench_logs(base))
    assert noise.uneven == {}
    assert noise.settled("speed_rpm") == noise.sigma["speed_rpm"]


def test_repeats_that_begin_at_different_times_differ_after_changes_of_command(late: Dataset) -> None:
    _, noise = measured(late)
    assert noise.sigma["speed_rpm"] > 3.0 * NOISE_RPM
    assert noise.settled("speed_rpm") < 0.5 * noise.sigma["speed_rpm"]
    assert noise.uneven["speed_rpm"].transient > 0.0


def test_the_mean_variance_is_that_of_all_samples(late: Dataset) -> None:
    observations, noise = measured(late)
    parts = [
        noise.variance(block, observations.situations[block.situation].runs[0]) * block.repeats
        for block in observations.blocks
    ]
    mean = float(np.mean(np.concatenate(parts)))
    assert mean == pytest.approx(noise.sigma["speed_rpm"] ** 2, rel=0.3)


def test_the_whitener_has_the_variance_of_each_value(late: Dataset) -> None:
    observations, noise = measured(late)
    whitener = Whitener(observations, noise, None)
    block, rows = observations.blocks[0], whitener.slices[0]
    root = np.stack([whitener.unwhiten(unit)[0] for unit in np.eye(whitener.size)[rows]])
    variance = noise.variance(block, observations.situations[block.situation].runs[0])
    assert np.sum(root**2, axis=0) == pytest.approx(variance, rel=1e-2)


def test_a_noise_from_repeats_takes_the_place_of_one_from_motion(late: Dataset) -> None:
    alone = replace(late, runs=tuple(run for run in late.runs if run.file.endswith("_0.csv")))
    (_, of_motion), (_, of_repeats) = measured(alone), measured(late)
    assert of_motion.source == {"speed_rpm": "motion"}
    assert of_motion.beside(of_repeats).sigma == of_repeats.sigma
    assert of_motion.beside(of_repeats).uneven == of_repeats.uneven


def test_noise_is_like_that_of_other_logs_up_to_a_factor(
    bench_logs: MakeLogs, base: Model, late: Dataset
) -> None:
    quiet, loud = measured(bench_logs(base, seed=5))[1], measured(late)[1]
    assert quiet.is_like(loud, 1.0)
    assert not loud.is_like(quiet, 2.0)
