"""A limit beside a load may be its consequence: the load alone is reported, too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import EFFECT_PARAMETERS, Model, paper_model
from sysid.gap.search.consequences import without_consequences
from sysid.gap.search.scores import ScoredSet

BASE = paper_model().with_effect("acceleration_limit", "drive", limit_rpm_s=800.0)
BASE_COST = 1000.0


def a_set(cost: float, *names: str, **values: float) -> ScoredSet:
    """Return a set with a cost, whose model has limits of these values."""

    def model(base: Model, _place: object) -> Model:
        for name in names:
            own = {key: value for key, value in values.items() if key in EFFECT_PARAMETERS[name]}
            base = base.with_effect(*name.split("/"), **own) if own else base
        return base

    candidate = SimpleNamespace(model=model)
    fitted: Any = SimpleNamespace(names=names, cost=cost, place=np.zeros(0), candidate=candidate)
    return ScoredSet(fitted, np.array([cost]))


ALONE = a_set(300.0, "coulomb_friction")


def test_friction_is_reported_without_the_ceiling_that_it_lowers() -> None:
    pair = a_set(100.0, "speed_saturation", "coulomb_friction", limit_rpm=90.0)
    found, notes = without_consequences(BASE, BASE_COST, (pair,), (pair, ALONE))
    assert found == (pair, ALONE)
    (note,) = notes
    assert "speed_saturation may be a consequence of coulomb_friction" in note


@pytest.mark.parametrize(
    "pair",
    [
        pytest.param(a_set(100.0, "command_latency", "coulomb_friction", delay_s=0.1), id="no limit"),
        pytest.param(
            a_set(100.0, "acceleration_limit/drive", "coulomb_friction", limit_rpm_s=900.0), id="raised"
        ),
    ],
)
def test_what_no_load_does_stays(pair: ScoredSet) -> None:
    assert without_consequences(BASE, BASE_COST, (pair,), (pair, ALONE)) == ((pair,), ())


def test_a_limit_that_explains_most_is_no_consequence() -> None:
    pair = a_set(100.0, "speed_saturation", "coulomb_friction", limit_rpm=90.0)
    little = a_set(700.0, "coulomb_friction")
    assert without_consequences(BASE, BASE_COST, (pair,), (pair, little)) == ((pair,), ())


LIMITS = ("speed_saturation", "acceleration_limit/drive")
BOTH = a_set(120.0, *LIMITS, limit_rpm=90.0, limit_rpm_s=500.0)


def test_a_load_that_two_lower_limits_stand_for_is_reported_without_them() -> None:
    all_three = a_set(100.0, *LIMITS, "coulomb_friction", limit_rpm=90.0, limit_rpm_s=500.0)
    found, notes = without_consequences(BASE, BASE_COST, (BOTH,), (BOTH, all_three, ALONE))
    assert found == (BOTH, ALONE)
    assert "speed_saturation + acceleration_limit/drive may be a consequence of coulomb_friction" in notes[0]


@pytest.mark.parametrize("cost", [115.0, 120.0])
def test_a_load_that_two_lower_limits_do_not_need_is_not_reported(cost: float) -> None:
    all_three = a_set(cost, *LIMITS, "coulomb_friction", limit_rpm=90.0, limit_rpm_s=500.0)
    assert without_consequences(BASE, BASE_COST, (BOTH,), (BOTH, all_three, ALONE)) == ((BOTH,), ())


def test_one_lower_limit_is_no_sign_of_a_load() -> None:
    ceiling = a_set(120.0, "speed_saturation", limit_rpm=90.0)
    pair = a_set(100.0, "speed_saturation", "coulomb_friction", limit_rpm=90.0)
    assert without_consequences(BASE, BASE_COST, (ceiling,), (ceiling, pair, ALONE)) == ((ceiling,), ())
