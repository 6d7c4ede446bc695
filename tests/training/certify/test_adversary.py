"""The adversary: opponents within the ranges of people, searched against a controller."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.parallel import Workers
from mecanum_env.tankendo import Opponent, Opponents
from training.certify.adversary import Search, opponent_at, size_of_search, worst_opponent
from training.certify.run import CertifyOptions, certify_controller, episodes_of
from training.evaluate import Job, Setup, play_jobs

SMALL = Search(first=6, generations=2, candidates=4, best=2, episodes=2)
HERE = Workers(jobs=1)


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_every_point_is_an_opponent_within_the_ranges(share):
    found = opponent_at(np.full(size_of_search(), share), Opponent())
    for name, ends in Opponents().ranges.items():
        if name != "swing_scale":
            assert np.all(np.asarray(getattr(found, name)) >= ends[0] - 1e-12)
            assert np.all(np.asarray(getattr(found, name)) <= ends[1] + 1e-12)


def test_it_may_keep_to_one_technique():
    point = np.full(size_of_search(), 0.5)
    names = []
    for share in (0.0, 0.3, 0.5, 0.7, 1.0):
        point[-1] = share
        names.append([one.name for one in opponent_at(point, Opponent()).techniques])
    assert names == [["do", "nodo", "men", "kote"], ["do"], ["nodo"], ["men"], ["kote"]]


def test_a_search_is_the_same_each_time_and_plays_what_it_says(paper):
    played = []
    found = [
        worst_opponent(
            "retreat", Setup(paper), Opponent(), SMALL, HERE, lambda _, count: played.append(count)
        )
        for _ in range(2)
    ]
    assert found[0] == found[1]
    assert sum(played) == 2 * SMALL.total


def test_a_certificate_has_a_row_of_it_that_the_worst_plant_leaves_out(paper):
    options = CertifyOptions(episodes=2, plants=("adversary",), workers=HERE, bound=False, search=SMALL)
    played = []
    found = certify_controller("still", paper, options, lambda _, count: played.append(count))
    row = next(one for one in found.plants if one.group == "adversary")
    assert row.opponent is not None
    assert found.worst.group != "adversary"
    assert sum(played) == episodes_of(options, paper)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["retreat", "predicting"])
def test_what_it_finds_hardly_depends_on_its_seed(paper, name):
    """With 16 candidates at first, of which four decided where the next ones lie, it did."""
    setup, left = Setup(paper), []
    for seed in range(3):
        opponent = worst_opponent(name, setup, Opponent(), Search(seed=seed), Workers(jobs=2))
        job = Job("row", name, replace(setup, opponent=opponent), 100)
        left.append(play_jobs({"row": job})["row"].success.value)
    assert max(left) < min(left) + 0.3
