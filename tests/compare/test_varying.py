"""The error of a robot's model that differs from one command sequence to another."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

from mecanum_env.units import FloatArray
from sysid.compare.model_error.varying import VaryingPosterior, columns_of_sequences

SEQUENCES, VALUES = 12, 200
FOLDS: npt.NDArray[np.intp] = np.repeat(np.arange(SEQUENCES), VALUES)
GROUP_OF = np.array([-1, -1, 0])
SIZE = np.array([10.0, 10.0, 1e-3])


def columns(seed: int) -> FloatArray:
    return np.random.default_rng(seed).standard_normal((FOLDS.size, 3))


def residual(columns: FloatArray, common: FloatArray, differing: FloatArray, seed: int) -> FloatArray:
    """Return a residual of `common` factors, of which each sequence draws others by `differing`."""
    rng = np.random.default_rng(seed)
    own = common + differing * rng.standard_normal((SEQUENCES, 3))
    return np.sum(columns * own[FOLDS], axis=1) + rng.standard_normal(FOLDS.size)


@pytest.fixture(scope="module")
def found() -> tuple[FloatArray, FloatArray, VaryingPosterior]:
    k = columns(0)
    r = residual(k, np.array([1.0, -2.0, 0.5]), np.array([1.5, 0.0, 0.0]), 1)
    return r, k, VaryingPosterior.of(r, k, FOLDS, SIZE, GROUP_OF)


def test_it_finds_which_factors_differ_between_sequences(
    found: tuple[FloatArray, FloatArray, VaryingPosterior],
) -> None:
    posterior = found[2]
    assert posterior.varying[0] == pytest.approx(1.5, rel=0.5)
    assert posterior.varying[1] < 0.1
    assert posterior.varying[2] == 0.0


def test_the_mean_is_as_uncertain_as_the_sequences_differ(
    found: tuple[FloatArray, FloatArray, VaryingPosterior],
) -> None:
    posterior = found[2]
    deviations = np.sqrt(np.diag(posterior.covariance))
    np.testing.assert_array_less(np.abs(posterior.mean - [1.0, -2.0, 0.5]), 3.0 * deviations)
    assert deviations[0] == pytest.approx(posterior.varying[0] / np.sqrt(SEQUENCES), rel=0.1)
    assert deviations[1] < 0.1


def test_sequences_that_are_left_out_cost_what_is_expected(
    found: tuple[FloatArray, FloatArray, VaryingPosterior],
) -> None:
    r, k, posterior = found
    assert float(np.sum(posterior.left_out_costs(r, k, FOLDS))) == pytest.approx(r.size, rel=0.1)


def test_a_difference_no_larger_than_between_sequences_is_hidden_and_a_systematic_one_is_not(
    found: tuple[FloatArray, FloatArray, VaryingPosterior],
) -> None:
    posterior, k = found[2], columns(2)
    own = np.concatenate(columns_of_sequences(k, posterior.varying, FOLDS), axis=1)
    covariance = np.eye(FOLDS.size) + own @ own.T

    def sigmas(change: FloatArray) -> float:
        return float(np.sqrt(change @ np.linalg.solve(covariance, change)))

    first = FOLDS == 0
    once, everywhere = np.where(first, k[:, 0], 0.0), k[:, 0]
    assert sigmas(once) < 1.0
    assert sigmas(everywhere) == pytest.approx(np.sqrt(SEQUENCES) / posterior.varying[0], rel=0.1)
    assert sigmas(k[:, 1]) > 0.8 * np.linalg.norm(k[:, 1])


def test_factors_that_do_not_differ_add_no_columns() -> None:
    assert columns_of_sequences(columns(0), np.zeros(3), FOLDS) == []
