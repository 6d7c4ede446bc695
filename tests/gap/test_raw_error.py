"""A set of effects that raises the plain rms error on validation runs is refused, whatever its gain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.coordinates import EffectSet, effect_set
from sysid.compare.fitted import Fitted, base_fit
from sysid.compare.model_error import ChannelError, ModelError, with_model_error
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.problem import ResidualProblem
from sysid.compare.whitening import Whitener
from sysid.gap.result import GapOptions
from sysid.gap.search.scores import fitted_rms, rises
from sysid.gap.search.sets import EMPTY
from sysid.gap.workflow import analyse
from sysid.logs import Dataset

from .conftest import NOISE_RPM, MakeLogs


def problem_of(logs: Dataset, model: Model) -> ResidualProblem:
    runs = tuple(run for run in logs.runs if run.split != "test")
    observations = observe(replace(logs, runs=runs))
    return ResidualProblem(model, Whitener(observations, measure_noise(logs, observations), None))


def test_the_plain_error_of_a_right_model_is_the_noise(bench_logs: MakeLogs, base: Model) -> None:
    problem = problem_of(bench_logs(base), base)
    right = base_fit(problem, EMPTY)
    assert fitted_rms(problem, right, "validation") == pytest.approx(NOISE_RPM, rel=0.1)
    assert math.isnan(fitted_rms(problem, right, "test"))
    assert not rises(problem, right, right)


def test_a_wrong_gain_raises_it_and_a_right_one_does_not(bench_logs: MakeLogs, base: Model) -> None:
    problem = problem_of(bench_logs(base.with_effect("speed_gain", gain=0.9)), base)
    before = base_fit(problem, EMPTY)
    chosen = effect_set(base, ["speed_gain"])
    one = chosen.coordinates[0]

    def at(gain: float) -> Fitted[EffectSet]:
        place = np.array([one.unit(gain)])
        residual = problem.residual(chosen.model(base, place))
        assert residual is not None
        return Fitted(chosen, place, problem.marginal(residual), np.zeros((problem.size, 1)))

    assert rises(problem, before, at(1.1))
    assert not rises(problem, before, at(0.9))
    assert fitted_rms(problem, at(0.9), "validation") == pytest.approx(NOISE_RPM, rel=0.1)


def test_what_helps_the_fit_runs_and_harms_the_validation_runs_is_not_named(
    bench_logs: MakeLogs, base: Model
) -> None:
    weak, sound = bench_logs(base.with_effect("speed_gain", gain=0.95)), bench_logs(base)
    runs = tuple(s if s.split == "validation" else w for w, s in zip(weak.runs, sound.runs, strict=True))
    logs = Dataset("two wheels", runs, (), "these logs")
    # Fitted to these very logs: what a right model leaves is not known, so no set is inadequate for that.
    fitted = with_model_error(base, ModelError({"speed_rpm": ChannelError(0.1, 0.01, 0.05)}, "these logs"))
    report = analyse(logs, fitted, GapOptions(only=("speed_gain",), next_experiment=False))
    assert report.effects == ()
    assert report.verdict == "unexplained"
    assert any("raises the plain difference on the validation runs" in note for note in report.notes)
