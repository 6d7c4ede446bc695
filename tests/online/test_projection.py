import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import stability_margins
from sysid.online import OnlineOptions
from sysid.online.projection import contracted, feasible_start, feasible_step, law_of, poles_within

coefficient = st.floats(-5.0, 5.0)
radii = st.floats(0.1, 1.0)


@given(st.tuples(coefficient, coefficient, coefficient), radii)
def test_poles_within_a_circle_are_the_margins_of_the_scaled_law(abc, radius):
    margins = stability_margins(np.array(abc) / radius ** np.arange(1, 4))
    if np.min(np.abs(margins)) > 1e-9:  # else rounding may decide
        assert poles_within(abc, radius) == bool(np.all(margins > 0.0))


@given(st.tuples(coefficient, coefficient, coefficient), radii)
def test_contraction_brings_the_largest_pole_to_the_circle_and_keeps_the_others_ratios(abc, radius):
    before = WheelLaw(*abc, 1.0, 0.0, 0.0, 1.0).poles
    after = WheelLaw(*contracted(abc, radius), 1.0, 0.0, 0.0, 1.0).poles
    if abs(before[0]) < radius * (1.0 - 1e-4):
        assert tuple(contracted(abc, radius)) == abc
    elif abs(before[0]) > radius * (1.0 + 1e-4):
        assert abs(after[0]) == pytest.approx(radius, rel=1e-4)
        # Polynomials compare better than roots, which a double root makes ill-conditioned.
        scale = radius / abs(before[0])
        expected = np.array(abc) * scale ** np.arange(1, 4)
        np.testing.assert_allclose(contracted(abc, radius), expected, rtol=1e-3, atol=1e-9)


@given(st.lists(coefficient, min_size=5, max_size=5), st.lists(coefficient, min_size=5, max_size=5))
def test_every_step_from_a_feasible_start_ends_feasible(start, step):
    options = OnlineOptions()
    begin = feasible_start(np.array(start), options)
    end = feasible_step(begin, np.array(step), options)
    for parameters in (begin, end):
        law = law_of(parameters, 1.0)
        assert law.is_stable
        assert max(abs(law.D), abs(law.E), abs(law.F)) <= options.largest_numerator + 1e-12


def test_a_step_within_the_limits_is_taken_whole():
    begin = np.array([0.8, 0.0, 0.0, 0.2, 0.0])
    step = np.array([0.01, -0.02, 0.03, -0.01, 0.02])
    np.testing.assert_array_equal(feasible_step(begin, step, OnlineOptions()), begin + step)
