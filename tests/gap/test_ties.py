"""Which sets are told beside the chosen one."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from sysid.gap.search import ties
from sysid.gap.search.chance import Floor

from .conftest import a_set

FLOOR = Floor(1e4, trusted=True)
SEARCH: Any = SimpleNamespace(problem=None, base=None)


@pytest.mark.parametrize(("score", "told"), [(-200.0, True), (-51.0, False)])
def test_a_curve_is_told_last_where_it_does_better_than_every_cause(
    monkeypatch: pytest.MonkeyPatch, score: float, told: bool
) -> None:
    """A curve of five numbers stands for what no cause does; effects that do nearly as well come first."""
    for name, answer in (("_as_good", True), ("rises", False), ("doubtful", False), ("_repeats", False)):
        monkeypatch.setattr(ties, name, lambda *_, answer=answer: answer)
    curve, pair = a_set(score, "static_map"), a_set(-50.0, "coulomb_friction", "speed_gain")
    found = ties.with_causes(SEARCH, FLOOR, [curve], [curve, pair], 1.0)
    assert [one.names for one in found] == [pair.names, *([curve.names] if told else [])]


def test_where_no_causes_do_as_well_as_a_curve_there_are_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ties, "_as_good", lambda *_: False)
    curve = a_set(-200.0, "static_map")
    assert ties.with_causes(SEARCH, FLOOR, [curve], [curve], 1.0) == ()
