"""A set of effects that raises the plain rms error on validation runs is refused, whatever its gain."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import Fitted, ResidualProblem, base_fit
from sysid.compare.measured import observe
from sysid.compare.model_error import ModelError, Whitener
from sysid.compare.model_error.size import ChannelError, with_model_error
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import EffectSet, effect_set
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


def test_a_small_rise_counts_only_if_pieces_of_the_runs_agree_about_it(
    bench_logs: MakeLogs, base: Model
) -> None:
    """In one piece of 1 s a fit may do much worse by chance and yet be right in all the others."""
    logs = bench_logs(base)
    runs = tuple(replace(run, split="validation") for run in logs.runs)
    problem = problem_of(replace(logs, runs=runs), base)
    before = base_fit(problem, EMPTY)
    parts = problem.whitener.unwhiten(problem.marginal_inverse(before.residual))

    blocks = problem.observations.blocks
    validation = [problem.observations.situations[block.situation].split == "validation" for block in blocks]

    def raised(pieces: int) -> Fitted[EffectSet]:
        """Return a fit whose errors on the validation runs are 3 % larger, all within their first pieces."""
        raised_rows, left = [], pieces
        for block, held_out in zip(blocks, validation, strict=True):
            rows = (block.time_s < 1.0) & (held_out and left > 0)
            left -= held_out
            raised_rows.append(rows)
        both = list(zip(parts, raised_rows, validation, strict=True))
        whole = sum(float(part @ part) for part, _, held_out in both if held_out)
        mine = sum(float(part[rows] @ part[rows]) for part, rows, _ in both)
        factor = math.sqrt(1.0 + 0.06 * whole / mine)
        worse = [np.where(rows, factor * part, part) for part, rows, _ in both]
        return replace(before, residual=problem.marginal(problem.whitener.whiten(worse)))

    assert rises(problem, before, raised(5))
    assert not rises(problem, before, raised(1))


@pytest.mark.parametrize("same_commands", [False, True])
def test_beside_a_robots_fit_a_set_must_not_miss_it_by_more_unless_the_commands_are_those_of_the_fit(
    bench_logs: MakeLogs, base: Model, same_commands: bool
) -> None:
    """A slow error weighs little beside an own error that may last, and is no smaller for that."""
    observations = observe(bench_logs(base))
    noise = measure_noise(bench_logs(base), observations)
    lasting = ModelError({"speed_rpm": ChannelError(settled=3.0, transient=0.0, correlation_s=5.0)})
    problem = ResidualProblem(base, Whitener(observations, noise, lasting))
    problem.knows_all, problem.same_commands = True, same_commands
    before = base_fit(problem, EMPTY)
    parts = problem.whitener.unwhiten(problem.marginal_inverse(before.residual))
    slower = [0.9 * part + NOISE_RPM for part in parts]
    after = replace(before, residual=problem.marginal(problem.whitener.whiten(slower)))
    assert after.cost < before.cost
    assert rises(problem, before, after) is not same_commands
