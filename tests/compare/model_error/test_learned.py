"""A drive's own error in other commands: as large as it may be, but no larger than what effects leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.measured import Observations, observe
from sysid.compare.model_error import Learned, learn
from sysid.compare.noise import Noise, measure_noise
from sysid.compare.predicted import SimulationSettings, Simulators
from sysid.gap.inquiry import Inquiry, inquire
from sysid.gap.result import GapOptions
from sysid.gap.search.known_effects import known_effects
from sysid.logs import Dataset
from sysid.progress import silent
from tests.gap.conftest import MakeLogs

FACTORS = (0.0, 0.5, 1.0, 2.0, 4.0, 8.0, 30.0)


@pytest.fixture(scope="module")
def rubbing(base: Model) -> Model:
    """Return a wheel that loses 1.5 rpm to friction, which `base` does not know."""
    return replace(base, robot=replace(base.robot, servo_n_m_s_rad=2.0)).with_effect(
        "coulomb_friction", torque_n_m=0.3
    )


@pytest.fixture(scope="module")
def learned(base: Model, rubbing: Model, bench_logs: MakeLogs) -> Learned:
    """Return what the logs of the rubbing wheel say of a model without friction."""
    return learn(replace(base, robot=rubbing.robot), bench_logs(rubbing, seed=1))


def other_logs(rubbing: Model, bench_logs: MakeLogs) -> tuple[Observations, Noise, Simulators]:
    """Return what other commands show of the wheel."""
    logs = bench_logs(rubbing, seed=2)
    observations = observe(logs)
    return observations, measure_noise(logs, observations), Simulators.of(observations, SimulationSettings())


def test_the_error_grows_with_what_is_left_up_to_that_of_other_commands(
    learned: Learned, rubbing: Model, bench_logs: MakeLogs
) -> None:
    observations, noise, simulators = other_logs(rubbing, bench_logs)
    rng = np.random.default_rng(3)
    scatter = [rng.standard_normal(block.value.size) for block in observations.blocks]
    settled = []
    for factor in FACTORS:
        sizes = [factor * noise.sigma[block.channel] for block in observations.blocks]
        left = [size * part for size, part in zip(sizes, scatter, strict=True)]
        settled.append(learned.error_of(observations, noise, left, simulators).channels["speed_rpm"].settled)
    assert settled == sorted(settled)
    assert settled[0] == learned.error.channels["speed_rpm"].settled
    assert settled[-1] == learned.error_in(observations).channels["speed_rpm"].settled
    assert settled[-1] > settled[0]


def studied(logs: Dataset, model: Model, of_fit: Dataset) -> Inquiry:
    """Return the search of a study of some logs beside those of the fit."""
    options = GapOptions(next_experiment=False, fitted_on=of_fit)
    return inquire(logs, model, options, known_effects(logs.level, options.plant, logs.columns), 0.01, silent)


def test_where_a_gap_is_plain_the_error_is_no_larger_than_what_the_effects_leave(
    base: Model, rubbing: Model, bench_logs: MakeLogs
) -> None:
    model, of_fit = replace(base, robot=rubbing.robot), bench_logs(rubbing, seed=1)
    slower = rubbing.with_effect("speed_gain", gain=0.9)
    for true, is_plain in ((rubbing, False), (slower, True)):
        found = studied(bench_logs(true, seed=2), model, of_fit)
        assert found.decision.facts.is_plain is is_plain
        assert found.data.learned is not None
        assert found.data.error is not None
        most = found.data.learned.error_in(found.data.observations)
        used, largest = (error.channels["speed_rpm"].settled for error in (found.data.error, most))
        assert (used < largest) is is_plain
