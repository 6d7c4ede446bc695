"""Ratings from results."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from training.duel.elo import fit_elo

BOUTS = 400.0 * (1.0 - np.eye(3))


def expected_scores(elo):
    elo = np.array(elo)
    return BOUTS / (1.0 + 10.0 ** ((elo[None] - elo[:, None]) / 400.0))


def test_ratings_that_made_the_scores_are_found():
    found = fit_elo(expected_scores([0.0, 100.0, -150.0]), BOUTS)
    np.testing.assert_allclose(found.elo, [0.0, 100.0, -150.0], atol=3.0)


def test_who_always_wins_has_a_finite_rating():
    scores, bouts = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[0.0, 10.0], [10.0, 0.0]])
    assert 200.0 < fit_elo(scores, bouts).elo[1] < 2000.0


def test_more_bouts_make_ratings_surer():
    few = fit_elo(expected_scores([0.0, 50.0, 90.0]) / 10, BOUTS / 10)
    many = fit_elo(expected_scores([0.0, 50.0, 90.0]), BOUTS)
    assert np.all(many.error[1:] < few.error[1:])


def test_scores_that_do_not_add_up_are_refused():
    with pytest.raises(InputError, match="add up"):
        fit_elo(np.zeros((2, 2)), np.ones((2, 2)))
