"""The oracle: what it rehearses comes true, and no controller wins where it does not, but by chance."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.effects.apply import delayed
from mecanum_env.model import paper_model
from mecanum_env.tankendo import Opponent, Opponents
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.certify.plants import robot_level
from training.controllers.dodges import random_scripts
from training.controllers.named import make_controller
from training.controllers.oracle import rehearse

EPISODES = 8
BEATEN_BY_CHANCE = 2
PLANTS = {"late": delayed(paper_model(), 0.1), "robot-level": robot_level(paper_model())}


@pytest.fixture(scope="module")
def won(play):
    """Return a function that returns which episodes a controller that knows the paper's model wins."""

    def seeds(name, plant, **setup):
        played = play(name, EPISODES, PLANTS[plant], known=paper_model(), **setup)
        return {one.seed for one in played if one.success}

    return seeds


@pytest.fixture(scope="module")
def bounds(won):
    return {plant: won("oracle", plant) for plant in PLANTS}


@pytest.mark.parametrize("name", ["sidestep", "creep", "policy"])
@pytest.mark.parametrize("plant", PLANTS)
def test_no_controller_beats_it_by_more_than_chance(bounds, won, name, plant):
    assert len(won(name, plant) - bounds[plant]) <= BEATEN_BY_CHANCE
    assert len(bounds[plant]) >= len(won(name, plant))


def begun(model, **arguments):
    env = TankendoVectorEnv(2, model=model, action_mode="command", **arguments)
    env.reset(seed=100_003)
    return env


@pytest.mark.parametrize(
    ("model", "arguments"),
    [
        (PLANTS["late"], {}),
        (paper_model().with_effect("command_latency/jitter", delay_s=0.05, jitter_s=0.02), {}),
        (paper_model(), {"opponent": Opponents()}),
        (paper_model(), {"randomize": {"robot.mass_kg": (15.0, 30.0)}}),
    ],
    ids=["late", "jitter", "opponents", "robots"],
)
def test_the_episode_goes_as_rehearsed(model, arguments):
    """Scripts played on copies and their commands on the environment itself end in the same scene."""
    env = begun(model, **arguments)
    scripts = random_scripts(6, np.random.default_rng(0))
    played = rehearse(env.arena, 1, scripts)
    copies = env.arena.copies(1, 6)
    for commands in played.commands[:30]:
        copies.step(commands / (135.0, 180.0, 100.0))
        env.arena.step(np.repeat(commands[:1], 2, axis=0) / (135.0, 180.0, 100.0))
    np.testing.assert_array_equal(env.arena.scenes.now[:, 1], copies.scenes.now[:, 0])
    np.testing.assert_array_equal(env.arena.fighter.sword.land_s[1], copies.fighter.sword.land_s[0])


def test_it_does_not_answer_a_strike_before_it_can_be_seen():
    """Until then the commands of its plan are those of a script without any evasion."""
    env = begun(paper_model(), opponent=Opponent(feint_probability=0.0))
    scripts = random_scripts(4, np.random.default_rng(1))
    waits = replace(scripts, evade_s=np.full(4, -1.0))
    first, second = (rehearse(env.arena, 0, one).commands for one in (scripts, waits))
    copies = env.arena.copies(0, 4)
    for step in range(min(len(first), len(second))):
        seen = copies.fighter.sword.raise_s <= copies.time_s() - 0.05
        rises = copies.fighter.pending & seen
        np.testing.assert_array_equal(first[step][~rises], second[step][~rises])
        if rises.any():
            break
        copies.step(first[step] / (135.0, 180.0, 100.0))


def test_it_plans_nothing_before_an_episode_has_begun():
    env = TankendoVectorEnv(1, action_mode="command")
    controller = make_controller("oracle", paper_model(), arena=env.arena)
    observation, _ = env.reset(seed=0)
    assert all(isinstance(number, int) for number in controller.act(observation[0]))
