"""The verdict on small bench logs whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from math import inf
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import sysid.gap
from mecanum_env.model import Model
from sysid.compare.least_squares import Fitted, ResidualProblem, base_fit, fit
from sysid.compare.measured import observe
from sysid.compare.model_error import ModelError, Whitener
from sysid.compare.model_error.size import ChannelError
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import EffectSet, effect_set
from sysid.gap.report.output import gap_json
from sysid.gap.result import FoundEffect, GapOptions, GapReport, Interval
from sysid.gap.search import decision
from sysid.gap.search.chance import Floor
from sysid.gap.search.decision import explore
from sysid.gap.search.detectable import untestable
from sysid.gap.search.further import residue
from sysid.gap.search.plain_squares import mean_squares, plainly_larger, removed, removed_of_all
from sysid.gap.search.responses import Growth, Library, growths, responses
from sysid.gap.search.sets import EMPTY, Search
from sysid.gap.search.thresholds import THRESHOLDS, SearchEffort
from sysid.gap.workflow import analyse
from sysid.logs import Dataset
from tests.gap.conftest import MakeLogs

QUIET = GapOptions(next_experiment=False)


def problem_of(model: Model, dataset: Dataset) -> ResidualProblem:
    """Return logs beside a model that is not said to err by itself."""
    observations = observe(dataset)
    return ResidualProblem(model, Whitener(observations, measure_noise(dataset, observations), None))


def test_logs_of_the_model_itself_have_no_gap(bench_logs: MakeLogs, base: Model) -> None:
    report = analyse(bench_logs(base, seed=1), base, QUIET)
    assert report.verdict == "no_gap"
    assert report.effects == ()
    # Only what the study spent is added to it.
    assert replace(report.model, provenance=base.provenance) == base
    assert set(report.model.provenance) - set(base.provenance) == {"studies"}


@pytest.fixture(scope="module")
def limited(bench_logs: MakeLogs, base: Model) -> tuple[Dataset, GapReport]:
    """Return logs of a wheel with a lower limit of its speed, and their study."""
    dataset = bench_logs(base.with_effect("speed_saturation", limit_rpm=80.0))
    return dataset, analyse(dataset, base, QUIET)


def test_a_hidden_effect_is_named_with_its_size(limited: tuple[Dataset, GapReport]) -> None:
    _, report = limited
    assert report.verdict == "named"
    (effect,) = report.effects
    assert effect.name == "speed_saturation"
    limit = effect.parameters["limit_rpm"]
    assert limit.value == pytest.approx(80.0, abs=0.5)
    assert limit.low < limit.value < limit.high
    assert effect.selection_frequency > 0.9


def test_the_improved_model_has_no_gap_left(limited: tuple[Dataset, GapReport]) -> None:
    dataset, first = limited
    assert first.gap.after == pytest.approx(first.gap.noise_floor, rel=0.1)
    assert first.model.effects["speed_saturation"]["limit_rpm"] == pytest.approx(80.0, abs=0.5)
    assert analyse(dataset, first.model, QUIET).verdict == "no_gap"


def test_a_pair_is_named(bench_logs: MakeLogs, base: Model) -> None:
    hidden = base.with_effect("acceleration_limit", limit_rpm_s=600.0).with_effect(
        "direction_asymmetry", reverse_ratio=0.93
    )
    report = analyse(bench_logs(hidden), base, QUIET)
    assert report.verdict == "named"
    assert {effect.name for effect in report.effects} == {"acceleration_limit", "direction_asymmetry"}


def test_twins_are_both_candidates(bench_logs: MakeLogs, base: Model) -> None:
    report = analyse(bench_logs(base.with_effect("speed_gain", gain=0.94)), base, QUIET)
    assert report.verdict == "ambiguous"
    assert {("speed_gain",), ("sensor_scale",)} <= set(report.candidates)
    assert (report.effects[0].name,) == report.candidates[0]


def test_of_sets_that_do_as_well_one_about_whose_size_the_runs_agree_comes_first(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.94))
    first = analyse(dataset, base, QUIET).candidates[0]

    def doubtful(_problem: ResidualProblem, fitted: Fitted[EffectSet], _inflation: float) -> tuple[str, ...]:
        return fitted.names if fitted.names == first else ()

    monkeypatch.setattr(decision, "doubtful", doubtful)
    report = analyse(dataset, base, QUIET)
    assert report.verdict == "ambiguous"
    assert first in report.candidates[1:]


def test_a_set_stays_where_none_of_those_in_its_place_is_needed(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A curve that stands for whatever has no name gives way to causes, if these are needed."""
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.94))
    first, *others = analyse(dataset, base, QUIET).candidates
    assert others
    monkeypatch.setattr(decision, "with_causes", lambda _search, _floor, as_good, *_: as_good[1:])
    monkeypatch.setattr(decision, "needed", lambda *_: False)
    assert analyse(dataset, base, QUIET).candidates == (first,)


def test_a_swing_that_no_effect_makes_is_unexplained(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base)
    for run in dataset.runs:
        run.channels["speed_rpm"][:] += 3.0 * np.sin(2.0 * np.pi * 1.7 * run.time_s)
    report = analyse(dataset, base, QUIET)
    assert report.verdict == "unexplained"
    assert report.effects == ()
    assert report.where


def test_only_and_exclude_limit_the_search(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.94))
    report = analyse(dataset, base, GapOptions(only=("sensor_scale",), next_experiment=False))
    assert report.candidates == (("sensor_scale",),)
    excluded = GapOptions(exclude=("sensor_scale", "viscous_friction"), next_experiment=False)
    assert report.candidates != analyse(dataset, base, excluded).candidates


def test_jobs_do_not_change_the_report(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base.with_effect("backlash", gap_deg=2.0))
    one, two = (
        gap_json(analyse(dataset, base, GapOptions(jobs=jobs, next_experiment=False))) for jobs in (1, 2)
    )
    assert one == two


def test_an_effect_that_no_command_excites_is_untestable(bench_logs: MakeLogs, base: Model) -> None:
    report = analyse(bench_logs(base), base, QUIET)
    unseen = {untestable.name for untestable in report.untestable}
    assert "payload" in unseen  # a bench has no body
    assert "speed_gain" not in unseen
    assert report.smallest_detectable["speed_gain"]["gain"] == pytest.approx(1.0, abs=0.01)


def test_an_effect_that_cannot_be_simulated_is_not_said_to_change_nothing() -> None:
    reasons = {one.name: one.reason for one in untestable(["track_width"], [], {}, "robot", ())}
    assert "could be simulated" in reasons["track_width"]


def test_analyse_takes_the_runs_alone(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base, seed=1)
    report = sysid.gap.analyse(dataset.runs, base, QUIET)
    assert report.verdict == analyse(dataset, base, QUIET).verdict == "no_gap"


def test_a_gap_that_effects_cannot_reduce_is_unexplained(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base)
    for run in dataset.runs:
        # Faster than any wheel could follow.
        run.channels["speed_rpm"][:] += 3.0 * (-1.0) ** (np.arange(run.time_s.size) // 2)
    options = replace(QUIET, only=("battery_sag",))
    assert analyse(dataset, base, options).verdict == "unexplained"


def test_noise_without_repeats_is_known_less_well(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base, repeats=1)
    noise = measure_noise(dataset, observe(dataset))
    samples = sum(run.time_s.size for run in dataset.runs)
    assert 10.0 < noise.degrees_of_freedom < 0.2 * samples


def test_an_interval_without_end_stays_out_of_the_model() -> None:
    found = FoundEffect(
        "body_speed_limit", {"v_rpm": Interval(40, 39, 41), "vc_rpm": Interval(90, 80, inf)}, 1
    )
    assert found.intervals == {"v_rpm": {"value": 40, "low": 39, "high": 41}}


@pytest.mark.parametrize(
    ("first", "both", "may_be_residue"),
    [
        (6.0, 1.8, False),  # The second effect removes 84 % of what the first leaves.
        (6.0, 3.0, True),
        (1.4, 1.05, True),  # What the first leaves is not plainly visible.
    ],
)
def test_a_second_effect_that_removes_nearly_all_that_the_first_leaves_is_no_residue_of_its_formula(
    bench_logs: MakeLogs, base: Model, first: float, both: float, may_be_residue: bool
) -> None:
    dataset = bench_logs(base)
    problem = problem_of(base, dataset)

    def fitted(ratio: float) -> Fitted[EffectSet]:
        return replace(base_fit(problem, EMPTY), residual=np.full(problem.size, np.sqrt(ratio)))

    ours = residue(problem, Floor(1e6, trusted=True), fitted(100.0), fitted(first), fitted(both))
    assert (ours > 0.0) is may_be_residue


def test_a_twin_that_the_screen_cannot_tell_from_the_chosen_effect_is_fitted(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = bench_logs(base.with_effect("command_latency", delay_s=0.05))
    problem = problem_of(base, dataset)
    search = Search(
        problem, Library(responses(problem, ("command_latency", "sensor_latency"))), SearchEffort()
    )
    screened = search.growths
    search.fit_best([g for g in screened(search.base) if g.candidate.names == ("command_latency",)], 1)
    chosen = search.fitted[("command_latency",)]

    def inaccurate(parent: Fitted[EffectSet]) -> list[Growth]:
        return [replace(growth, expected=0.9 * parent.cost) for growth in screened(parent)]

    monkeypatch.setattr(search, "growths", inaccurate)
    search.swap(chosen)
    assert ("sensor_latency",) in search.fitted


def test_a_set_whose_fit_ended_elsewhere_is_fitted_again_where_more_is_promised(
    bench_logs: MakeLogs, base: Model
) -> None:
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.9))
    problem = problem_of(base, dataset)
    search = Search(problem, Library(responses(problem, ("speed_gain",))), SearchEffort())
    search.grow(1)
    right = search.fitted[("speed_gain",)]
    (growth,) = search.growths(search.base)
    search._fitted[("speed_gain",)] = replace(right, residual=10.0 * right.residual)
    search.fit_best([growth], 1)
    assert search.fitted[("speed_gain",)].cost == pytest.approx(right.cost)
    better = replace(right, residual=0.1 * right.residual)
    search._fitted[("speed_gain",)] = better
    search.fit_best([replace(growth, expected=0.0)], 1)
    # What the other place led to is worse.
    assert search.fitted[("speed_gain",)] is better


def test_a_set_is_not_fitted_again_where_hardly_more_is_promised(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.9))
    problem = problem_of(base, dataset)
    search = Search(problem, Library(responses(problem, ("speed_gain",))), SearchEffort())
    search.grow(1)
    (growth,) = search.growths(search.base)
    asked: list[tuple[str, ...]] = []
    monkeypatch.setattr(search, "_fit_hopeful", lambda some: asked.extend(one.names for one in some))
    search.fit_best([replace(growth, expected=0.9 * search.fitted[growth.names].cost)], 1)
    assert not asked
    search.fit_best([replace(growth, expected=0.5 * search.fitted[growth.names].cost)], 1)
    assert asked == [("speed_gain",)]


def test_effects_are_swapped_from_every_set_that_becomes_the_best_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    best, swapped = iter(["first", "better", "better"]), []
    monkeypatch.setattr(decision, "_best", lambda *_: SimpleNamespace(fitted=next(best)))
    search: Any = SimpleNamespace(swap=swapped.append)
    assert decision._swapped(search, 2, 1.0) == "better"
    assert swapped == ["first", "better"]


def test_effects_behind_a_delay_are_screened_with_the_delay(bench_logs: MakeLogs, base: Model) -> None:
    late = base.with_effect("command_latency", delay_s=0.15)
    dataset = bench_logs(late.with_effect("direction_asymmetry", reverse_ratio=0.8))
    problem = problem_of(base, dataset)
    library = responses(problem, ("command_latency", "direction_asymmetry"))
    search = Search(problem, Library(library), SearchEffort())
    search.grow(1)
    parent = search.fitted[("command_latency",)]
    assert parent.cost > 10.0 * problem.size
    promised = search.growths(parent)[0].expected
    assert promised < 0.3 * growths(base, parent, library)[0].expected
    assert promised < 0.3 * parent.cost


def test_behind_a_delay_no_other_form_of_a_cause_of_the_set_is_screened(
    bench_logs: MakeLogs, base: Model
) -> None:
    dataset = bench_logs(base.with_effect("sensor_latency", delay_s=0.15).with_effect("speed_gain", gain=0.8))
    problem = problem_of(base, dataset)
    library = responses(problem, ("sensor_latency", "sensor_latency/wheels", "speed_gain"))
    search = Search(problem, Library(library), SearchEffort())
    search.grow(1)
    grown = search.growths(search.fitted[("sensor_latency",)])
    assert [growth.candidate.names for growth in grown] == [("speed_gain", "sensor_latency")]


def test_another_form_of_an_effect_that_the_model_has_may_fit_worse(
    bench_logs: MakeLogs, base: Model
) -> None:
    model = base.with_effect("coulomb_friction", "washed_out", torque_n_m=0.9, washout_s=0.2)
    logs = bench_logs(model)
    problem = problem_of(model, logs)
    search = Search(problem, Library(()), SearchEffort())
    droop = effect_set(model, ["coulomb_friction"])
    search.fit_best([Growth(droop, droop.start(), search.base, expected=0.0)], most=1)
    assert search.fitted[droop.names].cost > 2.0 * search.base.cost


@pytest.mark.parametrize(("gain", "is_plain"), [(1.0, False), (0.96, True)])
def test_a_slow_difference_is_plain_though_noise_is_most_of_the_cost(
    bench_logs: MakeLogs, base: Model, gain: float, is_plain: bool
) -> None:
    """Whitened, an error that lasts is in few of the many samples; its plain squares are far too large."""
    logs = bench_logs(base.with_effect("speed_gain", gain=gain), noise_rpm=1.0)
    observations = observe(logs)
    error = ModelError({"speed_rpm": ChannelError(settled=1.0, transient=0.0, correlation_s=0.3)})
    whitener = Whitener(observations, measure_noise(logs, observations), error)
    search = Search(ResidualProblem(base, whitener), Library(()), SearchEffort())
    assert search.base.cost < THRESHOLDS.plainly_visible * search.problem.size
    facts = explore(search, Floor(np.inf, trusted=True, compared=True), 1, np.random.default_rng(0))
    assert facts.is_plain == is_plain


def test_a_difference_that_only_the_correction_makes_is_not_plain(bench_logs: MakeLogs, base: Model) -> None:
    """What the logs of the fit say of the model's error may be far off in other commands."""
    observations = observe(logs := bench_logs(base, noise_rpm=1.0))
    error = ModelError({"speed_rpm": ChannelError(settled=1.0, transient=0.0, correlation_s=0.3)})
    whitener = Whitener(observations, measure_noise(logs, observations), error)
    simulate = ResidualProblem(base, whitener).simulators.full.predictions
    slower = base.with_effect("speed_gain", gain=0.96)
    off = whitener.whiten(simulate(slower)) - whitener.whiten(simulate(base))
    learned = SimpleNamespace(expected_error=lambda *_: (off, np.zeros((off.size, 0))))
    problem = ResidualProblem(base, whitener, learned=cast(Any, learned))
    corrected = base_fit(problem, EMPTY)
    plain = ResidualProblem(base, whitener)
    assert mean_squares(problem, corrected) > 5.0 * mean_squares(plain, base_fit(plain, EMPTY))
    assert not plainly_larger(problem, corrected)


@pytest.mark.parametrize("differs", [0.0, 0.4])
def test_what_differs_between_repeats_is_part_of_the_whole_difference(
    bench_logs: MakeLogs, base: Model, differs: float
) -> None:
    """A gain of 0.8 is nearly all that changed, unless the repeats differ by more than it does."""
    logs = bench_logs(base.with_effect("speed_gain", gain=0.8))
    factors = np.tile([1.0 - differs, 1.0, 1.0 + differs], len(logs.runs) // 3)
    runs = tuple(
        replace(run, channels={**run.channels, "speed_rpm": factor * run.channels["speed_rpm"]})
        for run, factor in zip(logs.runs, factors, strict=True)
    )
    logs = replace(logs, runs=runs)
    problem = problem_of(base, logs)
    candidate = effect_set(base, ["speed_gain"])
    chosen = fit(problem, candidate, candidate.start(), most=20)
    assert chosen is not None
    before = base_fit(problem, EMPTY)
    assert removed(problem, before, chosen) > 0.8
    assert (removed_of_all(problem, before, chosen) > 0.8) == (differs == 0.0)
    if differs:
        # The squares of 0.2, and of what 0.8 (0.4, 0, -0.4) adds to them in the mean over three repeats.
        assert removed_of_all(problem, before, chosen) == pytest.approx(
            0.04 / (0.04 + 0.32**2 * 2 / 3), abs=0.1
        )
