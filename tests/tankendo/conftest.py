"""Fixtures for the tests of the environments."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from mecanum_env.tankendo import command_to_action
from mecanum_env.tankendo.build import Episodes, build
from mecanum_env.tankendo.env import TankendoEnv


@pytest.fixture
def make() -> Iterator[Callable[..., TankendoEnv]]:
    """Return a maker of environments that are closed after the test."""
    made: list[TankendoEnv] = []

    def one(**arguments: Any) -> TankendoEnv:
        made.append(TankendoEnv(**arguments))
        return made[-1]

    yield one
    for env in made:
        env.close()


def side_by_side(n: int, **arguments: Any) -> Episodes:
    """Return n episodes side by side, seeded 0 .. n-1 and begun."""
    built = build(n, **{"action_mode": "command", **arguments})
    built.restart(range(n), [np.random.default_rng(row) for row in range(n)])
    return built


@pytest.fixture(scope="session")
def begin() -> Callable[..., Any]:
    """Return a function that begins n episodes and returns their arena."""
    return lambda n=1, **arguments: side_by_side(n, **arguments).arena


@pytest.fixture(scope="session")
def play() -> Callable[..., dict[str, np.ndarray]]:
    """Return a function that plays one episode with each of n controllers and returns the last infos."""

    def until_the_end(controllers: Callable[[Any, int], Any], n: int, **arguments: Any) -> dict[str, Any]:
        arena = side_by_side(n, **arguments).arena
        players = [controllers(arena, row) for row in range(n)]
        for player in players:
            player.reset()
        observation = arena.observe()
        over = np.zeros(n, bool)
        last: dict[str, list[Any]] = {}
        while not over.all():
            commands = [
                (0, 0, 0) if done else player.act(seen)
                for player, seen, done in zip(players, observation, over, strict=True)
            ]
            step = arena.step(command_to_action(commands))
            observation = step.observation
            for row in np.flatnonzero((step.terminated | step.truncated) & ~over):
                over[row] = True
                for name, values in step.info.items():
                    last.setdefault(name, [None] * n)[row] = values[row]
        return {name: np.array(values) for name, values in last.items()}

    return until_the_end
