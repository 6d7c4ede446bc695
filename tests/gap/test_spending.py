"""False alarms of repeated studies of the same logs add up to no more than twice those of one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from sysid.gap.result import GapOptions, Spent
from sysid.gap.search.chance import ChanceGains, Floor
from sysid.gap.search.rules import Facts, apply_rules
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.spending import Budget, budget_of, studies_near, with_studies
from sysid.logs import BenchCommand, Dataset, Run

MODEL: Model = paper_model()
_STILL = np.zeros(3)
_RUN = Run("r.csv", "r", "fit", np.arange(3.0), BenchCommand(_STILL), {"speed_rpm": _STILL})
LOGS = Dataset("logs", (_RUN,), (), "one")
ALONE = THRESHOLDS.false_alarm


def _of(options: GapOptions, model: Model = MODEL, dataset: Dataset = LOGS) -> Budget:
    return budget_of(dataset, model, options)


def test_each_further_study_of_the_same_logs_has_half_of_what_the_others_left() -> None:
    options, levels = GapOptions(), []
    for seed in range(4):
        found = _of(replace(options, seed=seed))
        levels.append(found.level)
        options = replace(options, earlier=found.studies)
    assert levels == pytest.approx([ALONE, ALONE / 2, ALONE / 4, ALONE / 8])


def test_the_same_study_again_spends_nothing_anew() -> None:
    first = _of(GapOptions(only=("backlash",)))
    second = _of(GapOptions(earlier=first.studies))
    again = _of(GapOptions(only=("backlash",), earlier=second.studies, jobs=3, adopt=True))
    assert again.level == first.level
    assert again.studies == second.studies


def test_what_other_logs_have_spent_does_not_count() -> None:
    first = _of(GapOptions())
    assert _of(GapOptions(seed=1, earlier=first.studies), dataset=replace(LOGS, sha256="two")).level == ALONE


def test_logs_that_cannot_be_recognised_spend_nothing() -> None:
    found = _of(GapOptions(), dataset=replace(LOGS, sha256=""))
    assert (found.level, found.studies) == (ALONE, ())


def test_a_model_tells_the_next_study_which_ones_made_it() -> None:
    first = _of(GapOptions())
    made = with_studies(MODEL.with_effect("speed_gain", gain=0.9), first.studies)
    second = _of(GapOptions(), made)
    assert second.level == pytest.approx(ALONE / 2)
    assert len(with_studies(made, second.studies).provenance["studies"]) == 2


def test_studies_that_did_not_know_of_each_other_never_leave_a_level_of_zero() -> None:
    earlier = tuple(Spent("one", str(i), ALONE) for i in range(4))
    assert 0.0 < _of(GapOptions(earlier=earlier)).level < ALONE


def test_results_in_the_folder_and_beside_it_are_found_and_other_files_are_passed_over(
    tmp_path: Path,
) -> None:
    spent = Spent("one", "a", ALONE)
    rows = [vars(spent), {"study": 3}, "no"]
    for name, text in (("gap", json.dumps({"studies": rows})), ("other", "{"), ("list", "[]")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "gap.json").write_text(text, encoding="utf-8")
    assert studies_near(tmp_path / "gap") == studies_near(tmp_path / "gap_again") == (spent,)


def test_a_difference_between_the_levels_is_a_gap_in_the_first_study_only() -> None:
    floor = Floor(1e3, trusted=True)
    facts = Facts(floor, 1.0, 0.008, 0.008, True, 1.0)
    assert apply_rules(facts).verdict != "no_gap"
    later = replace(facts, floor=replace(floor, false_alarm=ALONE / 2))
    assert apply_rules(later).verdict == "no_gap"


def test_a_smaller_level_needs_a_larger_gain() -> None:
    gains = np.sort(np.random.default_rng(0).chisquare(3, 4000))
    assert ChanceGains(gains, ALONE / 4).threshold() > ChanceGains(gains).threshold()
