"""The scorer: closure, coverage, intervals of shares, and what it refuses."""

from __future__ import annotations

import json
import math
from pathlib import Path

import pytest

from mecanum_env.statistics import wilson_interval
from sysid.studies.score import AnswerError, closure, metrics, score_folder, wilson


def answered(folder: Path, cases: dict) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    whole = {"format": "gapbench-answers/1", "method": "mine", "cases": cases}
    (folder / "answers.json").write_text(json.dumps(whole), encoding="utf-8")
    return folder


def copied(bench: Path, case: str, answers: Path, source: str) -> None:
    target = answers / "predictions" / case
    target.mkdir(parents=True)
    text = (bench / source / "test_00.csv").read_text(encoding="utf-8")
    (target / "test_00.csv").write_text(text, encoding="utf-8")


def test_words_sizes_and_coverage_of_a_folder(made, tmp_path):
    gain = {"gain": {"value": 0.81, "low": 0.79, "high": 0.83}}
    late = {"delay_s": {"value": 0.2, "low": 0.19, "high": 0.21}}
    answers = answered(
        tmp_path,
        {
            "case_000": {"verdict": "named", "effects": [{"name": "speed_gain", "parameters": gain}]},
            "case_001": {"verdict": "unexplained"},
            "case_002": {"verdict": "named", "effects": [{"name": "sensor_latency", "parameters": late}]},
        },
    )
    scored = score_folder(answers, made)
    assert [(one.word, one.sets) for one in scored] == [("right", 1), ("false alarm", 0), ("right", 1)]
    assert [one.held for one in scored] == [(True,), (), (False,)]
    assert {m.name: m.value for m in metrics(scored)}["coverage"] == 0.5
    assert math.isnan(scored[0].closure)


def test_closure_is_between_the_simulator_and_the_noise(made, tmp_path):
    answers = answered(tmp_path, {f"case_00{i}": {"verdict": "no_gap"} for i in range(3)})
    copied(made, "case_000", answers, "cases/case_000/simulator/test")
    copied(made, "case_002", answers, "truth/case_002/test")
    scored = score_folder(answers, made)
    assert scored[0].closure == pytest.approx(0.0)
    assert scored[2].closure > 1.0
    assert closure(5.0, 1.0, 1.0) == 1.0
    assert math.isnan(closure(1.0, 1.0, 2.0))


def test_a_case_without_an_answer_is_an_error(made, tmp_path):
    scored = score_folder(answered(tmp_path, {"case_000": {"verdict": "no_gap"}}), made)
    assert [one.word for one in scored] == ["missed", "error", "error"]


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        ({"verdict": "maybe"}, "verdict is 'maybe', must be one of no_gap"),
        ({"verdict": "named"}, "needs effects"),
        ({"verdict": "named", "effects": [{"name": "Backlash"}]}, "'Backlash' is no name"),
        ({"verdict": "ambiguous", "candidates": [["backlash"]]}, "at least two"),
    ],
)
def test_a_wrong_answer_names_the_case_and_what_would_be_right(made, tmp_path, answer, message):
    with pytest.raises(AnswerError, match=message) as caught:
        score_folder(answered(tmp_path, {"case_001": answer}), made)
    assert "case_001" in str(caught.value)


def test_a_prediction_of_another_length_is_refused(made, tmp_path):
    answers = answered(tmp_path, {"case_000": {"verdict": "no_gap"}})
    copied(made, "case_000", answers, "truth/case_000/test")
    path = answers / "predictions/case_000/test_00.csv"
    path.write_text("time_s,speed_rpm\n0,1\n", encoding="utf-8")
    with pytest.raises(AnswerError, match="1 rows, must be 100"):
        score_folder(answers, made)


@pytest.mark.parametrize(("hits", "count"), [(0, 7), (7, 7), (3, 11), (120, 400)])
def test_the_standalone_interval_is_wilsons(hits, count):
    assert wilson(hits, count) == pytest.approx(wilson_interval(hits, count), abs=1e-9)
