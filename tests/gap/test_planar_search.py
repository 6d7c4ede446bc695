"""Searching robot logs on the planar plant: exact at the corrected place, near the rollers elsewhere."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import ResidualProblem, base_fit, fit, function_near, marginal_function
from sysid.compare.least_squares.fitted import slopes_beyond
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import predict
from sysid.compare.search_space import EffectSet, effect_set
from sysid.gap.search.chance import Floor, chance_gains, complete, expected
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.scores import scored
from sysid.gap.search.sets import EMPTY, Search
from sysid.gap.search.thresholds import SearchEffort
from sysid.gap.search.ties import tied
from sysid.logs import BodyCommand, Dataset, Run

TIME = np.arange(0.0, 2.0, 0.02)
LEVELS = (
    [(0, 0, 0), (60, 0, 0), (20, 90, 10), (70, 180, 0)],
    [(0, 0, 0), (50, 45, 0), (0, 0, 30), (40, 0, 15)],
)
TRUTH = {"speed_gain": {"gain": 0.93}}


def logs(model: Model) -> Dataset:
    """Return two robot runs, twice each, of what the model does, with noise."""
    rng = np.random.default_rng(0)
    runs = []
    for number, levels in enumerate(LEVELS):
        rows = np.repeat(np.array(levels, float), TIME.size // len(levels), axis=0)
        empty = {name: np.zeros(TIME.size) for name in ("vx_m_s", "vy_m_s", "yaw_rate_rad_s")}
        run = Run("", f"run{number}", "fit", TIME, BodyCommand(*rows.T), empty)
        true = predict(model, run)
        for repeat in range(2):
            noisy = {name: values + 0.01 * rng.standard_normal(TIME.size) for name, values in true.items()}
            runs.append(replace(run, file=f"run{number}_{repeat}.csv", channels=noisy))
    return Dataset("planar search", tuple(runs), (), "made here")


@pytest.fixture(scope="module")
def problem() -> ResidualProblem:
    """Return the paper's model against logs of a robot that is slower."""
    base = paper_model()
    dataset = logs(replace(base, effects=TRUTH))
    observations = observe(dataset)
    return ResidualProblem(base, Whitener(observations, measure_noise(dataset, observations), None))


def slower(problem: ResidualProblem) -> tuple[EffectSet, FloatArray]:
    """Return the set of the true effect, and where neutral is."""
    candidate = effect_set(problem.base, ["speed_gain"])
    return candidate, candidate.start()


def test_what_only_rollers_show_is_simulated_on_them(problem: ResidualProblem) -> None:
    refused = {name for name, effect in CATALOGUE.items() if "planar" in effect.refused_by}
    assert refused
    slow = refused | {"com_offset", "weak_servo", "speed_saturation/supply"}
    for name in CATALOGUE:
        assert problem.surrogate_covers([name, "speed_gain"]) == (name not in slow)


def test_a_corrected_simulation_is_exact_where_it_was_corrected(problem: ResidualProblem) -> None:
    candidate, place = slower(problem)
    residual = marginal_function(problem, candidate)(place)
    assert residual is not None
    beyond = slopes_beyond(problem, candidate, place, residual)
    near = function_near(problem, candidate, place, residual, beyond)(place)
    assert near == pytest.approx(residual, abs=1e-9)


def test_a_corrected_simulation_tells_what_an_effect_changes(problem: ResidualProblem) -> None:
    candidate, place = slower(problem)
    full = marginal_function(problem, candidate)
    before, after = full(place), full(place - 0.1)
    assert before is not None
    assert after is not None
    beyond = slopes_beyond(problem, candidate, place, before)
    told = function_near(problem, candidate, place, before, beyond)(place - 0.1)
    assert told is not None
    # How rollers slip and bounce is what is left.
    assert np.linalg.norm(told - after) < 0.35 * np.linalg.norm(after - before)


def test_a_fit_by_corrections_ends_where_the_rollers_fit(problem: ResidualProblem) -> None:
    candidate, place = slower(problem)
    found = fit(problem, candidate, place)
    assert found is not None
    full = marginal_function(problem, candidate)(found.place)
    assert full == pytest.approx(found.residual, abs=1e-9)
    assert candidate.coordinates[0].value(found.place[0]) == pytest.approx(0.93, abs=0.005)
    assert found.cost < 1.3 * problem.size


def test_a_fit_by_corrections_simulates_the_rollers_a_few_times_only(
    problem: ResidualProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    used: list[Model] = []
    simulate = problem.residual
    monkeypatch.setattr(problem, "residual", lambda model: used.append(model) or simulate(model))
    fit(problem, *slower(problem))
    assert 2 <= len(used) <= 6


def test_rollers_that_meet_the_floor_otherwise_are_expected_to_differ(problem: ResidualProblem) -> None:
    candidate, place = slower(problem)
    best = fit(problem, candidate, place)
    assert best is not None
    # A right model leaves more than the noise, and no more than noise and roughness together.
    right = expected(problem, best)
    assert problem.size < right < 2.0 * problem.size
    assert complete(problem, best, Floor(math.inf, trusted=True))


def test_what_rollers_do_by_chance_raises_what_chance_gains(
    problem: ResidualProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = responses(problem, ["wheel_gain_mismatch", "mount_yaw"])
    base = base_fit(problem, EMPTY)
    rough = chance_gains(problem, base, library, np.random.default_rng(0))
    monkeypatch.setattr(problem, "roller_scatter", lambda _model: np.zeros((problem.size, 0)))
    smooth = chance_gains(problem, base, library, np.random.default_rng(0))
    assert rough.threshold() > smooth.threshold()


def test_twins_stay_tied_though_rollers_are_rough() -> None:
    base = paper_model()
    dataset = logs(base.with_effect("sensor_latency", delay_s=5 / 120))
    observations = observe(dataset)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(dataset, observations), None))
    twins = ("command_latency", "sensor_latency")
    search = Search(problem, Library(responses(problem, [*twins, "mount_yaw"])), SearchEffort(3, 1, 1, 1, 1))
    search.grow(1)
    judged = [scored(problem, fitted) for fitted in search.of_size(1)]
    best = min(judged, key=lambda j: j.score)
    assert {j.names for j in tied(search, Floor(1e3, True), best, judged, 1.0)} == {(name,) for name in twins}
