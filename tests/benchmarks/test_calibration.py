"""The page of `benchmarks/calibration.py`: which values it holds against a threshold, and what it quotes."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, fields, replace
from pathlib import Path
from types import ModuleType

import pytest

from sysid.gap.search import thresholds
from sysid.gap.search.thresholds import THRESHOLDS, Thresholds
from sysid.studies.zoo.cases.case import Case, Hidden


@pytest.fixture(scope="module")
def calibration(benchmark_of: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_of("calibration")


LEAST = THRESHOLDS.least_elsewhere


def _robot(calibration: ModuleType, hidden: str, *limits: tuple[str, float, float]):
    found = tuple(calibration.Limit(*limit) for limit in limits)
    return calibration.Measured(7, hidden, 2.0 if hidden else 0.0, 1.2, 1.1, found)


def test_of_a_quiet_robot_decides_what_the_logs_of_the_fit_do_not_excuse(calibration: ModuleType) -> None:
    excused = ("acceleration_limit", 2.0 * LEAST, 3.0 * LEAST)
    one = _robot(calibration, "", excused, ("backlash", 0.5 * LEAST, LEAST), ("stiction", 0.1 * LEAST, LEAST))
    assert one.deciding.effect == "backlash"
    assert one.familiar.effect == "acceleration_limit"


def test_what_explains_more_than_the_logs_of_the_fit_ask_for_is_not_excused(calibration: ModuleType) -> None:
    one = _robot(calibration, "", ("acceleration_limit", 4.0 * LEAST, 3.0 * LEAST))
    assert one.deciding.effect == "acceleration_limit"


def test_of_a_hidden_limit_its_best_form_decides_even_if_it_is_excused(calibration: ModuleType) -> None:
    one = _robot(
        calibration,
        "backlash",
        ("backlash", 0.2 * LEAST, LEAST),
        ("backlash/spring", 2.0 * LEAST, 3.0 * LEAST),
        ("stiction", 5.0 * LEAST, LEAST),
    )
    assert one.deciding.effect == "backlash/spring"


def test_a_hidden_limit_that_these_logs_cannot_show_explains_nothing(calibration: ModuleType) -> None:
    one = _robot(calibration, "backlash", ("stiction", 5.0 * LEAST, LEAST))
    assert (one.deciding.effect, one.deciding.explains) == ("", 0.0)


def test_the_summary_shows_both_sides_of_a_threshold(calibration: ModuleType) -> None:
    quiet = _robot(calibration, "", ("backlash", 0.5 * LEAST, LEAST))
    quieter = replace(quiet, limits=(calibration.Limit("backlash", 0.2 * LEAST, LEAST),), plain=0.9)
    clear = _robot(calibration, "backlash", ("backlash", 2.0 * LEAST, LEAST))
    lost = replace(clear, limits=(calibration.Limit("backlash", 0.4 * LEAST, LEAST),), plain=7.0)
    rows = {row[2]: row for row in calibration.summary([quiet, lost], [quiet, quieter, clear, lost])}
    assert rows["drives, plain squares"][3:] == ("1.1", "0 of 1", "7", "1 of 1")
    wanted = (f"{0.5 * LEAST:.3g}", "0 of 2", f"{0.4 * LEAST:.3g}", "1 of 2")
    assert rows["robots, limits and thresholds"][3:] == wanted


def test_the_best_set_counts_only_where_nothing_is_plainly_visible(calibration: ModuleType) -> None:
    least = THRESHOLDS.least_on_bench
    quiet = replace(_robot(calibration, ""), best="backlash", fall=0.5 * least)
    plain = replace(quiet, fall=2.0 * least, plain=2.0 * THRESHOLDS.plainly_visible)
    hidden = replace(_robot(calibration, "backlash"), best="backlash", fall=2.0 * least)
    rows = {row[0]: row for row in calibration.summary([quiet, plain, hidden], [])}
    assert rows["`least_on_bench`"][3:] == (f"{0.5 * least:.3g}", "0 of 1", f"{2.0 * least:.3g}", "1 of 1")


def test_without_cases_a_side_stays_empty(calibration: ModuleType) -> None:
    assert {row[3:] for row in calibration.summary([], [])} == {("-", "0 of 0", "-", "0 of 0")}


def test_every_threshold_has_a_comment_that_is_quoted_whole(calibration: ModuleType) -> None:
    source = Path(thresholds.__file__).read_text(encoding="utf-8")
    said = calibration.comments(source, "Thresholds")
    assert list(said) == [field.name for field in fields(Thresholds)]
    assert all(text.endswith(".") for text in said.values())


def test_a_finished_case_is_read_as_it_was_measured(calibration: ModuleType) -> None:
    one = _robot(calibration, "backlash", ("backlash", 2.0 * LEAST, LEAST))
    assert calibration.from_json(json.loads(json.dumps(asdict(one)))) == one


def test_only_development_seeds_of_the_wanted_kind_are_drawn(calibration: ModuleType) -> None:
    for level, kind_of in (("bench", calibration.bench.kind_of), ("robot", calibration.robot.kind_of)):
        seeds = calibration.quiet(level, 300)
        assert {kind_of(seed)[0] for seed in seeds} == {"quiet"}
        assert max(seeds) < 1000


def test_what_is_hidden_is_clear_and_in_robots_a_limit(
    calibration: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drawn(seed: int) -> tuple[Case, None, None]:
        name, signal = (("backlash", 2.0), ("backlash", 0.5), ("speed_gain", 2.0))[seed % 3]
        hidden = (Hidden(name, ""),)
        return Case(seed, "robot", "single", "cascade", "slow", "few", hidden, signal=signal), None, None

    monkeypatch.setattr(calibration.bench, "draw_bench_case", drawn)
    monkeypatch.setattr(calibration.robot, "draw_robot_case", drawn)
    on_bench, on_wheels = calibration.hidden("bench", 5), calibration.hidden("robot", 5)
    assert {calibration.bench.kind_of(seed)[0] for seed in on_bench} == {"single"}
    assert {seed % 3 for seed in on_bench} == {0, 2}
    assert {calibration.robot.kind_of(seed)[0] for seed in on_wheels} == {"single"}
    assert {seed % 3 for seed in on_wheels} == {0}


def test_the_page_quotes_no_comment_on_what_it_measures(calibration: ModuleType) -> None:
    cases = [_robot(calibration, "", ("backlash", 0.5 * LEAST, LEAST))]
    last = list(calibration.page(cases, cases))[-1]
    names = {line.split("`")[1] for line in last.splitlines()[2:]}
    assert names == {field.name for field in fields(Thresholds)} - set(calibration.COMPARED)
