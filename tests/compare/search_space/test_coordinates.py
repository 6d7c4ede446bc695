"""A set of effects as a vector between 0 and 1: round trips, neutral values, joined sets."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE, Effect
from mecanum_env.model import paper_model
from sysid.compare.search_space import (
    Coordinate,
    EffectSet,
    RefittedLaw,
    components,
    coordinate,
    effect_set,
    excludes_itself,
    joined,
)

MODEL = paper_model()
VECTORS = [effect for effect in CATALOGUE.values() if effect.vector is not None]
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


@pytest.mark.parametrize("effect", VECTORS, ids=lambda effect: effect.name)
@given(size=st.floats(0.001, 1.0), angle_deg=st.floats(-179.0, 180.0))
def test_a_size_and_its_angle_are_searched_as_a_vector(effect: Effect, size: float, angle_deg: float) -> None:
    size_name, angle_name = effect.vector or ("", "")
    x, y = components(MODEL, effect)
    size *= x.high
    angle = math.radians(angle_deg)
    place = [one.unit(size * part) for one, part in ((x, math.cos(angle)), (y, math.sin(angle)))]
    values = EffectSet((effect.name,), (x, y)).model(MODEL, place).effects[effect.name]
    assert values[size_name] == pytest.approx(size)
    assert math.remainder(values[angle_name] - angle_deg, 360.0) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("effect", VECTORS, ids=lambda effect: effect.name)
def test_a_vector_that_a_model_has_stays_the_same_to_the_bit(effect: Effect) -> None:
    size_name, angle_name = effect.vector or ("", "")
    given_values = {size_name: 0.0123, angle_name: -200.1}
    base = MODEL.with_effect(effect.name, **given_values)
    chosen = effect_set(base, [effect.name])
    values = chosen.model(base, chosen.start()).effects[effect.name]
    assert {name: values[name] for name in given_values} == given_values


def test_every_direction_belongs_to_a_vector() -> None:
    directions = {e.name for e in CATALOGUE.values() for p in e.parameters if p.name == "heading_deg"}
    assert directions == {effect.name for effect in VECTORS}


def test_a_vector_has_intervals_along_and_across_it() -> None:
    slope = effect_set(MODEL, ["floor_slope"])
    x, y = slope.coordinates
    place = np.array([x.unit(3.0), y.unit(4.0)])
    half = np.full(2, x.unit(0.5) - x.unit(0.0))
    found = slope.intervals(place, place - half, place + half)["floor_slope"]
    assert found["slope_deg"] == pytest.approx((5.0, 4.5, 5.5))
    heading = math.degrees(math.atan2(4.0, 3.0))
    across = math.degrees(math.atan2(0.5, 5.0))
    assert found["heading_deg"] == pytest.approx((heading, heading - across, heading + across))


def test_a_vector_that_may_be_nothing_has_any_angle() -> None:
    slope = effect_set(MODEL, ["floor_slope"])
    place = slope.start()
    found = slope.intervals(place, place - 0.01, place + 0.01)["floor_slope"]
    assert found["slope_deg"][:2] == (0.0, 0.0)
    assert found["heading_deg"] == (0.0, -180.0, 180.0)


def test_an_infinite_limit_is_the_end_of_its_scale() -> None:
    one = coordinate(MODEL, CATALOGUE["acceleration_limit"], CATALOGUE["acceleration_limit"].parameters[0])
    assert one.value(1.0) == math.inf
    assert math.isfinite(one.value(0.999))


def test_the_search_starts_at_the_values_of_the_model() -> None:
    late = MODEL.with_effect("command_latency", delay_s=0.04)
    assert effect_set(late, ["command_latency"]).start()[0] > 0.0


def test_a_time_constant_says_that_an_effect_acts_only_where_the_model_has_it() -> None:
    warm = effect_set(paper_model(), ["warm_up"])
    assert [c.parameter for c in warm.coordinates] == ["share", "time_constant_s"]
    assert warm.decisive(paper_model()) == (True, False)
    known = paper_model().with_effect("warm_up", share=0.1, time_constant_s=20.0)
    assert effect_set(known, ["warm_up"]).decisive(known) == (True, True)


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


def test_an_interval_may_reach_beyond_the_bounds_of_the_search_as_far_as_can_be_simulated() -> None:
    limit = Coordinate("acceleration_limit", "limit_rpm_s", 200.0, 400.0, math.inf)
    assert limit.beyond(-0.1) == pytest.approx(180.0)
    assert limit.beyond(1.2) == math.inf
    delay = Coordinate("command_latency", "delay_s", 0.0, 0.5, 0.0)
    assert delay.beyond(-0.3) == 0.0
