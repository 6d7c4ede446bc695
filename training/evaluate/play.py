"""Playing seeded episodes of a controller, many side by side; the result does not depend on how many."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import Opponent, command_to_action
from mecanum_env.tankendo.arena import Arena, TaskName
from mecanum_env.tankendo.vector import TankendoVectorEnv
from training.controllers.interface import Controller
from training.controllers.named import make_controller
from training.evaluate.episode import Ending, Episode, Reason, Trace, summarise

_TIMED: Final = 5  # one command in so many is timed: where clocks are slow, they take as long as a controller

Maker = Callable[[Arena, int, int], Controller]
"""Return the controller of one episode: of an arena, its row, and the episode's seed."""


@dataclass(frozen=True)
class Setup:
    """What is played on."""

    model: Model
    """The robot that moves."""
    physics: RobotPlant = "planar"
    task: TaskName = "dodge"
    difficulty: str = "normal"
    opponent: Opponent | None = None
    """In place of the difficulty's."""
    randomize: Literal["none", "posterior"] = "none"
    known: Model | None = None
    """The robot as the controller knows it: kinematics and ceiling of its figures; None: the same."""


@dataclass(frozen=True)
class Evaluation:
    """What came of it."""

    episodes: tuple[Episode, ...]
    """In the order of their seeds."""
    command_times_s: npt.NDArray[np.float64] = field(compare=False)
    """Processor time of the controller for a command, one command in five, all episodes [s]; of the machine,
    but not of what else runs on it."""


def named_maker(name: str, known: Model) -> Maker:
    """Return a maker of a controller by its name.

    Args:
        name: as for `training.controllers.named.make_controller`.
        known: the robot as the controller knows it.

    Raises:
        InputError: no such controller, when the first is made.
    """
    return lambda arena, row, seed: make_controller(name, known, arena=arena, row=row, seed=seed)


def evaluate(
    maker: Maker,
    setup: Setup,
    seeds: Iterable[int],
    *,
    rows: int = 64,
    progress: Callable[[], Any] | None = None,
) -> Evaluation:
    """Play one episode a seed, each with a controller of its own, begun by `reset(seed=...)`.

    The result is the same, bit for bit but for the times, whatever the number of rows.

    Args:
        maker: makes the controllers.
        setup: what is played on.
        seeds: one an episode.
        rows: episodes side by side.
        progress: called at the end of each episode.

    Raises:
        InputError: no seed or no row, or a setup that cannot be simulated.
    """
    waiting = list(seeds)
    if not waiting or rows < 1:
        raise InputError(f"{len(waiting)} episodes on {rows} rows, must be at least 1 and 1")
    env = TankendoVectorEnv(
        min(rows, len(waiting)),
        task=setup.task,
        model=setup.model,
        plant=setup.physics,
        difficulty=setup.difficulty,
        action_mode="command",
        opponent=setup.opponent,
        randomize=setup.randomize,
        autoreset_mode="Disabled",
    )
    finished: list[tuple[Episode, tuple[float, ...]]] = []
    for trace, ending in _played(maker, env, iter(waiting)):
        known = setup.model if setup.known is None else setup.known
        rules = env.arena.setting.rules
        finished.append((summarise(trace, ending, known, rules, setup.task), ending.command_times_s))
        if progress is not None:
            progress()
    finished.sort(key=lambda one: one[0].seed)
    times = np.array([second for _, seconds in finished for second in seconds])
    return Evaluation(tuple(episode for episode, _ in finished), times)


class _Recorder:
    """Collects one row's samples."""

    def __init__(self, arena: Arena, row: int, seed: int, controller: Controller) -> None:
        self._arena, self._row, self.seed, self.controller = arena, row, seed, controller
        fights = arena.setting.task != "track"
        technique = arena.setting.opponent.techniques[int(arena.fighter.technique()[row])]
        self._technique = technique.name if fights else ""
        # Drawn with the episode: known, too, where the controller never lets it come to a strike.
        self._warning = float(arena.fighter.drawn(arena.chance.warning)[row]) if fights else None
        self._samples: list[list[float]] = []
        self._times: list[float] = []
        self.sample(0.0)

    def act(self, observation: npt.NDArray[np.float32]) -> tuple[int, int, int]:
        """Ask the controller, and now and then note how long it takes."""
        if (self.seed + len(self._samples)) % _TIMED != 0:
            return self.controller.act(observation)
        begin = time.process_time()
        command = self.controller.act(observation)
        self._times.append(time.process_time() - begin)
        return command

    def sample(self, reward: float) -> None:
        """Note what is now, and the reward of the step that brought it."""
        arena, row = self._arena, self._row
        distance, bearing = (float(values[row]) for values in arena.scenes.separation())
        yaw, vx, vy, turn = (float(value) for value in arena.scenes.now[2:6, row])
        cos, sin = np.cos(yaw), np.sin(yaw)
        guarded = float(arena.fighter.sword.idle(arena.time_s())[row])
        actual = (cos * vx + sin * vy, cos * vy - sin * vx, turn)
        now = float(arena.time_s()[row])
        self._samples.append([now, distance, bearing, *arena.commands[row], *actual, guarded, reward])

    def trace(self) -> Trace:
        """Return all samples."""
        table = np.array(self._samples)
        return Trace(
            time_s=table[:, 0],
            distance_m=table[:, 1],
            bearing_rad=table[:, 2],
            commands=table[:, 3:6],
            actual=table[:, 6:9],
            guarded=table[:, 9],
            reward=table[:, 10],
        )

    def ending(self, truncated: bool) -> Ending:
        """Return how the episode ended, now that it has."""
        arena, row = self._arena, self._row
        return Ending(
            seed=self.seed,
            success=bool(arena.succeeded[row]),
            reason=why_failed(arena, row, truncated),
            technique=self._technique,
            warning_s=self._warning,
            command_times_s=tuple(self._times),
        )


def why_failed(arena: Arena, row: int, truncated: bool) -> Reason:
    """Return why an episode that has just ended is no success; empty if it is one.

    Args:
        arena: before the next reset.
        row: which episode.
        truncated: whether the time limit ended it.
    """
    rules, task = arena.setting.rules, arena.setting.task
    if arena.succeeded[row]:
        return ""
    if float(arena.scenes.separation()[0][row]) < rules.clash_m:
        return "clash"
    if np.max(np.abs(arena.scenes.now[:2, row])) > rules.field_m / 2:
        return "left the field"
    if task == "track":
        return "not kept"
    if task == "duel":
        return "time over" if truncated else "lost"
    if arena.hit[row]:
        return "hit"
    if not truncated:
        return "not back at maai"
    pending = bool(arena.fighter.pending[row]) or bool(arena.fighter.has_struck(arena.time_s())[row])
    return "time over" if pending else "no opening"


def _played(maker: Maker, env: TankendoVectorEnv, waiting: Iterator[int]) -> Iterator[tuple[Trace, Ending]]:
    """Yield every episode as it ends; a row that ends one begins the next that waits."""
    arena, n = env.arena, env.num_envs
    seeds = [next(waiting) for _ in range(n)]
    observation, _ = env.reset(seed=seeds)
    players: list[_Recorder | None] = [
        _Recorder(arena, row, seed, maker(arena, row, seed)) for row, seed in enumerate(seeds)
    ]
    while any(player is not None for player in players):
        commands = np.zeros((n, 3))
        for row, player in enumerate(players):
            if player is not None:
                commands[row] = player.act(observation[row])
        # The environment's own step would begin new episodes unseeded, and hide how the old ones ended.
        step = arena.step(command_to_action(commands))
        observation, over = step.observation, step.terminated | step.truncated
        for player, reward in zip(players, step.reward, strict=True):
            if player is not None:
                player.sample(float(reward))
        if not over.any():
            continue
        following: dict[int, int] = {}
        for row in np.flatnonzero(over).tolist():
            ended = players[row]
            if ended is not None:
                yield ended.trace(), ended.ending(bool(step.truncated[row]))
            players[row] = None
            seed = next(waiting, None)
            if seed is not None:
                seeds[row] = following[row] = seed
        # A row for which nothing waits plays its last episode again, unseen.
        observation, _ = env.reset(seed=seeds, options={"reset_mask": over})
        for row, seed in following.items():
            players[row] = _Recorder(arena, row, seed, maker(arena, row, seed))
