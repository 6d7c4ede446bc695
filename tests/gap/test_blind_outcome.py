"""When a report counts as saying that logs could not show what was hidden in them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from mecanum_env.model import paper_model
from sysid.studies.blind.cases import Case
from sysid.studies.blind.outcome import outcome_of


def said(effect: str, parameter: str, true: float, seen: float | None, *, untestable: bool = False) -> bool:
    """Return what an outcome makes of a report that sees a parameter from `seen` on."""
    case = Case("c", "bench", "untestable", "clear", "p", (effect,), {effect: {parameter: true}})
    report: Any = SimpleNamespace(
        verdict="no_gap",
        effects=(),
        candidates=(),
        gap=SimpleNamespace(before=1.0, after=1.0, noise_floor=1.0),
        untestable=[SimpleNamespace(name=effect)] if untestable else [],
        smallest_detectable={} if seen is None else {effect: {parameter: seen}},
        base=paper_model(),
    )
    return outcome_of(case, report, 0.0).said_untestable


def test_an_effect_called_untestable_was_said_to_be() -> None:
    assert said("direction_asymmetry", "reverse_ratio", 0.8, None, untestable=True)
    assert not said("direction_asymmetry", "reverse_ratio", 0.8, None)


@pytest.mark.parametrize(
    ("effect", "parameter", "true", "seen", "expected"),
    [
        ("speed_saturation", "limit_rpm", 90.0, 69.0, True),  # neutral is the paper's ceiling, above
        ("speed_saturation", "limit_rpm", 60.0, 69.0, False),
        ("command_deadband", "threshold_rpm", 12.0, 30.0, True),  # neutral is 0
        ("command_deadband", "threshold_rpm", 12.0, 5.0, False),
    ],
)
def test_a_size_below_the_smallest_detectable_one_was_said_to_be_out_of_sight(
    effect: str, parameter: str, true: float, seen: float, expected: bool
) -> None:
    assert said(effect, parameter, true, seen) is expected
