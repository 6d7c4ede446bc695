"""Least squares by few evaluations: finds the minimum within the bounds, and never increases the cost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Minimum, compass_search, reach
from sysid.compare.least_squares.gauss_newton import (
    Function,
    descend_sparingly,
    descend_steeply,
    differences,
    refined,
)

_TIME = np.linspace(0.0, 1.0, 50)


def _decay(place: FloatArray) -> FloatArray:
    return np.exp(-3.0 * place[0] * _TIME) * (0.5 + place[1]) - np.exp(-1.5 * _TIME) * 0.9


def test_a_curved_problem_is_solved_within_a_dozen_evaluations() -> None:
    found = descend_sparingly(_decay, np.array([0.1, 0.1]))
    assert found is not None
    assert found.cost < 0.02
    assert found.evaluations <= 15


@given(st.lists(st.floats(0.0, 1.0), min_size=2, max_size=2))
@settings(max_examples=30, deadline=None)
def test_the_end_is_inside_the_bounds_and_no_higher_than_the_start(start: list[float]) -> None:
    place = np.array(start)
    found = descend_sparingly(_decay, place)
    assert found is not None
    assert np.all((found.place >= 0.0) & (found.place <= 1.0))
    assert found.cost <= float(np.sum(_decay(place) ** 2)) + 1e-12


def test_a_minimum_beyond_a_bound_ends_at_the_bound() -> None:
    found = descend_sparingly(lambda x: 40.0 * (x - 1.5), np.array([0.2]))
    assert found is not None
    assert found.place[0] == pytest.approx(1.0)


def test_a_start_without_a_residual_gives_none() -> None:
    assert descend_sparingly(lambda _: None, np.array([0.5])) is None


def test_differences_are_the_slope_into_the_side_with_room() -> None:
    place = np.array([1.0, 0.0])
    slope = differences(lambda x: np.array([2.0 * x[0] + x[1], x[1]]), place, np.array([2.0, 0.0]))
    assert slope == pytest.approx(np.array([[2.0, 1.0], [0.0, 1.0]]))


def test_a_refined_jacobian_is_no_finer_than_the_simulation_is_smooth() -> None:
    tried = []

    def function(x: FloatArray) -> FloatArray:
        tried.append(float(x[0]))
        return 1e6 * (x - 0.5)

    rough = Minimum(np.array([0.5]), np.zeros(1), np.full((1, 1), 1e6), 0)
    refined(function, rough, least_step=0.02)
    assert tried == [pytest.approx(0.52)]


def _threshold(place: FloatArray) -> FloatArray:
    """A dead band between commands of 10, 20 .. 100 percent: flat but for jumps, best from .30 to .39."""
    levels = np.arange(0.1, 1.01, 0.1)
    truth, guess = levels > 0.35, levels > place[0]
    return 10.0 * (truth.astype(float) - guess.astype(float))


def test_a_threshold_without_slope_is_found_by_a_compass_search() -> None:
    start = Minimum(np.array([0.52]), _threshold(np.array([0.52])), np.zeros((10, 1)), 0)
    found = compass_search(_threshold, start, np.ones(1, bool))
    assert found.cost == 0.0


def test_the_reach_of_a_threshold_is_up_to_the_next_commands() -> None:
    at = Minimum(np.array([0.35]), _threshold(np.array([0.35])), np.zeros((10, 1)), 0)
    down, up = reach(_threshold, at, 0, rise=2.7)
    assert 0.35 - down == pytest.approx(0.3, abs=0.006)
    assert 0.35 + up == pytest.approx(0.4, abs=0.006)


def test_a_steep_descent_tries_its_steps_with_a_cheaper_function_and_ends_where_the_other_does() -> None:
    asked: list[np.ndarray] = []

    def function(place: np.ndarray) -> np.ndarray | None:
        asked.append(place)
        return _decay(place)

    def near(at: np.ndarray) -> Function:
        # Less exact with the distance, and off by a constant.
        return lambda place: _decay(place) * (1.0 + 0.1 * np.sum(np.abs(place - at))) + 1e-4

    start = np.array([0.1, 0.1])
    alone = descend_steeply(function, start, step=1e-4)
    many = len(asked)
    asked.clear()
    held = descend_steeply(function, start, step=1e-4, near=near)
    assert alone is not None
    assert held is not None
    np.testing.assert_allclose(held.place, alone.place, atol=1e-3)
    np.testing.assert_array_equal(held.residual, _decay(held.place))
    assert len(asked) < 0.5 * many


def test_a_steep_descent_does_without_a_cheaper_function_that_has_no_residual() -> None:
    start = np.array([0.1, 0.1])
    alone = descend_steeply(_decay, start, step=1e-4)
    held = descend_steeply(_decay, start, step=1e-4, near=lambda _: lambda _: None)
    assert alone is not None
    assert held is not None
    np.testing.assert_array_equal(held.place, alone.place)
