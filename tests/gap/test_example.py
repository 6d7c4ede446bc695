"""The bundled example, from gap to closed gap: two things are hidden in its logs, only those are found."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from mecanum_env.model import Model, read_model
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.report.output import gap_table, write_study
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, read_dataset

EXAMPLES = Path(__file__).parents[2] / "examples"
DEAD_BAND_RPM, RAMP_RPM_S = 12.5, 900.0
"""Of examples/make_gap_logs.py."""


@pytest.fixture(scope="module")
def model() -> Model:
    # These logs have no effects (tests/fit/test_command_line.py), and the search for some takes longest.
    return fitted_model(fit_dataset(read_dataset(EXAMPLES / "logs"), FitOptions(starts=1, effects="off")))


@pytest.fixture(scope="module")
def changed() -> Dataset:
    return read_dataset(EXAMPLES / "gap_logs")


@pytest.fixture(scope="module")
def report(changed: Dataset, model: Model) -> GapReport:
    return analyse(changed, model)


def test_what_is_hidden_is_named_and_nothing_else(report: GapReport):
    assert report.verdict == "named"
    assert [found.name for found in report.effects] == ["command_deadband", "acceleration_limit"]
    assert report.candidates == (("command_deadband", "acceleration_limit"),)
    assert all(found.selection_frequency > 0.9 for found in report.effects)


def test_the_sizes_are_those_that_were_hidden(report: GapReport):
    band, ramp = (found.parameters for found in report.effects)
    threshold = band["threshold_rpm"]
    assert threshold.low <= DEAD_BAND_RPM <= threshold.high
    # Commands of 12 rpm do nothing and those of 14 rpm act: what is between is all the same.
    assert 12.0 <= threshold.value <= 14.0
    assert ramp["limit_rpm_s"].value == pytest.approx(RAMP_RPM_S, rel=0.02)


def test_the_gap_is_closed_on_runs_that_no_decision_has_seen(report: GapReport):
    gap = report.gap
    assert gap.noise_floor == pytest.approx(0.5, rel=0.05)
    assert gap.before > 20.0 * gap.noise_floor
    assert gap.before - gap.after > 0.95 * (gap.before - gap.noise_floor)


def test_the_difference_was_where_the_ramp_and_the_dead_band_act(report: GapReport):
    by_phase = {r.region: r for r in report.where if r.dimension == "phase"}
    assert max(by_phase.values(), key=lambda region: region.share).region == "reversal"
    assert by_phase["steady"].rms_after < 0.5 * by_phase["steady"].rms


def test_the_new_model_has_no_gap_left(report: GapReport, changed: Dataset, tmp_path: Path):
    write_study(report, tmp_path)
    improved = read_model(tmp_path / "model.json")
    assert set(improved.effects) == {"command_deadband", "acceleration_limit"}
    again = analyse(changed, improved, GapOptions(next_experiment=False))
    assert again.verdict == "no_gap"
    assert again.gap.before == pytest.approx(report.gap.after, rel=1e-6)


def test_any_number_of_jobs_gives_the_same_bytes(changed: Dataset, model: Model, tmp_path: Path):
    few = replace(changed, runs=tuple(run for run in changed.runs if run.group.startswith(("slow", "stair"))))
    only = ("command_deadband", "acceleration_limit", "speed_gain")
    for jobs in (1, 3):
        options = GapOptions(seed=1, only=only, jobs=jobs, max_effects=2, next_experiment=False)
        write_study(analyse(few, model, options), tmp_path / str(jobs))
    first = (tmp_path / "1" / "gap.json").read_bytes()
    assert json.loads(first)["verdict"] == "named"
    assert (tmp_path / "3" / "gap.json").read_bytes() == first
    assert read_model(tmp_path / "3" / "model.json") == read_model(tmp_path / "1" / "model.json")


def test_the_terminal_says_it_in_ten_lines(report: GapReport):
    lines = gap_table(report).splitlines()
    assert len(lines) <= 10
    assert "The model lacks command_deadband and acceleration_limit" in lines[0]
