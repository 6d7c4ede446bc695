"""Pictures of a bout."""

import numpy as np
import pytest

from mecanum_env.tankendo.bout import duel_arena
from mecanum_env.tankendo.duel_drawing import score_lines, sword_shapes


@pytest.fixture
def arena():
    arena = duel_arena()
    arena.begin([0], [np.random.default_rng(0)], poses=((-1.2, 0.0, 0.0), (-1.2, 0.0, 0.0)))
    return arena


def test_each_sword_is_drawn_from_its_own_robot(arena):
    for player, sign in enumerate((-1.0, 1.0)):
        starts = np.array([shape.start for shape in sword_shapes(arena, player)])
        assert np.all(sign * starts[:, 0] > 0.0)


def test_the_score_names_both_players(arena):
    assert "0.0 s   ann 0 : 0 bob" in score_lines(arena, ("ann", "bob"))
