"""Test runs refute what raises the error there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model
from mecanum_env.simulator import replay_bench
from sysid.gap.refuted import not_in_test_runs, refuted, verdict_of_refuted
from sysid.gap.result import Difference, GapReport, Verdict
from sysid.gap.search.chance import Floor
from sysid.gap.search.rules import Facts
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run, Split
from tests.gap.conftest import NOISE_RPM, MakeLogs

UNKNOWN = Floor(1e4, trusted=True)
"""Nothing is known of the model's own error from other logs."""
NEW = replace(UNKNOWN, compared=True)
"""It is known from logs of the fit, which drove other commands."""


def mixed(deciding: Dataset, test: Dataset) -> Dataset:
    """Return the fit and validation runs of some logs with the test runs of others."""
    own = [run for run in deciding.runs if run.split != "test"]
    return replace(deciding, runs=(*own, *test.split("test")))


@pytest.fixture(scope="module")
def report(base: Model, bench_logs: MakeLogs) -> GapReport:
    """Return a study of logs in which the test runs are of a wheel without the effect that others show."""
    slower = base.with_effect("speed_gain", gain=0.95)
    return analyse(mixed(bench_logs(slower), bench_logs(base, seed=0)), base)


def test_an_effect_that_raises_the_error_on_test_runs_is_not_named(base: Model, report: GapReport) -> None:
    assert report.verdict == "unexplained"
    assert (report.effects, report.candidates) == ((), ())
    assert report.gap.after == report.gap.before
    assert dict(report.model.effects) == dict(base.effects)
    assert any("raises the error on the unseen test runs from" in note for note in report.notes)


@pytest.fixture(scope="module")
def found(base: Model, bench_logs: MakeLogs) -> GapReport:
    """Return a study of logs in which all runs show the effect."""
    return analyse(bench_logs(base.with_effect("speed_gain", gain=0.95)), base)


def test_the_same_effect_is_named_where_the_test_runs_show_it_too(found: GapReport) -> None:
    assert found.verdict in ("named", "ambiguous")
    assert refuted(found, UNKNOWN) == ""
    assert refuted(found, NEW) == ""


@pytest.mark.parametrize(
    "changes",
    [
        lambda gap: {"gap": replace(gap, after=1.04 * gap.before)},
        lambda _: {"unseen": False},
        lambda _: {"effects": ()},
        lambda gap: {"gap_beside_fit": replace(gap, after=0.5 * gap.before)},
    ],
    ids=["within chance", "no untouched runs", "nothing named", "less beside the logs of the fit"],
)
def test_what_refutes_nothing(found: GapReport, changes: Callable[[Difference], dict[str, Any]]) -> None:
    worse = replace(found, gap=replace(found.gap, after=2.0 * found.gap.before))
    assert refuted(worse, UNKNOWN) != ""
    assert refuted(replace(worse, **changes(worse.gap)), UNKNOWN) == ""


def with_gap(found: GapReport, before: float, after: float, noise: float | None) -> GapReport:
    """Return a report with other errors on its test runs and another noise floor."""
    return replace(found, gap=replace(found.gap, before=before, after=after, noise_floor=noise))


def test_a_name_in_new_commands_must_remove_some_of_the_error_on_test_runs(found: GapReport) -> None:
    why = refuted(with_gap(found, 2.75, 2.74, 0.35), NEW)
    assert "hardly lowers the error on the unseen test runs from 2.75 rpm to 2.74 rpm" in why
    # A tenth of the squares above the noise is enough.
    assert refuted(with_gap(found, 2.75, 2.6, 0.35), NEW) == ""


def test_test_runs_that_never_do_what_an_effect_acts_on_say_nothing(found: GapReport) -> None:
    """As for a dead band that no command of theirs lies in."""
    silent = with_gap(found, 2.75, 2.75, 0.35)
    assert refuted(silent, NEW) == ""
    assert not_in_test_runs(silent).startswith("no test run does what shows")
    assert not_in_test_runs(found) == ""


@pytest.mark.parametrize(
    ("floor", "noise"),
    [
        (UNKNOWN, 0.35),
        (replace(NEW, familiar=True), 0.35),
        (replace(NEW, knows_all=True), 0.35),
        (NEW, None),
        (NEW, 2.7),
    ],
    ids=["no logs of the fit", "its commands", "a robot", "unknown noise", "test runs show nothing"],
)
def test_where_test_runs_need_not_confirm_a_name(found: GapReport, floor: Floor, noise: float | None) -> None:
    assert refuted(with_gap(found, 2.75, 2.74, noise), floor) == ""


def steps_of(model: Model, levels: Sequence[float], split: Split, rng: np.random.Generator) -> list[Run]:
    """Return two runs in which the wheel is driven half a second at each level, and back to rest."""
    time = 0.01 * np.arange(100 * len(levels) + 1)
    command = np.repeat([x for level in levels for x in (level, 0.0)], 50)
    command = np.append(command, 0.0)
    speed = replay_bench(model, time, command)
    return [
        Run(
            f"{split}_{levels[0]:g}_{k}.csv",
            f"{split}_{levels[0]:g}",
            split,
            time,
            BenchCommand(command),
            {"speed_rpm": speed + NOISE_RPM * rng.standard_normal(time.size)},
        )
        for k in range(2)
    ]


def dead_band_study(base: Model, *of_test: float) -> GapReport:
    """Return a study of a dead band of 30 rpm between 28 and 38 rpm, whose test runs drive other levels."""
    dead, rng = base.with_effect("command_deadband", threshold_rpm=30.0), np.random.default_rng(0)
    parts: tuple[tuple[tuple[float, ...], Split], ...] = (
        ((28.0, 60.0, -28.0, 90.0), "fit"),
        ((38.0, -20.0, 80.0, -38.0), "fit"),
        ((20.0, 38.0, -90.0, 28.0), "fit"),
        ((-60.0, 28.0, -38.0, 20.0), "validation"),
        (of_test, "test"),
    )
    runs = [run for levels, split in parts for run in steps_of(dead, levels, split, rng)]
    return analyse(Dataset("steps", tuple(runs), ()), base)


@pytest.fixture(scope="module")
def threshold(base: Model) -> GapReport:
    return dead_band_study(base, 32.0, -20.0, -32.0, 90.0)


def test_a_dead_band_that_no_test_run_lies_in_is_named_and_told_to_be_unconfirmed(base: Model) -> None:
    report = dead_band_study(base, 60.0, -80.0, 90.0, -60.0)
    assert report.candidates == (("command_deadband",),)
    assert report.gap.after == report.gap.before
    assert "no test run does what shows command_deadband, so that none confirms it" in report.notes


def test_a_threshold_that_test_runs_refute_is_stated_where_it_does_least(threshold: GapReport) -> None:
    assert threshold.verdict in ("named", "ambiguous")
    assert threshold.candidates[0] == ("command_deadband",)
    (effect,) = threshold.effects
    assert effect.name == "command_deadband"
    size = effect.parameters["threshold_rpm"]
    assert 28.0 < size.value < 28.5
    assert size.low <= size.value
    assert 37.0 < size.high <= 38.0
    assert threshold.gap.after <= threshold.gap.before
    assert any("unseen test runs refute a threshold in the middle" in note for note in threshold.notes)
    assert threshold.model.effects["command_deadband"]["threshold_rpm"] == size.value


@pytest.mark.parametrize(
    ("p_misfit", "is_plain", "trusted", "verdict"),
    [
        (0.5, False, True, "no_gap"),
        (0.001, False, True, "unexplained"),
        (0.5, True, True, "unexplained"),
        (1.0, False, False, "unexplained"),
    ],
    ids=["noise", "more than noise", "plainly more", "nobody knows what a right model leaves"],
)
def test_without_the_refuted_effects_a_gap_is_left_only_if_the_whole_residual_shows_one(
    p_misfit: float, is_plain: bool, trusted: bool, verdict: Verdict
) -> None:
    facts = Facts(Floor(1e4, trusted=trusted), 1.0, 0.001, p_misfit, is_plain, 1.0)
    assert verdict_of_refuted(facts) == verdict
