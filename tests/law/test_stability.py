"""The stable region of the wheel law: margins, free coordinates, shape."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.law.stability import (
    POLE_LIMIT,
    free_coordinates,
    stabilised_abc,
    stability_margins,
    stable_abc,
    stable_abc_jacobian,
)

coordinates = st.tuples(*[st.floats(-40.0, 40.0)] * 3)
moderate = st.tuples(*[st.floats(-3.0, 3.0)] * 3)
anything = st.tuples(*[st.floats(-10.0, 10.0)] * 3)


def test_margins_agree_with_the_roots():
    triples = np.random.default_rng(0).uniform(-3.2, 3.2, (100_000, 3))
    companion = np.zeros((len(triples), 3, 3))
    companion[:, 0] = triples
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    radius = np.max(np.abs(np.linalg.eigvals(companion)), axis=1)
    stable = np.all(stability_margins(triples) > 0.0, axis=1)
    clear = np.abs(radius - 1.0) > 1e-9
    assert np.array_equal(stable[clear], radius[clear] < 1.0)
    assert 1_000 < np.count_nonzero(stable) < 99_000
    assert np.count_nonzero(clear) > 99_900


def test_the_stable_region_is_not_convex():
    ends = -np.array([np.poly([0.9] * 3)[1:], np.poly([-0.9] * 3)[1:]])
    assert np.all(stability_margins(ends) > 0.0)
    middle = np.mean(ends, axis=0)
    assert not np.all(stability_margins(middle) > 0.0)
    assert np.max(np.abs(np.roots([1.0, *-middle]))) > 1.0


@given(coordinates)
def test_every_point_is_a_stable_law(t):
    assert np.all(stability_margins(stable_abc(t)) > 0.0)


@given(moderate)
def test_coordinates_come_back(t):
    assert np.allclose(stable_abc(free_coordinates(stable_abc(t))), stable_abc(t), atol=1e-9)


@given(st.lists(st.floats(-0.98, 0.98), min_size=3, max_size=3))
def test_every_stable_triple_is_reached(poles):
    abc = -np.poly(poles)[1:]
    assert np.allclose(stable_abc(free_coordinates(abc)), abc, atol=1e-10)


@given(moderate)
def test_jacobian_equals_differences(t):
    step = 1e-6
    differences = [
        (stable_abc(np.add(t, step * axis)) - stable_abc(np.subtract(t, step * axis))) / (2.0 * step)
        for axis in np.eye(3)
    ]
    assert np.allclose(stable_abc_jacobian(t), np.transpose(differences), atol=1e-8)


@given(anything)
def test_stabilised_triples_are_stable_and_stay_where_they_were_stable(abc):
    result = stabilised_abc(abc)
    assert np.all(stability_margins(result) > 0.0)
    if np.max(np.abs(np.roots([1.0, *np.negative(abc)]))) < 0.99:
        assert np.allclose(result, abc, atol=1e-9)


def test_the_pole_limit_is_the_largest_pole_magnitude():
    for signs in np.ndindex(2, 2, 2):
        roots = np.roots([1.0, *-stable_abc(100.0 * (2.0 * np.array(signs) - 1.0))])
        # Rounding spreads a triple root by the cube root of 1e-16.
        assert np.max(np.abs(roots)) < POLE_LIMIT + 1e-5
