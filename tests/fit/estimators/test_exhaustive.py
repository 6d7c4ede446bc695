"""Alternating exhaustive search for a first-order motor under PI control."""

from typing import Any

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from sysid.fit.estimators import WheelRun, estimate
from sysid.fit.estimators.exhaustive import SearchGrid, exhaustive, pi_law, runs_near
from sysid.studies.synthetic import step_runs

PERIOD_S = 1 / 120
COARSE = SearchGrid(
    proportional=(0.0, 4.0, 0.5),
    integral_per_s=(0.0, 40.0, 4.0),
    time_constant_s=(0.1, 0.5, 0.05),
    first_time_constant_s=0.3,
)


def pi_runs(proportional: float, integral: float, constant: float) -> list[WheelRun]:
    law = WheelLaw.from_coefficients(pi_law(proportional, integral, constant, PERIOD_S), PERIOD_S)
    return step_runs(
        law,
        np.random.default_rng(0),
        noise_rpm=0.0,
        quantum_rpm=0.0,
        repeats=1,
        seconds=0.6,
        steps_rpm=(20.0, 60.0),
    )


def test_law_equals_a_simulation_of_motor_and_controller() -> None:
    proportional, integral, constant = 2.0, 15.0, 0.25
    law = WheelLaw.from_coefficients(pi_law(proportional, integral, constant, PERIOD_S), PERIOD_S)
    speeds = law.simulate(np.full(60, 60.0))
    speed = voltage = error = 0.0
    expected = [speed]
    for k in range(60):
        last, error = error, 60.0 - speed
        voltage += proportional * (error - (last if k else 0.0)) + integral * PERIOD_S * error
        speed += PERIOD_S / constant * (voltage - speed)
        expected.append(speed)
    np.testing.assert_allclose(speeds, expected, rtol=1e-10)


def test_law_has_three_free_numbers_and_unit_gain() -> None:
    laws = pi_law(np.array([0.5, 3.0]), np.array([10.0, 40.0]), 0.2, PERIOD_S)
    np.testing.assert_allclose(np.sum(laws, axis=1), 1.0, atol=1e-12)
    np.testing.assert_array_equal(laws[:, [2, 5]], 0.0)


def test_truth_on_the_grid_is_found_when_its_time_constant_is_the_first() -> None:
    found = exhaustive(pi_runs(2.0, 16.0, 0.3), None, COARSE)
    np.testing.assert_allclose(found.coefficients, pi_law(2.0, 16.0, 0.3, PERIOD_S), atol=1e-12)
    assert found.rms_rpm < 1e-9
    assert found.starts[0].iterations == 2 * (9 * 11 + 9)


def test_search_alternates_and_each_round_searches_the_whole_grid() -> None:
    """Compared with three nested loops."""
    runs = pi_runs(1.3, 11.0, 0.22)
    used, _ = runs_near(runs, 60.0)

    def error(proportional: float, integral: float, constant: float) -> float:
        law = WheelLaw.from_coefficients(pi_law(proportional, integral, constant, PERIOD_S), PERIOD_S)
        return sum(float(np.sum((law.simulate(r.command_rpm) - r.speed_rpm) ** 2)) for r in used)

    gains = [(0.5 * i, 4.0 * j) for i in range(9) for j in range(11)]
    constant = COARSE.first_time_constant_s
    for _ in range(2):
        pair = min(gains, key=lambda g: error(g[0], g[1], constant))
        constant = min((0.1 + 0.05 * i for i in range(9)), key=lambda t: error(pair[0], pair[1], t))
    found = exhaustive(runs, None, COARSE)
    np.testing.assert_allclose(found.coefficients, pi_law(*pair, constant, PERIOD_S), atol=1e-12)


def test_only_runs_at_60_rpm_are_fitted() -> None:
    good, other = pi_runs(2.0, 16.0, 0.3), pi_runs(0.5, 4.0, 0.1)
    found = exhaustive([good[1], other[0]], None, COARSE)
    np.testing.assert_allclose(found.coefficients, pi_law(2.0, 16.0, 0.3, PERIOD_S), atol=1e-12)
    assert found.starts[0].kind == "grid at 60 rpm"


def test_without_60_rpm_the_nearest_speed_is_used_and_stated() -> None:
    found = exhaustive(pi_runs(2.0, 16.0, 0.3)[:1], None, COARSE)
    assert found.starts[0].kind == "grid at 20 rpm"


def test_of_two_speeds_equally_near_the_faster_is_used_in_any_order(noisy_runs: list[WheelRun]) -> None:
    """The paper's 10, 40, 80 and 130 rpm: 40 and 80 are both 20 away from 60."""
    for runs in (noisy_runs, noisy_runs[::-1]):
        used, speed = runs_near(runs, 60.0)
        assert speed == 80.0
        assert len(used) == 3


def test_reduced_model_is_worse_than_output_error(noisy_runs: list[WheelRun]) -> None:
    reduced = exhaustive(noisy_runs, None, COARSE)
    assert reduced.law.is_stable
    assert reduced.rms_rpm > 1.02 * estimate(noisy_runs, "output-error").rms_rpm


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"proportional": (1.0, 0.0, 0.1)}, "proportional"),
        ({"integral_per_s": (0.0, 1.0, 0.0)}, "integral_per_s"),
        ({"time_constant_s": (0.0, 1.0, 0.1)}, "time constants"),
        ({"rounds": 0}, "rounds"),
    ],
)
def test_impossible_search_is_refused(changes: dict[str, Any], field: str) -> None:
    with pytest.raises(InputError, match=field):
        SearchGrid(**changes)
