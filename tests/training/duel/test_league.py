"""Self-play in small: the environment of the learner, and a league of one generation."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason='needs stable-baselines3 (the extra "train")')

from training.controllers.policy import load_policy
from training.duel.environment import DuelVecEnv
from training.duel.league import LeagueSettings, main, play_league
from training.duel.match import player_factory

SMALL = LeagueSettings(generations=1, steps=256, bouts=2, envs=8, scripts=("still",))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out = tmp_path_factory.mktemp("league") / "out"
    main(SMALL, out=out)
    return out


def test_a_bout_that_is_over_begins_anew_at_once():
    env = DuelVecEnv(4, [player_factory("still")], 0)
    env.reset()
    for _ in range(60):
        observation, _, done, infos = env.step(np.tile([1.0, 0.0, 0.0], (4, 1)))
        if done.any():
            break
    row = int(np.argmax(done))
    assert infos[row]["terminal_observation"][0] < 1.0 < observation[row, 0]


def test_the_league_writes_a_policy_that_acts(folder):
    v, theta, vc = load_policy(folder / "self-1.npz").act(np.zeros(23))
    assert all(isinstance(number, int) for number in (v, theta, vc))


def test_the_league_draws_its_ratings(folder):
    assert (folder / "elo.png").stat().st_size > 0


def test_the_same_league_twice_has_the_same_scores():
    np.testing.assert_array_equal(play_league(SMALL).scores, play_league(SMALL).scores)
