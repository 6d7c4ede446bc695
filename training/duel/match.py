"""Many bouts of two controllers, side by side, and their result."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import require_at_least
from mecanum_env.model import Model, paper_model
from mecanum_env.statistics import wilson_interval
from mecanum_env.tankendo.actions import command_to_action
from mecanum_env.tankendo.bout import DuelArena, duel_arena
from mecanum_env.tankendo.observation import SIZE
from training.controllers.interface import Command, Controller
from training.controllers.named import make_controller
from training.controllers.policy import Policy

_SIDE_BY_SIDE: Final = 64
"""Bouts in one batch."""


class Player:
    """A controller in a bout; it is shown as much of the observation as it knows.

    That is all 23 numbers for a policy that was trained for them, and the 20 of every task for all others.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._size = controller.network.observation_size if isinstance(controller, Policy) else SIZE

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (23,)."""
        return self._controller.act(observation[: self._size])


PlayerFactory = Callable[[int], Player]
"""Makes a player that is ready for a bout, by a seed for what it draws."""


def player_factory(name: str, model: Model | None = None) -> PlayerFactory:
    """Return what makes players of a name, or of a policy's path, that know the robot's `model`.

    Raises:
        InputError: there is no such controller, or it needs to know the simulator.
    """
    known = paper_model() if model is None else model
    make_controller(name, known)  # refused now, not in the middle of a match
    return lambda seed: Player(make_controller(name, known, seed=seed))


@dataclass(frozen=True)
class Result:
    """The result of a match between A and B."""

    bouts: int
    won: int
    """Bouts that A won."""
    lost: int
    """Bouts that B won."""
    points: int
    """Points of A."""
    points_against: int
    """Points of B."""
    seconds: float
    """Mean length of a bout [s]."""

    @property
    def drawn(self) -> int:
        """Bouts that nobody won."""
        return self.bouts - self.won - self.lost

    @property
    def score(self) -> float:
        """Wins of A and half the draws, as a share."""
        return (self.won + 0.5 * self.drawn) / self.bouts

    def shares(self) -> dict[str, tuple[float, float, float]]:
        """Return the shares of wins of A, of B and of draws, each with Wilson's 95 % interval."""
        counts = {"A": self.won, "B": self.lost, "draw": self.drawn}
        return {who: (n / self.bouts, *wilson_interval(n, self.bouts)) for who, n in counts.items()}


def play_match(
    first: PlayerFactory, second: PlayerFactory, bouts: int, *, first_seed: int = 0, **arena: Any
) -> Result:
    """Let A, made by `first`, and B, made by `second`, fight a number of bouts.

    Bouts 2 k and 2 k + 1 have the seed `first_seed` + k, the second one with exchanged players: both meet the
    same starts, the same chance of the swords and the same noise. `arena` are arguments of `duel_arena`.

    Raises:
        InputError: no bout at all, or arguments that the arena refuses.
    """
    require_at_least(1, bouts=bouts)
    won = np.zeros(3, int)  # A, B, nobody
    points, steps = np.zeros(2, int), 0
    for start in range(0, bouts, _SIDE_BY_SIDE):
        numbers = range(start, min(start + _SIDE_BY_SIDE, bouts))
        world = duel_arena(len(numbers), action_mode="command", **arena)
        for place, number in enumerate(numbers):
            rng = np.random.default_rng(first_seed + number // 2)
            world.begin([place], [rng], swapped=number % 2 == 1)
        players = [make(number) for make in (first, second) for number in numbers]
        for ended in play_bouts(world, players):
            for bout in ended:
                won[("first", "second", "draw").index(world.results()[bout] or "draw")] += 1
                points += world.judge.points[:, bout]  # type: ignore[attr-defined]
                steps += int(world.step_count[bout])
    return Result(
        bouts, int(won[0]), int(won[1]), int(points[0]), int(points[1]), steps * world.step_s / bouts
    )


def play_bouts(world: DuelArena, players: list[Player]) -> Iterator[list[int]]:
    """Play all bouts of an arena to their ends; yield after each step which bouts have ended with it.

    `players` are those of all rows, and `world` has the action mode "command".
    """
    running = np.ones(world.bouts, bool)
    while running.any():
        seen = world.observe()
        both = np.concatenate([running, running])
        # Who has finished stands still, unseen.
        commands = [
            player.act(one) if plays else (0, 0, 0)
            for player, one, plays in zip(players, seen, both, strict=True)
        ]
        world.step(command_to_action(np.array(commands, float)))
        ended = running & world.ended[: world.bouts]
        running &= ~ended
        yield np.flatnonzero(ended).tolist()
