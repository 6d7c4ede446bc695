"""Which effects every run has in another size, from the scatter of repeats."""

from collections.abc import Iterable

import numpy as np
import pytest
from scipy.stats import chi2

from sysid.compare.model_error.run_to_run import Scatter, _log_chance, run_to_run_columns

SEQUENCES, VALUES = 6, 200
SEQUENCE = np.repeat(np.arange(SEQUENCES), VALUES)


def effects(rng: np.random.Generator, count: int = 8) -> np.ndarray:
    """Return what some effects change in each command sequence, (N, count), of length 5 in each."""
    columns = rng.standard_normal((SEQUENCE.size, count))
    return 5.0 * columns / np.sqrt(VALUES)


def varying(
    differences: np.ndarray,
    columns: np.ndarray,
    sequence: np.ndarray = SEQUENCE,
    asked: Iterable[int] = range(SEQUENCES),
    known: np.ndarray | None = None,
) -> np.ndarray:
    """Return what differences of repeats, (N,) or (N, d), show to vary along some columns."""
    known = np.zeros((sequence.size, 0)) if known is None else known
    differences = differences.reshape(sequence.size, -1)
    return run_to_run_columns(Scatter(differences, columns, sequence, tuple(asked), known))


def test_white_scatter_shows_no_effect_that_varies() -> None:
    found = 0
    for seed in range(100):
        rng = np.random.default_rng(seed)
        scatter = rng.standard_normal(SEQUENCE.size)
        found += varying(scatter, effects(rng)).shape[1] > 0
    assert found <= 5  # of 100, where each may be with a probability of .01


def test_a_sequence_without_a_difference_says_nothing_of_the_variance() -> None:
    rng = np.random.default_rng(3)
    columns = effects(rng)
    scatter = (
        rng.standard_normal((SEQUENCE.size, 2)) + 3.0 * columns[:, 2, None] * (-1.0) ** SEQUENCE[:, None]
    )
    scatter[SEQUENCE >= 3, 1] = 0.0
    found = varying(scatter, columns)
    sigma = np.linalg.norm(found[:, :SEQUENCES]) / np.linalg.norm(columns[:, 2])
    # Counted as differences of size 0, those that are missing would make it 2.8.
    assert 3.0 < sigma < 4.0


def test_several_differences_of_repeats_tell_the_variance_better_than_one() -> None:
    one, three = [], []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        columns = effects(rng)
        size = 3.0 * rng.standard_normal((SEQUENCES, 3))
        scatter = rng.standard_normal((SEQUENCE.size, 3)) + columns[:, 2, None] * size[SEQUENCE]
        for count, sizes in ((1, one), (3, three)):
            found = varying(scatter[:, :count], columns)
            sizes.append(np.linalg.norm(found[:, :SEQUENCES]) / np.linalg.norm(columns[:, 2]))
    assert np.std(three) < 0.8 * np.std(one)
    assert 2.5 < np.mean(three) < 3.5


def test_an_effect_of_another_size_in_each_sequence_is_found_with_its_variance() -> None:
    rng = np.random.default_rng(1)
    columns = effects(rng)
    size = 3.0 * np.array([1.0, -1.0, 1.0, 1.0, -1.0, -1.0])
    scatter = rng.standard_normal(SEQUENCE.size) + columns[:, 2] * size[SEQUENCE]
    found = varying(scatter, columns)
    assert found.shape == (SEQUENCE.size, SEQUENCES)
    for number, column in enumerate(found.T):
        own = number == SEQUENCE
        assert not np.any(column[~own])
        factor = column[own] @ columns[own, 2] / (columns[own, 2] @ columns[own, 2])
        np.testing.assert_allclose(column[own], factor * columns[own, 2])
        # From six values the variance is known to a factor of two or so.
        assert 2.0 < factor < 6.0


def test_what_one_effect_explains_is_not_asked_of_another() -> None:
    rng = np.random.default_rng(2)
    columns = effects(rng, 2)
    columns[:, 1] = 0.9 * columns[:, 0] + 0.3 * columns[:, 1]
    scatter = rng.standard_normal(SEQUENCE.size) + 4.0 * columns[:, 0] * (-1.0) ** SEQUENCE
    assert varying(scatter, columns).shape[1] == SEQUENCES


def test_of_two_effects_that_are_both_beyond_doubt_the_larger_one_is_found_first() -> None:
    rng = np.random.default_rng(5)
    columns = effects(rng, 2)
    # The first one has a part of the second, so that its probability is no number any more, either.
    columns[:, 0] = 0.8 * columns[:, 1] + 0.6 * columns[:, 0]
    size = 200.0 * rng.standard_normal(SEQUENCES)
    scatter = rng.standard_normal(SEQUENCE.size) + columns[:, 1] * size[SEQUENCE]
    found = varying(scatter, columns)
    first = found[SEQUENCE == 0, 0]
    true = columns[SEQUENCE == 0, 1]
    assert abs(first @ true) > 0.99 * np.linalg.norm(first) * np.linalg.norm(true)
    assert found.shape[1] == SEQUENCES


@pytest.mark.parametrize("freedom", [1.0, 3.0, 12.0])
def test_chances_are_those_of_chi_squared_and_go_on_where_these_are_no_numbers(freedom: float) -> None:
    squares = np.array([0.0, 1.0, 50.0, 1300.0, 1600.0, 1e5])
    found = _log_chance(squares, np.full(squares.size, freedom))
    np.testing.assert_allclose(found[:4], np.log(chi2.sf(squares[:4], freedom)))
    assert np.all(np.isfinite(found))
    assert np.all(np.diff(found) < 0.0)
    # Beyond all numbers its slope is that of exp(-x / 2) and a little less.
    assert (found[5] - found[4]) / (squares[5] - squares[4]) == pytest.approx(-0.5, rel=1e-3)


def test_what_is_known_to_vary_is_not_found_again() -> None:
    rng = np.random.default_rng(6)
    columns = effects(rng)
    size = 5.0 * rng.standard_normal(SEQUENCES)
    scatter = rng.standard_normal(SEQUENCE.size) + columns[:, 2] * size[SEQUENCE]
    known = np.zeros((SEQUENCE.size, SEQUENCES))
    for number in range(SEQUENCES):
        known[number == SEQUENCE, number] = 5.0 * columns[number == SEQUENCE, 2]
    assert varying(scatter, columns).shape[1] == SEQUENCES
    assert varying(scatter, columns, known=known).shape[1] == 0


def test_repeats_of_other_sequences_tell_the_variance_of_those_that_have_few() -> None:
    rng = np.random.default_rng(7)
    columns, own = effects(rng), SEQUENCE < 2
    scatter = rng.standard_normal(SEQUENCE.size) + 0.45 * columns[:, 2] * (-1.0) ** SEQUENCE
    none = np.zeros((SEQUENCE.size, 0))
    few = Scatter(scatter[own, None], columns[own], SEQUENCE[own], (0, 1), none[own])
    others = Scatter(
        np.stack([scatter[~own], np.zeros_like(scatter[~own])], axis=1),
        columns[~own],
        SEQUENCE[~own] - 2,
        (0, 1, 2, 3),
        none[~own],
    )
    assert run_to_run_columns(few).shape[1] == 0
    together = run_to_run_columns(few.beside(others))
    np.testing.assert_allclose(together, varying(scatter, columns))
    assert together.shape[1] == SEQUENCES
