"""What a right effect leaves beside the best single effect and the best set."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest

from sysid.gap.search.thresholds import THRESHOLDS


@pytest.fixture(scope="module")
def formulas(benchmark_of: Callable[[str], ModuleType]) -> ModuleType:
    return benchmark_of("robot_formulas")


def test_what_the_hidden_effect_leaves_is_relative_to_what_the_better_one_explains(
    formulas: ModuleType,
) -> None:
    costs = {("backlash/rest",): 300.0, ("backlash",): 400.0, ("stiction",): 200.0, ("a", "b"): 100.0}
    single, best = formulas.left("backlash", 1000.0, costs)
    assert single == pytest.approx(math.sqrt(100.0 / 800.0))
    assert best == pytest.approx(math.sqrt(200.0 / 900.0))
    assert formulas.left("stiction", 1000.0, {("stiction",): 200.0}) == (0.0, 0.0)


def test_an_effect_that_was_not_fitted_leaves_nothing_that_is_known(formulas: ModuleType) -> None:
    assert all(map(math.isnan, formulas.left("backlash", 1000.0, {})))
    assert all(map(math.isnan, formulas.left("backlash", 1000.0, {("stiction",): 200.0})))


def test_a_case_is_kept_also_where_its_effect_was_not_fitted(
    formulas: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    made = formulas.Left(64, "backlash", 2.0, math.nan, math.nan)
    monkeypatch.setattr(formulas, "_measured", lambda *_: made)
    first = formulas._kept(64, tmp_path)
    monkeypatch.setattr(formulas, "_measured", None)
    again = formulas._kept(64, tmp_path)
    assert (first.seed, first.hidden) == (again.seed, again.hidden) == (64, "backlash")
    assert math.isnan(again.beside_single)


def test_the_page_counts_what_the_thresholds_cover(formulas: ModuleType) -> None:
    near, far = THRESHOLDS.robot_formula - 0.01, THRESHOLDS.crude_robot_formula + 0.01
    rows = [
        formulas.Left(64, "a", 2.0, near, far),
        formulas.Left(65, "b", 3.0, 0.0, 0.0),
        formulas.Left(66, "c", 1.0, math.nan, math.nan),
    ]
    text = "\n".join(formulas.page(rows))
    assert "| `robot_formula` | 0.35 | 2 of 2 |" in text
    assert "| `crude_robot_formula` | 0.6 | 1 of 2 |" in text
    assert "| 66 | c | 1 | not fitted | not fitted |" in text


def test_the_robots_are_the_first_from_a_seed_on_that_hide_one_clear_effect(
    formulas: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {70: "quiet", 71: "single", 72: "pair", 73: "single", 74: "single", 75: "single"}
    signals = {71: 0.5, 73: 2.0, 74: 9.0, 75: 3.0}
    monkeypatch.setattr(formulas, "kind_of", lambda seed: (kinds[seed], 0))
    monkeypatch.setattr(
        formulas, "draw_robot_case", lambda seed: (SimpleNamespace(signal=signals[seed]), None)
    )
    assert formulas.seeds(2, 70) == [73, 74]
