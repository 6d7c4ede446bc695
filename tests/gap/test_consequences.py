"""A limit beside a load may be its consequence: the load alone is reported, too."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from sysid.gap.search.consequences import without_consequences
from sysid.gap.search.scores import ScoredSet

BASE = paper_model().with_effect("acceleration_limit", "drive", limit_rpm_s=800.0)
BASE_COST = 1000.0


def a_set(cost: float, *names: str, **values: float) -> ScoredSet:
    """Return a set with a cost, whose model has a limit of these values."""

    def model(base: Model, _place: object) -> Model:
        return base if not values else base.with_effect(names[0], **values)

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
