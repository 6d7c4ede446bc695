"""A set of effects as a vector between 0 and 1: round trips, neutral values, joined sets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import paper_model
from sysid.compare.coordinates import Coordinate, coordinate, effect_set, excludes_itself, joined
from sysid.compare.fitted import RefittedLaw

MODEL = paper_model()
COORDINATES = [
    coordinate(MODEL, effect, parameter) for effect in CATALOGUE.values() for parameter in effect.parameters
]


@pytest.mark.parametrize("one", COORDINATES, ids=lambda c: f"{c.effect}.{c.parameter}")
@given(unit=st.floats(0.001, 0.999))
def test_a_place_gives_a_value_and_the_value_the_place(one: Coordinate, unit: float) -> None:
    value = one.value(unit)
    assert one.low <= value <= one.high
    assert one.unit(value) == pytest.approx(unit, abs=1e-9)


@pytest.mark.parametrize("name", [n for n, effect in CATALOGUE.items() if effect.search_from is None])
def test_the_start_of_a_set_changes_nothing(name: str) -> None:
    chosen = effect_set(MODEL, [name])
    values = chosen.model(MODEL, chosen.start()).effects[name]
    assert CATALOGUE[name].is_neutral(values, MODEL)


def test_an_infinite_limit_is_the_end_of_its_scale() -> None:
    one = coordinate(MODEL, CATALOGUE["acceleration_limit"], CATALOGUE["acceleration_limit"].parameters[0])
    assert one.value(1.0) == math.inf
    assert math.isfinite(one.value(0.999))


def test_the_search_starts_at_the_values_of_the_model() -> None:
    late = MODEL.with_effect("command_latency", delay_s=0.04)
    assert effect_set(late, ["command_latency"]).start()[0] > 0.0


def test_joined_sets_have_both_effects_in_the_order_of_the_chain() -> None:
    both = joined(effect_set(MODEL, ["sensor_latency"]), effect_set(MODEL, ["command_latency"]))
    assert both.names == ("command_latency", "sensor_latency")
    assert [c.effect for c in both.coordinates] == ["command_latency", "sensor_latency"]


def test_the_law_fitted_again_starts_from_the_law_and_stays_stable() -> None:
    rival = RefittedLaw(MODEL)
    assert rival.model(MODEL, rival.start()).wheel == MODEL.wheel
    rng = np.random.default_rng(0)
    for _ in range(50):
        law = rival.model(MODEL, rng.uniform(0.0, 1.0, 5)).wheel.law
        assert law.is_stable
        assert law.dc_gain == pytest.approx(MODEL.wheel.law.dc_gain, abs=1e-9)


def test_another_form_of_a_cause_takes_the_place_of_the_one_that_the_model_has():
    base = MODEL.with_effect("sensor_lowpass", time_constant_s=0.05)
    added = effect_set(base, ["sensor_lowpass/window"])
    changed = added.model(base, added.start() + 0.1)
    assert list(changed.effects) == ["sensor_lowpass/window"]
    assert list(added.model(MODEL, added.start() + 0.1).effects) == ["sensor_lowpass/window"]


def test_a_map_is_in_no_set_with_others() -> None:
    assert not excludes_itself(["static_map"], bench=True)
    assert excludes_itself(["command_deadband", "static_map"], bench=True)
