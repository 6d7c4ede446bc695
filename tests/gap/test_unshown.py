"""What is claimed of each effect of a set must hold by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from mecanum_env.model import Model
from sysid.gap import unshown
from sysid.gap.result import Difference, FoundEffect, GapOptions, GapReport, Interval
from sysid.gap.unshown import with_unshown
from sysid.gap.workflow import analyse
from tests.gap.conftest import MakeLogs

BEST = ("coulomb_friction", "direction_asymmetry")


def friction(low: float) -> FoundEffect:
    """Return a friction of at least `low` [N m] whose time of answer may be any."""
    times = {"answer_s": Interval(0.02, 0.0, 0.1), "washout_s": Interval(0.3, 0.1, 2.0)}
    return FoundEffect("coulomb_friction/washed_out", {"torque_n_m": Interval(0.3, low, 0.5), **times}, 1.0)


def asymmetry(low: float) -> FoundEffect:
    """Return an asymmetry whose ratio is at least `low`."""
    return FoundEffect("direction_asymmetry", {"reverse_ratio": Interval(1.13, low, 1.28)}, 1.0)


@pytest.fixture(scope="module")
def named(base: Model, bench_logs: MakeLogs) -> GapReport:
    """Return a study that names two effects, which both have a size."""
    report = analyse(bench_logs(base.with_effect("speed_gain", gain=0.95)), base)
    effects = (friction(0.1), asymmetry(1.02))
    gap = Difference("rpm", before=20.0, after=3.0, noise_floor=1.0)
    return replace(report, verdict="named", effects=effects, candidates=(BEST,), notes=(), gap=gap)


def test_an_effect_whose_size_may_be_none_is_not_claimed(named: GapReport) -> None:
    found = with_unshown(replace(named, effects=(friction(0.1), asymmetry(0.97))))
    assert found.verdict == "ambiguous"
    assert found.candidates == (BEST, ("coulomb_friction",))
    (note,) = found.notes
    assert note.startswith("direction_asymmetry (reverse_ratio 0.97 .. 1.28)")
    assert found.effects == (friction(0.1), asymmetry(0.97))


def test_a_time_that_may_be_any_is_no_objection_and_a_torque_that_may_be_none_is(named: GapReport) -> None:
    assert with_unshown(named) == named
    found = with_unshown(replace(named, effects=(friction(0.0), asymmetry(1.02))))
    assert found.candidates == (BEST, ("direction_asymmetry",))


def test_no_limit_is_an_infinite_one(named: GapReport) -> None:
    limit = {"limit_rpm": Interval(130.0, 110.0, float("inf"))}
    ceiling = FoundEffect("speed_saturation", limit, 1.0)
    causes = ("coulomb_friction", "speed_saturation")
    report = replace(named, effects=(friction(0.1), ceiling), candidates=(causes,))
    assert with_unshown(report).candidates == (causes, ("coulomb_friction",))


@pytest.mark.parametrize(
    "change",
    [
        {"verdict": "unexplained", "candidates": ()},
        {"effects": (friction(0.0), asymmetry(0.97))},
        {"candidates": (("coulomb_friction",),)},
        {"effects": (friction(0.1), asymmetry(1.02)), "candidates": (BEST, ("sensor_scale",))},
        {"gap": Difference("rpm", before=20.0, after=1.1, noise_floor=1.0)},
    ],
    ids=["nothing named", "nothing else to explain it", "there before", "all have a size", "noise is left"],
)
def test_what_stays_as_it_is(named: GapReport, change: dict[str, Any]) -> None:
    report = replace(named, **{"effects": (friction(0.1), asymmetry(0.97)), **change})
    assert with_unshown(report) == report


def test_a_study_asks_for_the_size_of_each_effect(
    base: Model, bench_logs: MakeLogs, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Without the exemption of a set that leaves noise, a small asymmetry beside a ramp is not claimed."""
    monkeypatch.setattr(unshown, "_NOISE", 0.0)
    hidden = base.with_effect("acceleration_limit", limit_rpm_s=600.0).with_effect(
        "direction_asymmetry", reverse_ratio=0.93
    )
    report = analyse(bench_logs(hidden), base, GapOptions(next_experiment=False))
    assert report.verdict == "ambiguous"
    assert ("acceleration_limit",) in report.candidates
    assert any("direction_asymmetry (reverse_ratio" in note for note in report.notes)
