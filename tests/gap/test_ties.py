"""Which sets are told beside the chosen one."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from sysid.gap.search import ties
from sysid.gap.search.chance import Floor
from sysid.gap.search.scores import ScoredSet

from .conftest import a_set

FLOOR = Floor(1e4, trusted=True)
SEARCH: Any = SimpleNamespace(problem=None, base=None, told_before=frozenset())


@pytest.mark.parametrize(("score", "told"), [(-200.0, True), (-80.0, False), (-51.0, False)])
def test_a_curve_is_told_last_where_it_does_far_better_than_every_cause(
    monkeypatch: pytest.MonkeyPatch, score: float, told: bool
) -> None:
    """A curve of five numbers stands for what no cause does; effects that do nearly as well come first."""
    for name, answer in (("_as_good", True), ("rises", False), ("doubtful", False), ("_repeats", False)):
        monkeypatch.setattr(ties, name, lambda *_, answer=answer: answer)
    curve, pair = a_set(score, "static_map"), a_set(-50.0, "coulomb_friction", "speed_gain")
    found = ties.with_causes(SEARCH, FLOOR, [curve], [curve, pair], 1.0)
    assert [one.names for one in found] == [pair.names, *([curve.names] if told else [])]


def test_a_simpler_cause_comes_before_a_richer_one_that_fits_no_better_than_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Beside a curve that does best, it may have been just too far from that."""

    def fitted(score: float, cost: float, count: int, name: str) -> ScoredSet:
        one = a_set(score, name)
        known: Any = SimpleNamespace(
            names=one.names, cost=cost, candidate=SimpleNamespace(parameter_count=count)
        )
        return replace(one, fitted=known)

    curve = fitted(-200.0, -210.0, 5, "static_map")
    cold = fitted(-160.0, -170.0, 3, "warm_up/cold_friction")
    friction = fitted(-155.0, -174.0, 1, "coulomb_friction")
    gain = fitted(-90.0, -90.0, 1, "speed_gain")
    for name in ("rises", "doubtful", "_repeats"):
        monkeypatch.setattr(ties, name, lambda *_: False)
    monkeypatch.setattr(ties, "_as_good", lambda _s, _f, best, one, *_: one.score <= best.score + 9.0)
    found = ties.with_causes(SEARCH, FLOOR, [curve, cold], [curve, cold, friction, gain], 1.0)
    assert [one.names[0] for one in found] == ["coulomb_friction", "warm_up/cold_friction", "static_map"]


def test_where_no_causes_do_as_well_as_a_curve_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ties, "_as_good", lambda *_: False)
    curve = a_set(-200.0, "static_map")
    assert ties.with_causes(SEARCH, FLOOR, [curve], [curve], 1.0) == ()
