"""Each rule of the decision, and which of them decides where nothing says how far a model may be off."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.model_error import ModelError
from sysid.compare.model_error.size import ChannelError, with_model_error
from sysid.gap.result import GapOptions, Verdict
from sysid.gap.search.chance import Floor
from sysid.gap.search.rules import Facts, apply_rules
from sysid.gap.workflow import analyse

from .conftest import MakeLogs, a_set

UNKNOWN = Floor(1e4, trusted=False)
COMPARED = Floor(1e4, trusted=True, compared=True)
FAMILIAR = Floor(1e4, trusted=True, compared=True, familiar=True)
CALIBRATED = Floor(1e4, trusted=True, compared=True, familiar=True, calibrated=True)
BESIDE = Floor(1e4, trusted=True, compared=True, knows_all=True)
RANDOM = Floor(1e4, trusted=True, repeatable=False)
CHOSEN = a_set(-50.0, "backlash")
CURVE = a_set(-50.0, "static_map")
TWO = a_set(-50.0, "backlash", "stiction")
RIPPLE = a_set(-50.0, "torque_ripple")
WORSE = a_set(-20.0, "free_term")
NAMED = Facts(
    floor=Floor(1e4, trusted=True),
    p_value=1e-3,
    p_misfit=1e-3,
    noise_ratio=9.0,
    is_plain=True,
    inflation=1.0,
    judged=(CHOSEN,),
    chosen=CHOSEN,
    tied=(CHOSEN,),
    adequate=True,
    removed=0.9,
)


@pytest.mark.parametrize(
    ("changes", "verdict", "reason"),
    [
        ({}, "named", ""),
        ({"tied": (CHOSEN, a_set(-49.0, "stiction"))}, "ambiguous", ""),
        ({"p_value": 0.5}, "no_gap", ""),
        ({"p_value": 0.5, "floor": UNKNOWN, "removed": 0.0}, "unexplained", "times the noise"),
        ({"p_value": 0.5, "floor": UNKNOWN, "noise_ratio": 2.0}, "no_gap", ""),
        ({"chosen": None, "adequate": False, "removed": 0.0}, "unexplained", ""),
        ({"removed": 0.05}, "no_gap", "removes only 5%"),
        ({"removed": 0.05, "floor": UNKNOWN}, "unexplained", "times the noise"),
        ({"removed": 0.05, "floor": UNKNOWN, "noise_ratio": 2.0}, "no_gap", "removes only 5%"),
        ({"removed": 0.05, "floor": COMPARED}, "no_gap", "removes only 5%"),
        ({"removed": 0.05, "floor": FAMILIAR}, "named", ""),
        ({"removed": 0.05, "floor": FAMILIAR, "is_plain": False}, "no_gap", "removes only 5%"),
        ({"removed": 0.5, "floor": UNKNOWN}, "named", ""),
        (
            {"removed": 0.4, "floor": replace(UNKNOWN, lasting=True)},
            "unexplained",
            "removes 50% of its square",
        ),
        ({"removed": 0.5, "floor": replace(UNKNOWN, lasting=True)}, "named", ""),
        ({"removed": 0.4, "floor": replace(COMPARED, lasting=True)}, "named", ""),
        ({"raises_rms": True}, "unexplained", "raises the plain difference"),
        ({"raises_rms": True, "floor": BESIDE}, "unexplained", "in a command sequence"),
        ({"raises_rms": True, "floor": BESIDE, "p_misfit": 0.5}, "no_gap", "in a command sequence"),
        (
            {"raises_rms": True, "floor": BESIDE, "p_misfit": 0.5, "is_clear": True},
            "unexplained",
            "in a command sequence",
        ),
        ({"of_one_sequence": True, "floor": BESIDE, "p_misfit": 0.5}, "no_gap", "one command sequence shows"),
        ({"of_one_sequence": True, "floor": BESIDE}, "unexplained", "one command sequence shows"),
        ({"adequate": False, "floor": BESIDE}, "unexplained", ""),
        ({"adequate": False, "floor": BESIDE, "p_misfit": 0.5}, "no_gap", "sequences of the fit differ"),
        ({"adequate": False, "floor": BESIDE, "p_misfit": 0.5, "is_clear": True}, "unexplained", ""),
        ({"floor": BESIDE, "gain": 0.04, "is_plain": False}, "no_gap", "by 4% only"),
        ({"floor": BESIDE, "gain": 0.05, "is_plain": False}, "named", ""),
        ({"floor": BESIDE, "gain": 0.01, "is_plain": False, "systematic": True}, "named", ""),
        ({"floor": BESIDE, "gain": 0.04}, "named", ""),
        ({"floor": replace(BESIDE, familiar=True), "gain": 0.04, "is_plain": False}, "named", ""),
        ({"floor": COMPARED, "gain": 0.04, "is_plain": False}, "no_gap", "by 4% only"),
        ({"floor": COMPARED, "gain": 0.04, "is_plain": False, "adequate": False}, "no_gap", "by 4% only"),
        ({"floor": COMPARED, "chosen": None, "is_plain": False, "adequate": False}, "no_gap", "own error"),
        ({"floor": COMPARED, "gain": 0.04}, "named", ""),
        ({"floor": COMPARED, "gain": 0.26, "is_plain": False}, "named", ""),
        ({"floor": COMPARED, "gain": 0.12, "is_plain": False}, "no_gap", "by 12% only"),
        ({"floor": COMPARED, "fall": 0.24, "is_plain": False}, "no_gap", "only 24% of what"),
        ({"floor": COMPARED, "fall": 0.26, "is_plain": False}, "named", ""),
        ({"floor": COMPARED, "fall": 0.24}, "named", ""),
        ({"floor": COMPARED, "fall": 0.49, "is_plain": False, "chosen": TWO}, "no_gap", "only 49% of what"),
        ({"floor": COMPARED, "fall": 0.51, "is_plain": False, "chosen": TWO}, "named", ""),
        ({"floor": FAMILIAR, "fall": 0.24, "is_plain": False}, "named", ""),
        ({"floor": BESIDE, "fall": 0.24, "is_plain": False}, "named", ""),
        ({"fall": 0.24, "is_plain": False}, "named", ""),
        ({"floor": FAMILIAR, "gain": 0.12, "is_plain": False}, "named", ""),
        ({"floor": FAMILIAR, "gain": 0.09, "is_plain": False}, "no_gap", "by 9% only"),
        ({"floor": FAMILIAR, "gain": 0.12, "is_plain": False, "chosen": TWO}, "no_gap", "by 12% only"),
        ({"floor": FAMILIAR, "gain": 0.22, "is_plain": False, "chosen": TWO}, "named", ""),
        ({"floor": FAMILIAR, "gain": 0.45, "is_plain": False, "chosen": CURVE}, "no_gap", "by 45% only"),
        ({"floor": FAMILIAR, "gain": 0.55, "is_plain": False, "chosen": CURVE}, "named", ""),
        ({"floor": CALIBRATED, "gain": 0.04, "is_plain": False}, "named", ""),
        ({"floor": CALIBRATED, "gain": 0.04, "is_plain": False, "removed": 0.0}, "named", ""),
        ({"floor": CALIBRATED, "p_value": 0.5, "gain": 0.04, "is_plain": False}, "no_gap", ""),
        ({"gain": 0.04, "is_plain": False}, "named", ""),
        ({"floor": RANDOM, "removed_of_all": 0.4}, "unexplained", "repeats of one command differ"),
        ({"floor": RANDOM, "removed_of_all": 0.4, "chosen": RIPPLE, "tied": (RIPPLE,)}, "named", "repeats"),
        ({"floor": RANDOM, "removed_of_all": 0.6}, "named", "repeats of one command differ"),
        ({"law": a_set(-60.0, "wheel_law")}, "unexplained", "the wheel law fitted again"),
        ({"law": a_set(-55.0, "wheel_law")}, "named", ""),
        ({"law": a_set(-60.0, "wheel_law"), "law_allowed": 12.0}, "named", ""),
        (
            {"free": a_set(-80.0, "free_term"), "allowed": 20.0, "removed": 0.4},
            "unexplained",
            "a smooth function",
        ),
        (
            {"free": a_set(-80.0, "free_term"), "allowed": 20.0, "removed": 0.4, "p_misfit": 0.5},
            "no_gap",
            "a smooth function of command, speed and time predicts",
        ),
        ({"free": a_set(-80.0, "free_term"), "allowed": 20.0, "removed": 0.6}, "named", "not only that"),
        ({"free": a_set(-65.0, "free_term"), "allowed": 20.0}, "named", ""),
        ({"adequate": False}, "unexplained", ""),
        ({"adequate": False, "free": WORSE}, "named", "removes 90% of the squared difference"),
        ({"adequate": False, "free": WORSE, "law": WORSE}, "named", "more than chance allows"),
        (
            {"adequate": False, "free": WORSE, "law": a_set(-55.0, "wheel_law")},
            "named",
            "more than chance allows",
        ),
        ({"adequate": False, "free": WORSE, "law": a_set(-60.0, "wheel_law")}, "unexplained", "fitted again"),
        ({"adequate": False, "free": a_set(-45.0, "free_term")}, "unexplained", ""),
        ({"adequate": False, "free": WORSE, "removed": 0.79}, "unexplained", ""),
        ({"adequate": False, "free": WORSE, "removed": 0.81}, "named", "removes 81%"),
        ({"adequate": False, "free": WORSE, "removed": 0.81, "chosen": TWO}, "unexplained", ""),
        ({"adequate": False, "free": WORSE, "chosen": CURVE}, "unexplained", ""),
        ({"doubtful": ("backlash",)}, "unexplained", "backlash: the runs disagree"),
        ({"doubtful": ("backlash",), "p_misfit": 0.5}, "no_gap", "backlash: the runs disagree"),
        ({"doubtful": ("backlash",), "p_misfit": 0.5, "is_clear": True}, "unexplained", "the runs disagree"),
    ],
)
def test_the_first_rule_that_applies_decides(changes: dict[str, Any], verdict: Verdict, reason: str) -> None:
    outcome = apply_rules(replace(NAMED, **changes))
    assert outcome.verdict == verdict
    assert len(outcome.reasons) == bool(reason)
    assert reason in "".join(outcome.reasons)


def test_that_the_law_fits_better_is_said_beside_another_reason() -> None:
    facts = replace(NAMED, raises_rms=True, law=a_set(-60.0, "wheel_law"))
    harm, law = apply_rules(facts).reasons
    assert "raises the plain difference" in harm
    assert "the wheel law fitted again" in law


def test_an_error_far_above_the_noise_is_unexplained_in_logs_that_the_model_was_fitted_to(
    bench_logs: MakeLogs, base: Model
) -> None:
    """Its own error is measured on these very logs: it cannot excuse what it was measured from."""
    logs = bench_logs(base, repeats=1)
    fitted = with_model_error(base, ModelError({"speed_rpm": ChannelError(2.0, 0.01, 0.05)}, logs.sha256))
    options = GapOptions(next_experiment=False)
    assert analyse(logs, fitted, options).verdict == "no_gap"
    for run in logs.runs:
        run.channels["speed_rpm"][:] += 3.0 * np.sin(25.0 * run.time_s)
    report = analyse(logs, fitted, options)
    assert report.verdict == "unexplained"
    assert report.effects == ()
    assert any("times the noise" in note for note in report.notes)
