"""A free term, as the rival of named sets, describes what is smooth and nothing else."""

from __future__ import annotations

from mecanum_env.model import CustomEffect, Model
from sysid.compare.least_squares import ResidualProblem, base_fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import EffectSet
from sysid.gap.search.free_term import free_term
from sysid.gap.search.scores import scored
from sysid.logs import Dataset
from tests.gap.conftest import MakeLogs


def gain(base: Model, logs: Dataset) -> float:
    """Return by how much the free term predicts groups of runs better than the model as it is."""
    observations = observe(logs)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(logs, observations), None))
    nothing = base_fit(problem, EffectSet((), ()))
    rival = free_term(problem, nothing.residual, 1.0)
    assert rival is not None
    return scored(problem, nothing, 1.0).score - rival.score


def test_a_smooth_difference_is_predicted_in_runs_that_are_left_out(
    bench_logs: MakeLogs, base: Model
) -> None:
    bent = base.with_custom(CustomEffect("sensor", "-0.0008 * speed * abs(speed)"))
    assert gain(base, bench_logs(bent)) > 100.0


def test_noise_is_not_predicted(bench_logs: MakeLogs, base: Model) -> None:
    assert gain(base, bench_logs(base)) < 0.0
