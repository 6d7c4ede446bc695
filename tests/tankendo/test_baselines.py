"""Success of simple controllers: lower on harder levels, and alike on both plants."""

import numpy as np
import pytest

from mecanum_env.kinematics import command_to_wheels
from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.constants import DIFFICULTIES
from training.controllers import Oracle, RandomMotion, Retreat, Still

MAKERS = {
    "random": lambda arena, row: RandomMotion(row),
    "still": lambda arena, row: Still(),
    "retreat": lambda arena, row: Retreat(),
    "oracle": Oracle,
}


@pytest.fixture(scope="module")
def scores(play):
    """Return the share of successes on the planar plant, by controller and level."""
    numbers = {"random": 30, "still": 30, "retreat": 80, "oracle": 20}
    return {
        name: [float(play(MAKERS[name], n, difficulty=level)["is_success"].mean()) for level in DIFFICULTIES]
        for name, n in numbers.items()
    }


@pytest.mark.parametrize("name", MAKERS)
def test_harder_is_harder_for_every_baseline(scores, name):
    easy, normal, hard = scores[name]
    # One episode of slack: the oracle loses next to none on two levels.
    assert easy >= normal - 0.03
    assert normal >= hard - 0.03


def test_it_is_no_game_of_chance_and_no_flight_but_can_be_won(scores):
    assert scores["random"][1] <= 0.1
    assert scores["still"][1] <= 0.05
    assert 0.4 <= scores["retreat"][1] <= 0.75
    assert scores["oracle"][1] >= 0.9


@pytest.mark.parametrize("seed", range(3))
def test_the_planar_plant_goes_where_the_rollers_go(begin, seed):
    """Held commands: the paths agree within 4 % of their length; rollers lose 2 % sideways by geometry."""
    rng = np.random.default_rng(seed)
    ends, length = [], 0.0
    commands = np.stack(
        [rng.integers(20, 70, 6), rng.integers(-180, 180, 6), rng.integers(-20, 20, 6)], axis=-1
    )
    for plant in ("planar", "rollers"):
        robots = begin(plant=plant).robots
        robots.restart(0, (0.0, 0.0, 0.4))
        path = [robots.motion()[:2, 0]]
        for command in np.repeat(commands, 5, axis=0):
            robots.step(command[None].astype(float))
            path.append(robots.motion()[:2, 0])
        ends.append(path[-1])
        length = float(np.sum(np.linalg.norm(np.diff(path, axis=0), axis=1)))
    assert np.linalg.norm(ends[0] - ends[1]) <= 0.04 * length


def test_controllers_give_whole_numbers_within_the_ceiling(begin):
    arena = begin(6)
    observation = arena.observe()
    for name, maker in MAKERS.items():
        player = maker(arena, 0)
        player.reset()
        command = player.act(observation[0])
        assert all(isinstance(number, int) for number in command), name
        assert np.max(np.abs(command_to_wheels(*command))) <= 240.0
        arena.step(np.tile(command_to_action(command), (6, 1)))
