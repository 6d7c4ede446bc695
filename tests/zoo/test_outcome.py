"""The words for an outcome, its figures, and its file."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from mecanum_env.model import paper_model
from sysid.gap.result import FoundEffect, Interval
from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.outcome import Outcome, from_json, outcome_of, to_json


@pytest.mark.parametrize(
    ("hidden", "said", "word"),
    [
        ("a", "a", "right"),
        ("a", "b | a", "rightly ambiguous"),
        ("a", "a + b", "overclaimed"),
        ("a", "a + b | a + c", "overclaimed"),
        ("a", "unexplained", "abstained"),
        ("a", "no_gap", "missed"),
        ("a", "b", "wrong"),
        ("a", "b | c", "wrong"),
        ("a", "error", "error"),
        ("a + b", "b + a", "right"),
        ("a + b", "a + c | a + b", "rightly ambiguous"),
        ("a + b", "a", "vague"),
        ("a + b", "a | b", "vague"),
        ("a + b", "a + c | b + c", "vague"),
        ("a + b", "a + c", "wrong"),
        ("a + b", "a + b + c", "overclaimed"),
    ],
)
def test_the_word_for_hidden_effects(outcome, hidden, said, word):
    assert outcome(hidden, said).word == word


@pytest.mark.parametrize(
    ("said", "word"),
    [("no_gap", "quiet"), ("a", "false alarm"), ("a | b", "false alarm"), ("unexplained", "false alarm")],
)
def test_the_word_for_nothing_hidden(outcome, said, word):
    assert outcome("", said).word == word


@pytest.mark.parametrize("kind", ["near_outsider", "far_outsider"])
@pytest.mark.parametrize(
    ("said", "word"),
    [("unexplained", "right"), ("no_gap", "missed"), ("a", "false name"), ("a | b", "false name")],
)
def test_the_word_for_a_change_without_a_name(outcome, kind, said, word):
    assert outcome("", said, kind).word == word


@pytest.mark.parametrize(
    ("said", "said_so", "word"),
    [
        ("no_gap", False, "right"),
        ("unexplained", True, "right"),
        ("unexplained", False, "abstained"),
        ("a", False, "right"),
        ("b", True, "wrong"),
        ("b | a", False, "rightly ambiguous"),
    ],
)
def test_the_word_for_what_the_logs_cannot_show(outcome, said, said_so, word):
    assert outcome("a", said, "untestable", said_untestable=said_so).word == word


def test_intervals_count_only_where_just_the_hidden_set_was_adopted(outcome):
    bounds = {"a": {"size": (2.1, 1.9, 2.3), "other": (0.0, 0.0, 0.0)}, "b": {"size": (1.0, 0.9, 1.1)}}
    assert outcome("a", "a", parameters=bounds).covered() == (("a", "size", True),)
    both = outcome("a + b", "a + b | a + c", parameters=bounds)
    assert both.covered() == (("a", "size", True), ("b", "size", False))
    assert outcome("a", "a + b", parameters=bounds).covered() == ()
    assert outcome("a", "b | a", parameters=bounds).covered() == ()


def test_closure_counts_from_the_noise(outcome):
    assert outcome("a", "a", before=6.0, after=1.2, floor=1.0).closure == pytest.approx(0.96)
    assert math.isnan(outcome("a", "no_gap", before=0.9, after=0.9, floor=1.0).closure)
    assert math.isnan(outcome("a", "a", before=6.0, after=1.2).closure)
    beside = outcome("a", "a", before=6.0, after=5.8, floor=1.0, beside_fit=(3.0, 1.5, 1.0))
    assert beside.closure_beside_fit == pytest.approx(0.75)
    assert math.isnan(outcome("a", "a", before=6.0, after=1.2, floor=1.0).closure_beside_fit)


def test_an_outcome_survives_its_file(outcome):
    made = outcome(
        "a + b",
        "a + b | c",
        parameters={"a": {"size": (1.0, -math.inf, math.inf)}},
        notes=("one",),
        twins=("d",),
        message="m",
        beside_fit=(3.0, 1.5, 1.0),
    )
    again = from_json(json.loads(json.dumps(to_json(made), allow_nan=False)))
    assert math.isnan(again.before)
    known = {"before": 0.0, "after": 0.0, "floor": 0.0, "misfit": 0.0, "best_misfit": 0.0}
    assert replace(again, **known) == replace(made, **known)


def report(**given: Any) -> Any:
    """Return a report of what the zoo reads of one."""
    known = {
        "verdict": "no_gap",
        "effects": (),
        "candidates": (),
        "gap": SimpleNamespace(before=3.0, after=1.5, noise_floor=1.0),
        "gap_beside_fit": None,
        "untestable": (),
        "smallest_detectable": {},
        "evidence": (),
        "p_value": 0.5,
        "base": paper_model(),
        "trusted": True,
        "notes": ("a note",),
    }
    made = known | given
    return SimpleNamespace(**made, new_effects=made["effects"])


def study(effect: str, parameter: str, true: float, **given: Any) -> Outcome:
    hidden = (Hidden(effect, "", {parameter: true}),)
    case = Case(1, "bench", "untestable", "pi", "gentle", "few", hidden)
    return outcome_of(case, report(**given), 1.0, 2.0)


def test_an_outcome_keeps_what_calibration_needs_by_cause_whatever_the_form():
    sets = [("backlash",), ("wheel_law",), ()]
    rows = [SimpleNamespace(effects=names, misfit=m) for names, m in zip(sets, (1.1, 2.0, 9.0), strict=True)]
    found = FoundEffect("backlash/rest", {"gap_deg": Interval(2.0, 1.0, 3.0)}, 1.0)
    made = study("backlash", "gap_deg", 2.0, verdict="named", effects=(found,), evidence=rows[1:] + rows[:1])
    assert (made.named, made.parameters) == (("backlash",), {"backlash": {"gap_deg": (2.0, 1.0, 3.0)}})
    assert (made.misfit, made.best, made.best_misfit) == (9.0, ("backlash",), 1.1)
    assert made.noise_ratio == pytest.approx(9.0)
    assert (made.fit_s, made.study_s) == (1.0, 2.0)


def test_an_effect_called_untestable_was_said_to_be():
    entry = SimpleNamespace(name="direction_asymmetry")
    assert study("direction_asymmetry", "reverse_ratio", 0.8, untestable=[entry]).said_untestable
    assert not study("direction_asymmetry", "reverse_ratio", 0.8).said_untestable


@pytest.mark.parametrize(
    ("effect", "parameter", "true", "seen", "expected"),
    [
        ("speed_saturation", "limit_rpm", 90.0, 69.0, True),  # neutral is the paper's ceiling, above
        ("speed_saturation", "limit_rpm", 60.0, 69.0, False),
        ("command_deadband", "threshold_rpm", 12.0, 30.0, True),  # neutral is 0
        ("command_deadband", "threshold_rpm", 12.0, 5.0, False),
        ("command_loss", "share", 0.1, None, False),  # no effect of the catalogue
    ],
)
def test_a_size_below_the_smallest_detectable_one_was_said_to_be_out_of_sight(
    effect, parameter, true, seen, expected
):
    known = {} if seen is None else {effect: {parameter: seen}}
    assert study(effect, parameter, true, smallest_detectable=known).said_untestable is expected
