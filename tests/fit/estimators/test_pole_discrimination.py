"""Descent constrained by the pole magnitudes."""

import numpy as np
import pytest

from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import FEASIBLE_POLE, stability_margins
from sysid.fit.estimators import Options, WheelRun, estimate
from sysid.fit.estimators.gradient import (
    magnitude_excess,
    magnitude_gradients,
    poles,
    radially_stable,
    random_starts,
)


def test_poles_are_those_of_the_law() -> None:
    abc = random_starts(20, 0)[:, :3]
    expected = [WheelLaw(*row, 0.0, 0.0, 0.0, 1.0).poles for row in abc]
    np.testing.assert_allclose(np.sort_complex(poles(abc)), np.sort_complex(expected), atol=1e-12)


def test_magnitude_gradients_are_exact() -> None:
    abc = random_starts(50, 1)[:, :3]
    analytic = magnitude_gradients(abc)
    for j, step in enumerate(1e-7 * np.eye(3)):
        # Sorted magnitudes: the order in which roots come is not continuous.
        order = np.argsort(magnitude_excess(abc), axis=1)
        upper, lower = np.sort(magnitude_excess(abc + step)), np.sort(magnitude_excess(abc - step))
        numeric = (upper - lower) / 2e-7
        np.testing.assert_allclose(
            np.take_along_axis(analytic[:, :, j], order, 1), numeric, rtol=1e-3, atol=1e-3
        )


def test_radial_move_limits_every_pole_and_keeps_its_direction() -> None:
    abc = random_starts(200, 2)[:, :3] * 2.0
    moved = radially_stable(abc)
    assert np.all(stability_margins(moved) > 0.0)
    before, after = poles(abc[:1]), poles(moved[:1])
    expected = before * np.minimum(1.0, FEASIBLE_POLE / np.abs(before))
    np.testing.assert_allclose(np.sort_complex(after), np.sort_complex(expected), atol=1e-9)


def test_laws_inside_are_left_alone() -> None:
    abc = np.array([[0.881, -0.151, 0.122]])
    np.testing.assert_array_equal(radially_stable(abc), abc)


def test_derivative_grows_without_bound_where_two_poles_meet_and_stays_finite() -> None:
    near = -np.poly([0.5 + 1e-6, 0.5 - 1e-6, 0.1])[1:][None]
    double = -np.poly([0.5, 0.5, 0.1])[1:][None]
    assert np.max(np.abs(magnitude_gradients(near))) > 1e4
    assert np.all(np.isfinite(magnitude_gradients(double)))


@pytest.mark.parametrize("first", ["random", "informed"])
def test_every_start_ends_stable(noisy_runs: list[WheelRun], first: str) -> None:
    options = Options(starts=12, first_starts="random" if first == "random" else "informed", max_iterations=4)
    found = estimate(noisy_runs, "poles", options)
    assert found.method == "poles"
    assert found.stable_share == 1.0
