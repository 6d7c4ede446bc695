"""Playing seeded episodes of a controller, side by side and on many processors.

The results depend neither on the number of episodes side by side nor on where they are played.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.parallel import Task, Workers, one_thread, run_tasks
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo import Opponent, Opponents, Rules, command_to_action
from mecanum_env.tankendo.arena import Arena, TaskName
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.controllers.interface import Controller
from training.controllers.named import make_controller
from training.evaluate.metrics import Episode, Reason, Recording, Share, success_of, summarise

_TIMED: Final = 5
"""One command in this many is timed: on some machines reading the clock takes as long as a controller."""

ControllerFactory = Callable[[Arena, int, int], Controller]
"""Makes the controller of one episode from an arena, its row, and the episode's seed."""
Progress = Callable[[str, int], Any]
"""Called with the name of a finished job and the number of its episodes."""


@dataclass(frozen=True)
class Setup:
    """The robot, task and opponent of an evaluation."""

    model: Model
    """The robot that is simulated."""
    physics: RobotPlant = "planar"
    task: TaskName = "dodge"
    difficulty: str = "normal"
    opponent: Opponent | Opponents | None = None
    """Replaces the opponent of the difficulty; a distribution is drawn from for each episode."""
    senses: Senses | VariedSenses | None = None
    """The robot's senses, with an estimator behind them; None: the usual sensors."""
    randomize: Literal["none", "posterior"] = "none"
    known: Model | None = None
    """The robot as the controller knows it, used for the metrics; None: the same as `model`."""
    rules: Rules | None = None
    """Rules of the environment, which named controllers know; None: the default rules."""


@dataclass(frozen=True)
class Evaluation:
    """The result of an evaluation."""

    episodes: tuple[Episode, ...]
    """In the order of their seeds."""
    command_times_s: npt.NDArray[np.float64] = field(compare=False)
    """Processor time of one command in five, over all episodes [s]."""

    @property
    def success(self) -> Share:
        """The share of successes."""
        return success_of(self.episodes)


def controller_factory(name: str, known: Model) -> ControllerFactory:
    """Return a factory for `training.controllers.named.make_controller`; `known` is the robot that it knows.

    Raises:
        InputError: there is no such controller; raised when the first one is made.
    """
    return lambda arena, row, seed: make_controller(name, known, arena=arena, row=row, seed=seed)


def evaluate_controller(
    factory: ControllerFactory,
    setup: Setup,
    seeds: Iterable[int],
    *,
    rows: int = 64,
    progress: Callable[[], Any] | None = None,
) -> Evaluation:
    """Play one episode per seed, each begun by `reset(seed=...)` with a controller of its own.

    Except for the times, the result is the same, bit for bit, for any number of rows.

    Args:
        factory: makes the controllers.
        setup: robot, task and opponent.
        seeds: one per episode.
        rows: number of episodes side by side.
        progress: called at the end of each episode.

    Raises:
        InputError: there are no seeds or no rows, or the setup cannot be simulated.
    """
    waiting = list(seeds)
    if not waiting or rows < 1:
        raise InputError(f"episodes = {len(waiting)} in rows = {rows}, both must be at least 1")
    env = TankendoVectorEnv(
        min(rows, len(waiting)),
        task=setup.task,
        model=setup.model,
        plant=setup.physics,
        rules=setup.rules,
        difficulty=setup.difficulty,
        action_mode="command",
        opponent=setup.opponent,
        senses=setup.senses,
        randomize=setup.randomize,
        autoreset_mode="Disabled",
    )
    finished: list[tuple[Episode, tuple[float, ...]]] = []
    for recorded in _played(factory, env, iter(waiting)):
        episode = summarise(recorded, setup.known or setup.model, env.arena.setting.rules, setup.task)
        finished.append((episode, recorded.command_times_s))
        if progress is not None:
            progress()
    finished.sort(key=lambda one: one[0].seed)
    times = np.array([second for _, seconds in finished for second in seconds])
    return Evaluation(tuple(episode for episode, _ in finished), times)


def _played(
    factory: ControllerFactory, env: TankendoVectorEnv, waiting: Iterator[int]
) -> Iterator[Recording]:
    """Yield every episode as it ends; its row then begins the next waiting one."""
    arena, n = env.arena, env.num_envs
    seeds = [next(waiting) for _ in range(n)]
    observation, _ = env.reset(seed=seeds)
    players: list[_Recorder | None] = [
        _Recorder(arena, row, seed, factory(arena, row, seed)) for row, seed in enumerate(seeds)
    ]
    while any(player is not None for player in players):
        commands = np.zeros((n, 3))
        for row, player in enumerate(players):
            if player is not None:
                commands[row] = player.act(observation[row])
        # The environment's own step would begin new episodes unseeded and hide how the old ones ended.
        step = arena.step(command_to_action(commands))
        observation, over = step.observation, step.terminated | step.truncated
        for player, reward in zip(players, step.reward, strict=True):
            if player is not None:
                player.sample(float(reward))
        if not over.any():
            continue
        following: dict[int, int] = {}
        for row in np.flatnonzero(over).tolist():
            ended, players[row] = players[row], None
            if ended is not None:
                yield ended.recorded(bool(step.truncated[row]))
            if (seed := next(waiting, None)) is not None:
                seeds[row] = following[row] = seed
        # A row without a waiting episode repeats its last one, unrecorded.
        observation, _ = env.reset(seed=seeds, options={"reset_mask": over})
        for row, seed in following.items():
            players[row] = _Recorder(arena, row, seed, factory(arena, row, seed))


class _Recorder:
    """Plays and samples the episode in one row of an arena."""

    def __init__(self, arena: Arena, row: int, seed: int, controller: Controller) -> None:
        self._arena, self._row, self._seed, self._controller = arena, row, seed, controller
        fights = arena.setting.task != "track"
        technique = arena.setting.opponent.techniques[int(arena.fighter.technique()[row])]
        self._technique = technique.name if fights else ""
        # Drawn at the start, so it is known even if the episode ends before a strike.
        self._warning_s = float(arena.fighter.drawn(arena.chance.warning)[row]) if fights else None
        self._samples: list[list[float]] = []
        self._times: list[float] = []
        self.sample(0.0)

    def act(self, observation: npt.NDArray[np.float32]) -> tuple[int, int, int]:
        """Return the controller's command; measure the time of some of them."""
        if (self._seed + len(self._samples)) % _TIMED != 0:
            return self._controller.act(observation)
        begin = time.process_time()
        command = self._controller.act(observation)
        self._times.append(time.process_time() - begin)
        return command

    def sample(self, reward: float) -> None:
        """Record the present state and the reward of the step that led to it."""
        arena, row = self._arena, self._row
        distance, bearing = (float(values[row]) for values in arena.scenes.separation())
        now, guarded = float(arena.time_s()[row]), float(arena.fighter.sword.idle(arena.time_s())[row])
        actual = body_velocity(arena, row)
        self._samples.append([now, distance, bearing, *arena.commands[row], *actual, guarded, reward])

    def recorded(self, truncated: bool) -> Recording:
        """Return the whole episode; call it when it has ended."""
        arena, row = self._arena, self._row
        table = np.array(self._samples)
        return Recording(
            seed=self._seed,
            success=bool(arena.succeeded[row]),
            reason=_why_failed(arena, row, truncated),
            technique=self._technique,
            warning_s=self._warning_s,
            command_times_s=tuple(self._times),
            time_s=table[:, 0],
            distance_m=table[:, 1],
            bearing_rad=table[:, 2],
            commands=table[:, 3:6],
            actual=table[:, 6:9],
            guarded=table[:, 9],
            reward=table[:, 10],
        )


def body_velocity(arena: Arena, row: int) -> FloatArray:
    """Return the velocity of the robot in a row of an arena: ahead, left [m/s], turn [rad/s], shape (3,)."""
    yaw, vx, vy, turn = arena.scenes.now[2:6, row]
    cos, sin = np.cos(yaw), np.sin(yaw)
    return np.array([cos * vx + sin * vy, cos * vy - sin * vx, turn])


def _why_failed(arena: Arena, row: int, truncated: bool) -> Reason:
    """Return why the episode in a row has failed, before the row is reset; empty for a success."""
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


@dataclass(frozen=True)
class Job:
    """Episodes with consecutive seeds to play; it can be sent to another process."""

    name: str
    """Shown by the progress bar."""
    controller: str
    """Name of a controller, which knows `setup.known`."""
    setup: Setup
    episodes: int
    first_seed: int = 0

    def play(self) -> Evaluation:
        """Play the episodes."""
        factory = controller_factory(self.controller, self.setup.known or self.setup.model)
        return evaluate_controller(
            factory, self.setup, range(self.first_seed, self.first_seed + self.episodes)
        )


def play_jobs(
    jobs: Mapping[str, Job], workers: Workers | None = None, progress: Progress | None = None
) -> dict[str, Evaluation]:
    """Return the evaluation of each job, under its key.

    The first job is played alone in this process: a controller that cannot be made is refused before any
    other process starts, and its times per command are measured while nothing else of this program runs.

    Args:
        jobs: at least one job.
        workers: where the other jobs are played; by default on all processors of this machine.
        progress: called after each job.

    Raises:
        InputError: the first failing job raised it, or the workers cannot be had.
    """

    def done(job: Job, evaluation: Evaluation) -> Evaluation:
        if progress is not None:
            progress(job.name, job.episodes)
        return evaluation

    first, *others = jobs
    with one_thread():
        alone = done(jobs[first], jobs[first].play())
    # The longest jobs first, so that the processes end together.
    order = sorted(others, key=lambda key: (jobs[key].setup.physics != "rollers", -jobs[key].episodes))
    tasks = [Task(jobs[key].name, jobs[key].play) for key in order]
    played = run_tasks(tasks, workers, lambda index, evaluation: done(jobs[order[index]], evaluation))
    found = {first: alone, **dict(zip(order, played, strict=True))}
    return {key: found[key] for key in jobs}
