"""Tables, metrics and power curves of a run: what counts where, and when a target is reached."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sysid.studies.score import size_of
from sysid.studies.zoo.calibration import calibrate, choose_p_value, quantile
from sysid.studies.zoo.cases.case import Hidden
from sysid.studies.zoo.goals import at_least, at_most, goals
from sysid.studies.zoo.page import Provenance, page_markdown, run_json, summary_text
from sysid.studies.zoo.power import curve, power_table, write_power_plot
from sysid.studies.zoo.tables import coverage_table, false_alarm_table, share, signal_of, word_tables


@pytest.mark.parametrize(
    ("signal", "size"),
    [(0.0, "undetectable"), (0.3, "weak"), (1.0, "clear"), (5.0, "gross"), (math.inf, "gross")],
)
def test_sizes_are_by_signal(signal, size):
    assert size_of(signal) == size


def test_several_effects_are_as_large_as_the_smallest_alone(outcome):
    pair = (Hidden("a", "fixed", {}, 8.0), Hidden("b", "fixed", {}, 0.5))
    unknown = outcome("a + b", signal=9.0)
    assert signal_of(unknown) == 9.0
    assert signal_of(replace(unknown, case=replace(unknown.case, hidden=pair))) == 0.5


def test_a_target_is_reached_only_by_the_whole_interval():
    assert at_least("x", [True] * 200, 0.95).reached == "reached"
    assert at_least("x", [True] * 20, 0.95).reached == "open"
    assert at_least("x", [True, False] * 20, 0.95).reached == "missed"
    assert at_most("x", [False] * 73, 0.05).reached == "reached"
    assert at_most("x", [False] * 72, 0.05).reached == "open"
    assert at_most("x", [True, False] * 20, 0.05).reached == "missed"
    assert at_most("x", [False], 0.0).reached == "reached"
    assert at_most("x", [True, *[False] * 99], 0.0).reached == "missed"
    assert at_least("x", [], 0.95).reached == "-"


def test_metrics_count_the_sizes_and_kinds_that_they_name(outcome):
    run = [
        outcome("a", "a", signal=2.0, before=5.0, after=1.0, floor=1.0),
        outcome("a", "no_gap", signal=9.0, before=5.0, after=5.0, floor=1.0),
        outcome("a", "no_gap", signal=0.5),
        outcome("a", "no_gap", signal=0.1),
        outcome("a + b", "a + c", signal=9.0),
        outcome("a", "a", "twin", twins=("t",)),
        outcome("", "a"),
        outcome("", "no_gap"),
        outcome("", "a", "far_outsider"),
        outcome("a", "no_gap", "untestable"),
        outcome("a", "error", level="robot"),
    ]
    found = {goal.name: goal for goal in goals(run)}
    value = {name: (metric.value, metric.count) for name, metric in found.items()}
    assert value["bench: clear and gross singles found"] == (pytest.approx(2 / 3), 3)
    assert value["bench: weak singles found"] == (0.0, 1)
    assert value["bench: clear and gross pairs and triples found"] == (0.0, 1)
    assert value["bench: clear and gross with a false name"] == (0.25, 4)
    assert value["bench: false alarms"] == (0.5, 2)
    assert value["bench: names for what has none"] == (1.0, 1)
    assert value["bench: twins named alone"] == (1.0, 1)
    assert value["bench: median closure of clear and gross"] == (0.5, 2)
    assert value["untestable: right"] == (1.0, 1)
    assert value["errors"] == (pytest.approx(1 / 11), 11)
    assert found["robot: false alarms"].reached == "-"


def test_words_are_counted_by_name_and_form(outcome):
    run = [outcome("a", "a"), outcome("a", "b"), outcome("b", "no_gap", signal=0.1)]
    table = next(t for t in word_tables(run) if t.title == "By name and form")
    assert table.head == ("name, form", "cases", "right", "missed", "wrong", "found where clear or gross")
    assert [row[:5] for row in table.rows] == [
        ("bench: a, fixed", "2", "1", "", "1"),
        ("bench: b, fixed", "1", "", "1", ""),
    ]
    assert table.rows[0][-1].startswith("50.0 %")
    assert table.rows[1][-1] == "-"


def test_false_alarms_are_listed_by_plan_with_what_was_said(outcome):
    run = [outcome("", "b | a", plan="p"), outcome("", "no_gap", plan="p"), outcome("", "no_gap", plan="q")]
    rows = {row[1]: row for row in false_alarm_table(run).rows if row[0] == "plan"}
    assert rows["bench: p"][2].startswith("50.0 %")
    assert rows["bench: p"][3] == "ambiguous: a | b (1)"
    assert rows["bench: q"][3] == ""


def test_coverage_is_by_name_and_parameter(outcome):
    low, high = {"a": {"size": (1.0, 0.9, 1.1)}}, {"a": {"size": (2.0, 1.9, 2.1)}}
    run = [outcome("a", "a", parameters=low), outcome("a", "a", parameters=high)]
    assert coverage_table(run).rows == (("a", "size", share([False, True]).text()),)


def test_a_power_curve_pools_signals_between_edges(outcome):
    run = [outcome("a", "a", signal=4.0), outcome("a", "no_gap", signal=1.0), outcome("a", "a", signal=40.0)]
    points = curve("a", run, (0.0, 0.5, 10.0, math.inf)).points
    assert [(p.signal, p.found.value) for p in points] == [
        (pytest.approx(2.0), 0.5),
        (pytest.approx(40.0), 1.0),
    ]
    assert power_table(run).rows[-1][0] == "a"


def test_the_interval_of_a_quantile_is_that_of_ordered_values():
    found = quantile([float(i) for i in range(1, 101)], 0.5)
    assert (found.value, found.low, found.high) == (50.5, 40.0, 61.0)
    assert quantile([1.0, 2.0], 0.95).high == math.inf
    assert math.isnan(quantile([], 0.95).value)


def test_a_p_value_is_chosen_by_the_bound_of_its_false_alarms(outcome):
    quiet = [outcome() for _ in range(200)]
    assert choose_p_value(quiet).value == 0.01
    assert "too few" in choose_p_value(quiet[:20]).why
    alarms = [outcome("", "a", p_value=p) for p in [1e-3] * 20 + [1e-5] * 3]
    hidden = [outcome("a", "a", p_value=p) for p in (1e-4, 5e-3)]
    chosen = choose_p_value([*quiet, *alarms, *hidden])
    assert chosen.value == pytest.approx(1e-3)
    assert chosen.value < 1e-3
    assert (chosen.alarms.hits, chosen.kept.hits) == (3, 1)


@pytest.mark.parametrize(("p_value", "why"), [(1e-20, "smaller than any chance"), (0.4, "do not depend")])
def test_no_p_value_is_chosen_where_none_helps(outcome, p_value, why):
    run = [
        *(outcome() for _ in range(100)),
        *(outcome("", "unexplained", p_value=p_value) for _ in range(30)),
    ]
    chosen = choose_p_value(run)
    assert chosen.value is None
    assert why in chosen.why


def test_a_family_is_judged_by_what_was_calibrated_without_it(outcome):
    calm = [outcome(family="pi", before=1.0, floor=1.0) for _ in range(100)]
    wild = [outcome("", "a", family="p", before=3.0, floor=1.0) for _ in range(10)]
    found = calibrate([*calm, *wild])
    own = {left.family: left for left in found.families}
    assert own["p"].above_noise == 1.0
    assert own["p"].above.value == 1.0
    assert own["p"].alarms.value == 1.0
    assert own["pi"].above.value == 0.0
    assert own["pi"].p_value is None


def test_the_page_names_commit_command_and_seeds(outcome, tmp_path):
    run = [outcome("a", "a", seed=4), outcome(seed=5), outcome("b", "error", seed=6, message="fit: no")]
    about = Provenance(
        "python -m x", "1.2", "abcdef0123456789+", "f00", "2027-01-31", {"bench": "4-6"}, False
    )
    page = page_markdown(run, ["bench-0007: ValueError: drawn"], about, {"pi": "A loop."}, "zoo_power.png")
    for said in (
        "`python -m x`",
        "`abcdef012345+`",
        "bench 4-6",
        "(zoo_power.png)",
        "| bench-0007 | ValueError",
    ):
        assert said in page
    assert "fit: no" in page
    assert "Families left out in turn" in page
    assert "fit: no" in summary_text(run, [])
    written = run_json(run, [], about)
    assert [case["word"] for case in written["cases"]] == ["right", "quiet", "error"]
    write_power_plot(run, tmp_path / "power.png")
    assert (tmp_path / "power.png").stat().st_size > 1000


def test_a_sealed_page_calibrates_nothing(outcome):
    about = Provenance("python -m x", "1.2", "abc", "f00", "2027-01-31", {"bench": "1000"}, True)
    page = page_markdown([outcome(seed=1000)], [], about, {}, "zoo_power.png")
    assert "Families left out in turn" not in page
    assert "Sealed seeds" in page
