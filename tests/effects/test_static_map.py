"""A static map: the curve it follows, what files hold of it, and what is refused."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects.apply import active_effects, drive_parameters
from mecanum_env.errors import InputError
from mecanum_env.model import model_from_dict, model_to_dict, paper_model
from mecanum_env.model.static_map import map_parameters
from mecanum_env.plugin.layout import chain_parameters
from mecanum_env.simulator import replay_bench
from mecanum_env.wheel_drive.set_point import mapped, unmapped
from tests.set_points import curves

TIME = np.arange(0.0, 1.2, 0.01)


def with_map(knots, values):
    return paper_model().with_effect("static_map", **map_parameters(knots, values))


def drawn(parameters):
    drive = drive_parameters(paper_model().with_effect("static_map", **parameters))
    return drive.knots_rpm, drive.values_rpm


@pytest.mark.parametrize(
    ("command", "speed"), [(5, 0), (10, 0), (35, 25), (60, 50), (80, 70), (-5, 0), (-35, -25), (-80, -70)]
)
def test_a_map_of_knots_above_0_is_mirrored(command, speed):
    curve = with_map([10, 60], [0, 50])
    settled = replay_bench(curve, TIME, np.full(TIME.shape, float(command)))[-20:].mean()
    assert settled == pytest.approx(speed, abs=1e-3)


@pytest.mark.parametrize(
    ("command", "speed"), [(-70, -60), (-50, -40), (-25, -20), (0, 0), (50, 60), (80, 90)]
)
def test_a_map_of_knots_of_both_signs_is_as_given(command, speed):
    assert mapped(np.float64(command), (-50, 0, 50), (-40, 0, 60)) == pytest.approx(speed)


@given(curve=curves(), commands=st.lists(st.floats(-200.0, 200.0), min_size=2, max_size=20))
def test_a_larger_command_is_never_made_smaller_than_a_smaller_one(curve, commands):
    out = mapped(np.sort(commands), *drawn(curve))
    assert np.all(np.diff(out) >= -1e-12)


@given(curve=curves(st.integers(-120, 120).map(float)), speed=st.floats(-200.0, 200.0))
def test_the_inverse_gives_a_command_that_is_mapped_to_the_speed(curve, speed):
    points = drawn(curve)
    reached = mapped(unmapped(np.array([speed]), *points), *points)
    assert reached[0] == pytest.approx(speed, abs=1e-9)


def test_unused_knots_may_be_given_as_0():
    short, full = with_map([20, 60], [15, 60]), with_map([20, 60], [15, 60])
    unused = {f"{kind}_{i}_rpm": 0.0 for kind in ("knot", "value") for i in range(3, 7)}
    full = full.with_effect("static_map", **full.effects["static_map"], **unused)
    np.testing.assert_array_equal(chain_parameters(short), chain_parameters(full))
    assert model_from_dict(model_to_dict(full)) == full


def test_a_map_of_negative_knots_ends_at_0():
    model = paper_model().with_effect("static_map", knot_1_rpm=-50.0, value_1_rpm=-40.0)
    drive = drive_parameters(model)
    assert (drive.knots_rpm, drive.values_rpm) == ((-50.0, 0.0), (-40.0, 0.0))


def test_no_knots_are_no_map(base):
    assert list(active_effects(base.with_effect("static_map"))) == []


@given(curve=curves())
def test_a_file_holds_two_lists(curve):
    model = paper_model().with_effect("static_map", **curve)
    value = json.loads(json.dumps(model_to_dict(model)))
    assert value["effects"]["static_map"].keys() == {"knots_rpm", "values_rpm"}
    assert model_from_dict(value) == model


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ({"knots_rpm": [10, 20], "values_rpm": [5]}, "2 knots_rpm and 1 values_rpm, must be as many"),
        ({"knots_rpm": [20, 10], "values_rpm": [5, 6]}, "must increase"),
        ({"knots_rpm": [10, 10], "values_rpm": [5, 6]}, "must increase"),
        ({"knots_rpm": [10, 20], "values_rpm": [6, 5]}, "must not decrease"),
        ({"knots_rpm": list(range(7)), "values_rpm": list(range(7))}, "at most 6"),
        ({"knots_rpm": [-20], "values_rpm": [-10]}, "must reach 0"),
        ({"knots_rpm": [0, 20], "values_rpm": [3, 10]}, "that at 0 must be 0"),
        ({"knots_rpm": [10], "values_rpm": [-3]}, "no value may be below 0"),
        ({"knots_rpm": [10, None], "values_rpm": [1, 2]}, r"knots_rpm\[1\] = null, must be a number"),
        ({"knots_rpm": 10, "values_rpm": [1]}, "must be a list of numbers"),
        ({"knots_rpm": [10]}, "must be knots_rpm and values_rpm"),
        ({"knots_rpm": [10], "values_rpm": [1], "knot_2_rpm": 3}, "must be knots_rpm and values_rpm"),
    ],
)
def test_an_impossible_curve_is_refused_on_reading(base, section, words):
    with pytest.raises(InputError, match=r"^effects\.static_map.*" + words):
        model_from_dict(model_to_dict(base) | {"effects": {"static_map": section}})


def test_knots_that_do_not_increase_are_refused_by_name(base):
    model = base.with_effect("static_map", knot_1_rpm=20.0, knot_2_rpm=10.0)
    with pytest.raises(
        InputError, match=r"effects\.static_map: knot_2_rpm = 10, must be above knot_1_rpm = 20"
    ):
        drive_parameters(model)
