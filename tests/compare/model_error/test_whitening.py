"""The residual of a right model is white; what its own error or correlated noise explains is no gap."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import ModelError, Whitener
from sysid.compare.model_error.size import ChannelError
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import RefittedLaw
from sysid.logs import Dataset
from tests.gap.conftest import MakeLogs

ERROR = ModelError({"speed_rpm": ChannelError(settled=0.3, transient=0.02, correlation_s=0.05)})


def _problem(dataset: Dataset, base: Model, error: ModelError | None = None) -> ResidualProblem:
    observations = observe(dataset)
    return ResidualProblem(base, Whitener(observations, measure_noise(dataset, observations), error))


def test_the_residual_of_the_truth_is_white_with_unit_variance(bench_logs: MakeLogs, base: Model) -> None:
    problem = _problem(bench_logs(base), base)
    residual = problem.base_residual
    assert float(np.mean(residual**2)) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / residual.size))
    lag = float(residual[1:] @ residual[:-1]) / float(residual @ residual)
    assert abs(lag) < 4.0 / np.sqrt(residual.size)


def test_repeats_are_averaged_and_simulated_once(bench_logs: MakeLogs, base: Model) -> None:
    observations = observe(bench_logs(base, repeats=3))
    assert len(observations.situations) == 5
    assert np.all(observations.blocks[0].weight == 3.0)


def test_whitening_has_an_inverse(bench_logs: MakeLogs, base: Model) -> None:
    problem = _problem(bench_logs(base), base, ERROR)
    parts = [np.random.default_rng(0).standard_normal(b.value.size) for b in problem.observations.blocks]
    again = problem.whitener.unwhiten(problem.whitener.whiten(parts))
    assert np.concatenate(again) == pytest.approx(np.concatenate(parts), abs=1e-9)


def test_marginalising_has_an_inverse(bench_logs: MakeLogs, base: Model) -> None:
    problem = _problem(bench_logs(base), base, ERROR)
    assert problem.nuisance.shape[1] > 0
    again = problem.marginal_inverse(problem.marginal(problem.base_residual))
    assert again == pytest.approx(problem.base_residual, abs=1e-9)


def test_marginalising_is_the_covariance_with_the_nuisance(bench_logs: MakeLogs, base: Model) -> None:
    problem = _problem(bench_logs(base), base, ERROR)
    r, x = problem.base_residual, problem.nuisance
    exact = float(r @ r - (x.T @ r) @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, x.T @ r))
    assert float(np.sum(problem.marginal(r) ** 2)) == pytest.approx(exact, rel=1e-9)


def test_a_stated_model_error_makes_a_small_difference_likely(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base.with_effect("sensor_latency", delay_s=0.001))
    plain, stated = _problem(dataset, base), _problem(dataset, base, ERROR)
    assert float(np.mean(plain.marginal(plain.base_residual) ** 2)) > 1.15
    assert float(np.mean(stated.marginal(stated.base_residual) ** 2)) < 1.1


def test_repeats_that_differ_for_a_while_are_correlated_noise(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base)
    rng = np.random.default_rng(1)
    for run in dataset.runs:
        drift = np.repeat(rng.standard_normal(run.time_s.size // 20 + 1), 20)[: run.time_s.size]
        run.channels["speed_rpm"][:] += 2.0 * drift
    noise = measure_noise(dataset, observe(dataset))
    assert noise.correlated["speed_rpm"].share > 0.7
    assert 0.05 < noise.correlated["speed_rpm"].time_s < 0.25
    problem = _problem(dataset, base)
    assert float(np.mean(problem.base_residual**2)) < 1.5


def test_white_noise_is_not_taken_for_correlated(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base)
    assert measure_noise(dataset, observe(dataset)).correlated == {}


def test_the_law_and_a_robot_parameter_start_at_the_base_model(base: Model) -> None:
    candidate = RefittedLaw(base, ("servo_n_m_s_rad",))
    place = candidate.start()
    assert place.size == candidate.parameter_count == 6
    assert candidate.model(base, place) == base
    stiffer = candidate.model(base, np.append(place[:-1], 1.0))
    assert stiffer.robot.servo_n_m_s_rad == pytest.approx(3.0 * base.robot.servo_n_m_s_rad)
