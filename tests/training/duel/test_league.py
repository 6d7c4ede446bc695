"""Self-play in small: the environment of the learner, and a league of one generation."""

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason='needs stable-baselines3 (the extra "train")')

from stable_baselines3 import PPO

from training.controllers.policy import load_policy
from training.duel import league
from training.duel.elo import Ratings
from training.duel.environment import DuelVecEnv
from training.duel.league import League, LeagueSettings, draw_elo, main, play_league
from training.duel.match import Result, player_factory
from training.train.settings import Ppo

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


def empty_league():
    return League([], [], np.zeros((0, 0)), np.zeros((0, 0)), {})


def rated(strengths, bouts, rng, monkeypatch):
    """Return the ratings of a league whose members, made by their own Elo, win as often as that says."""

    def play_match(first, second, bouts):
        won = rng.binomial(bouts, 1.0 / (1.0 + 10.0 ** ((second - first) / 400.0)))
        drawn = min(2, bouts - won)
        return Result(bouts, won - drawn // 2, bouts - won - drawn + drawn // 2, 0, 0, 1.0)

    monkeypatch.setattr(league, "play_match", play_match)
    of = empty_league()
    for number, strength in enumerate(strengths):
        of.join(f"self-{number}", strength, bouts)
    return of.ratings()


def test_a_league_finds_the_strengths_of_its_members(monkeypatch):
    strengths = np.array([0.0, -150.0, 80.0, 200.0, 210.0, 400.0])
    found = rated(strengths, 2000, np.random.default_rng(0), monkeypatch)
    np.testing.assert_allclose(found.elo, strengths, atol=15.0)


def test_the_intervals_of_a_league_hold_the_strengths_as_often_as_they_say(monkeypatch):
    strengths, rng = np.array([0.0, 100.0, -60.0, 180.0, 250.0]), np.random.default_rng(1)
    held = []
    for _ in range(80):
        found = rated(strengths, 60, rng, monkeypatch)
        held += list(np.abs(found.elo - strengths)[1:] <= 1.96 * found.error[1:])
    assert 0.9 <= np.mean(held) <= 0.99


def test_who_stands_still_is_rated_below_who_steps_aside():
    of = empty_league()
    for name in ("sidestep", "still"):
        of.join(name, player_factory(name), 6)
    assert of.scores[0, 1] > 3.0 > of.scores[1, 0]
    assert of.ratings().elo[1] < 0.0


def test_the_curve_shows_the_selves_at_their_steps_and_the_scripts_as_lines():
    ratings = Ratings(np.array([0.0, 30.0, -50.0, 120.0]), np.array([0.0, 10.0, 20.0, 15.0]))
    axes = draw_elo(("retreat", "sidestep", "self-1", "self-2"), ratings, 60_000).axes[0]
    np.testing.assert_allclose(axes.containers[0][0].get_xydata(), [[60.0, -50.0], [120.0, 120.0]])
    heights = {float(line.get_ydata()[0]) for line in axes.lines if line.get_linestyle() == "--"}
    assert heights == {0.0, 30.0}


def test_the_learning_rate_falls_over_all_generations(monkeypatch):
    rates, update = [], PPO.train

    def train(agent):
        update(agent)
        rates.append(agent.policy.optimizer.param_groups[0]["lr"])

    monkeypatch.setattr(PPO, "train", train)
    play_league(replace(SMALL, generations=3, bouts=1))
    ends = Ppo().learning_rate, Ppo().last_learning_rate
    np.testing.assert_allclose(rates, np.interp([1 / 3, 2 / 3, 1.0], [0.0, 1.0], ends))
