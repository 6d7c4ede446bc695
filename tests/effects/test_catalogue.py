"""The definitions of the catalogue, and what holds for every effect."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE, PLANTS, apply, catalogue_table
from mecanum_env.effects.apply import active_effects, changed_model
from mecanum_env.errors import InputError
from mecanum_env.mjcf import robot_spec
from mecanum_env.model import (
    EFFECT_PARAMETERS,
    cause_of,
    model_from_dict,
    model_to_dict,
    paper_model,
    read_model,
    write_model,
)

from .conftest import acting, channels, clear_model, clear_value

ROOT = Path(__file__).parents[2]
CHAIN = """command_latency command_latency/jitter command_loss body_speed_limit body_acceleration_limit
command_deadband command_deadband/subtract speed_gain wheel_gain_mismatch direction_asymmetry
battery_sag battery_sag/voltage warm_up warm_up/friction warm_up/cold static_map
speed_saturation speed_saturation/supply
acceleration_limit acceleration_limit/drive acceleration_limit/s_curve load_inertia load_inertia/integral
weak_servo backlash backlash/rest backlash/spring coulomb_friction coulomb_friction/washed_out
stiction stiction/washed_out viscous_friction viscous_friction/washed_out warm_up/cold_friction
torque_ripple torque_ripple/washed_out
roller_friction low_grip payload com_offset wheel_radius track_width floor_slope
mount_yaw mount_yaw/body mount_yaw/pose encoder_eccentricity
sensor_latency sensor_latency/wheels sensor_latency/body sensor_latency/pose
sensor_lowpass sensor_lowpass/window sensor_scale sensor_bias sensor_bias/drift"""
CHECKED_ALONE = [effect for effect in CATALOGUE.values() if effect.name != "static_map"]
"""Effects with parameters that each act; those of a static map form one curve (test_static_map)."""
ALL = [(name, p) for name, effect in CATALOGUE.items() for p in effect.parameters]


def neutral_model(base, name):
    values = {p.name: p.neutral_in(base) for p in CATALOGUE[name].parameters}
    return base.with_effect(name, **values)


def test_the_chain_is_in_the_order_of_the_contract():
    assert list(CATALOGUE) == CHAIN.split()


def test_the_documentation_holds_the_catalogue():
    assert catalogue_table() in (ROOT / "docs" / "effects.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("name", "parameter"), ALL)
def test_parameters_are_consistent(base, name, parameter):
    low, high = parameter.bounds
    assert parameter.valid[0] <= low < high <= parameter.valid[1]
    neutral = parameter.neutral_in(base)
    assert parameter.valid[0] <= neutral <= parameter.valid[1]
    # The search range contains the neutral value, unless that is "no limit", or 0 for "as something else".
    as_another = parameter.neutral is None and neutral == 0.0
    assert low <= neutral <= high or neutral == np.inf or as_another
    assert all(low <= value <= high for value in parameter.scan or ())
    assert parameter.name in EFFECT_PARAMETERS[name]


@pytest.mark.parametrize("name", CATALOGUE)
def test_neutral_is_bit_for_bit_nothing(base, plain, name):
    model = neutral_model(base, name)
    assert list(active_effects(model)) == []
    for plant in ("bench", "planar"):
        np.testing.assert_array_equal(channels(model, plant), plain(plant))
    assert robot_spec(model).to_xml() == robot_spec(base).to_xml()


def test_all_neutral_together_are_nothing_on_the_rollers(base, plain):
    model = base
    for name in CATALOGUE:
        model = neutral_model(model, name)
    np.testing.assert_array_equal(channels(model, "rollers"), plain("rollers"))


@pytest.mark.parametrize(
    ("plant", "name", "parameter"),
    [
        (plant, effect.name, p)
        for plant in PLANTS
        for effect in acting(plant)
        if effect in CHECKED_ALONE
        for p in effect.parameters
        if p.neutral is not None
    ],
)
def test_near_neutral_is_nearly_nothing(base, plain, plant, name, parameter):
    neutral = parameter.neutral_in(base)
    near = (
        1e15 if neutral == np.inf else neutral + 1e-7 * np.sign(clear_value(name, parameter.name) - neutral)
    )
    # Integral action by itself changes how a robot's inertia is answered, unless it is slow.
    slow = {"washout_s": 1e6} if "washout_s" in EFFECT_PARAMETERS[name] else {}
    model = base.with_effect(name, **{parameter.name: float(near)}, **slow)
    assert list(active_effects(model)) != []
    np.testing.assert_allclose(channels(model, plant), plain(plant), atol=0.02)


@pytest.mark.parametrize(
    ("plant", "name", "parameter"),
    [
        (plant, effect.name, p.name)
        for plant in PLANTS
        for effect in acting(plant)
        if effect in CHECKED_ALONE
        for p in effect.parameters
    ],
)
def test_each_parameter_moves_the_prediction(base, plain, plant, name, parameter):
    moved = channels(clear_model(name, parameter), plant)
    model = clear_model(name, parameter)
    effects = {n: dict(values) for n, values in model.effects.items()}
    del effects[name][parameter]
    left = {n: values for n, values in effects.items() if values}
    without = channels(replace(base, effects=left), plant) if left else plain(plant)
    seen = np.max(np.abs(moved - without))
    # A bench shows one wheel, and the planar plant has no height.
    hidden = (plant == "bench" and (name, parameter) in BENCH_DOES_NOT_SHOW) or (
        plant == "planar" and parameter == "height_m"
    )
    assert (seen < 1e-9) if hidden else (seen > 0.01)


BENCH_DOES_NOT_SHOW = {
    ("weak_servo", "servo_n_m_s_rad"),  # nothing loads the free wheel
    *(("wheel_gain_mismatch", f"gain_{wheel}") for wheel in ("fr", "rl", "rr")),
    ("sensor_scale", "linear"),
    ("sensor_scale", "yaw"),
}


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("name", CATALOGUE)
def test_a_plant_refuses_an_effect_that_does_not_act_there_or_has_nothing_for_it(plain, plant, name):
    effect, model = CATALOGUE[name], clear_model(name)
    if effect.acts_in(plant):
        # That it shows is for test_each_parameter_moves_the_prediction, but for a curve as a whole.
        assert effect in CHECKED_ALONE or not np.array_equal(channels(model, plant), plain(plant))
    elif effect.simulated and plant in effect.absent_from:
        np.testing.assert_array_equal(channels(model, plant), plain(plant))
    else:
        with pytest.raises(InputError, match=rf"effects\.{name}: "):
            channels(model, plant)


@pytest.mark.parametrize(
    ("name", "parameter", "value"),
    [
        ("payload", "mass_kg", -1.0),
        ("coulomb_friction", "torque_n_m", -0.1),
        ("low_grip", "friction", 0.0),
        ("wheel_radius", "scale", -1.0),
        ("payload", "mass_kg", np.inf),
    ],
)
def test_an_impossible_value_is_refused_by_name(base, name, parameter, value):
    with pytest.raises(InputError, match=re.escape(f"effects.{name}.{parameter} = {value:g}, must be")):
        robot_spec(base.with_effect(name, **{parameter: value}))


def test_an_effect_that_nothing_simulates_is_refused(base, monkeypatch):
    nowhere = replace(CATALOGUE["backlash"], change_drive=None)
    monkeypatch.setattr(apply, "CATALOGUE", {**CATALOGUE, "backlash": nowhere})
    with pytest.raises(InputError, match=r"effects\.backlash: not simulated yet \(simulated: command"):
        robot_spec(base.with_effect("backlash", gap_deg=2.0))


def test_a_model_with_every_effect_survives_its_file(base, tmp_path):
    model = base
    for name, effect in CATALOGUE.items():
        # This replaces other forms of the same cause.
        model = model.with_effect(name, **{p.name: clear_value(name, p.name) for p in effect.parameters})
        assert model_from_dict(model_to_dict(model)) == model
    write_model(model, tmp_path / "model.json")
    assert read_model(tmp_path / "model.json") == model


@pytest.mark.parametrize("plant", ["bench", "planar"])
@settings(max_examples=25)
@given(names=st.data())
def test_pairs_compose_and_their_order_in_the_file_does_not_matter(plain, plant, names):
    possible = [effect.name for effect in acting(plant)]
    # A model has one form of a cause.
    one, two = names.draw(st.lists(st.sampled_from(possible), min_size=2, max_size=2, unique_by=cause_of))
    values = {name: dict(clear_model(name).effects[name]) for name in (one, two)}
    base = paper_model()
    both = channels(replace(base, effects={one: values[one], two: values[two]}), plant)
    swapped = channels(replace(base, effects={two: values[two], one: values[one]}), plant)
    np.testing.assert_array_equal(both, swapped)
    assert np.all(np.isfinite(both))
    assert not np.array_equal(both, plain(plant))


def test_effects_on_the_models_own_numbers_are_put_there_once(base):
    model = base.with_effect("wheel_radius", scale=1.1).with_effect("low_grip", friction=0.3)
    once = changed_model(model, "rollers")
    assert once.robot == replace(base.robot, wheel_radius_m=base.robot.wheel_radius_m * 1.1, friction=0.3)
    assert changed_model(once, "rollers") == once
    assert once.effects == {}


@pytest.mark.parametrize(
    ("plant", "name"), [("bench", "backlash"), ("rollers", "payload"), ("planar", "body_acceleration_limit")]
)
def test_an_effect_in_a_file_is_simulated_at_once(plain, tmp_path, plant, name):
    write_model(clear_model(name), tmp_path / "model.json")
    read = channels(read_model(tmp_path / "model.json"), plant)
    np.testing.assert_array_equal(read, channels(clear_model(name), plant))
    assert not np.array_equal(read, plain(plant))
