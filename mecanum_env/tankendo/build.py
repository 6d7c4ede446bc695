"""From the arguments of `gymnasium.make` and `reset` to episodes; shared by one environment and many."""

from __future__ import annotations

import operator
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from numbers import Real
from typing import Any, Literal, TypedDict, Unpack, get_args

import gymnasium
import numpy as np

from mecanum_env.batch import Variations, planar_robot
from mecanum_env.errors import InputError, did_you_mean, require_one_of
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.senses import Senses, VariedSenses
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.actions import ActionMode
from mecanum_env.tankendo.arena import Arena, Robot, Step, TaskName, TaskSetting
from mecanum_env.tankendo.chance import DRAWN, Start
from mecanum_env.tankendo.constants import (
    Opponent,
    RewardWeights,
    Rules,
    Sensors,
    opponent_for,
    require_number,
)
from mecanum_env.tankendo.opponents import OpponentLike, Opponents
from mecanum_env.tankendo.plant import DEFAULT_TIMESTEP_S, DrawnRobots
from mecanum_env.tankendo.randomize import Pool, Randomize, Sampler, sampler_for
from mecanum_env.tankendo.scene import BoolArray
from mecanum_env.units import FloatArray

Engine = Literal["mujoco", "arrays"]
Drawn = Callable[[Sequence[np.random.Generator]], Sequence[Robot]]
ModelLike = Model | str | os.PathLike[str]


@dataclass(frozen=True)
class Episodes:
    """Episodes side by side, with all that Gymnasium's two interfaces share."""

    arena: Arena
    drawn: Drawn | None
    """Draws the robots of episodes; None: every episode has the common model."""
    plant: RobotPlant

    def restart(self, rows: Sequence[int], rngs: Sequence[np.random.Generator], start: Start = DRAWN) -> None:
        """Begin episodes in some rows, with the generators `rngs` of their environments."""
        robots = None if self.drawn is None else self.drawn(rngs)
        self.arena.restart(rows, rngs, robots, start)

    def step(self, actions: FloatArray, ignored: BoolArray | None = None) -> Step:
        """Send actions, shape (n, 3), and simulate one command period in all rows.

        The caller throws away the results of the rows `ignored`, shape (n,), whose episodes are over.

        Raises:
            gymnasium.error.ResetNeeded: a row in which no episode has begun, or it is over.
        """
        arena = self.arena
        if not arena.all_begun:
            raise gymnasium.error.ResetNeeded("step() before an episode has begun; call reset() first")
        over = arena.ended if ignored is None else arena.ended & ~ignored
        if np.count_nonzero(over):
            raise gymnasium.error.ResetNeeded("step() after an episode is over; call reset() first")
        return arena.advance(actions)

    def start_of(self, options: Mapping[str, Any] | None, *others: str) -> Start:
        """Return what the options of a reset fix; `others` are names of options that the caller reads itself.

        Raises:
            InputError: another option, or a value that does not fit; the message says what would.
        """
        if options is None:
            return DRAWN
        if not isinstance(options, Mapping):
            raise InputError(f'options = {options!r}, must be a dictionary such as {{"technique": "men"}}')
        known = ("technique", "start", *others)
        for name in options:
            if name not in known:
                raise InputError(
                    f'options: no "{name}"{did_you_mean(name, known)}, known are {", ".join(known)}'
                )
        return Start(
            self._technique(options["technique"]) if "technique" in options else None,
            self._pose(options["start"]) if "start" in options else None,
        )

    def _technique(self, value: Any) -> int:
        setting = self.arena.setting
        if setting.task == "track":
            raise InputError('options: technique: the opponent does not strike in the task "track"')
        names = [technique.name for technique in setting.opponent.techniques]
        if value in names:
            return names.index(value)
        try:
            index = -1 if isinstance(value, bool) else operator.index(value)
        except TypeError:
            index = -1
        if not 0 <= index < len(names):
            raise InputError(
                f"options: technique = {value!r}{did_you_mean(value, names)}, must be {', '.join(names)} or "
                f"an index 0 .. {len(names) - 1}"
            )
        return index

    def _pose(self, value: Any) -> tuple[float, float, float]:
        try:
            x, y, yaw = (float(number) for number in value)
        except (TypeError, ValueError):
            x = y = yaw = np.nan
        if not np.isfinite([x, y, yaw]).all():
            raise InputError(
                f"options: start = {value!r}, must be three finite numbers: x [m], y [m], yaw [rad]"
            )
        rules = self.arena.setting.rules
        half = rules.field_m / 2
        farthest = half - rules.start_m[1]
        if not (-half <= x <= farthest and -half <= y <= half):
            raise InputError(
                f"options: start = {value!r}, must be in the field: x {-half:g} .. {farthest:g} m, "
                f"y {-half:g} .. {half:g} m (the opponent starts up to {rules.start_m[1]:g} m ahead in x)"
            )
        return x, y, yaw

    def action_space(self) -> gymnasium.spaces.Box:
        """Return the space of one action."""
        return gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)

    def observation_space(self) -> gymnasium.spaces.Box:
        """Return the space of one observation."""
        limits = self.arena.setting.observation_limits
        return gymnasium.spaces.Box(-limits, limits, dtype=np.float32)


class TaskArguments(TypedDict, total=False):
    """Arguments of `setting_of`, for type checkers."""

    task: TaskName
    difficulty: str
    action_mode: ActionMode
    observation_delay: float | None
    opponent: OpponentLike | None
    reward_weights: Mapping[str, float] | RewardWeights | None
    rules: Rules | None
    senses: Senses | VariedSenses | None
    sensors: Sensors | None


class Arguments(TaskArguments, total=False):
    """Arguments of `TankendoEnv`, for type checkers; `build` has their defaults."""

    model: ModelLike | None
    plant: RobotPlant
    randomize: Randomize
    timestep_s: float | None


def build(
    n: int,
    threads: int = 1,
    *,
    model: ModelLike | None = None,
    plant: RobotPlant = "planar",
    randomize: Randomize = "none",
    timestep_s: float | None = None,
    engine: Engine = "mujoco",
    device: str | None = None,
    **task: Unpack[TaskArguments],
) -> Episodes:
    """Build n episodes side by side, whose physics is stepped by a number of threads.

    The `engine` and its `device` are documented in `TankendoVectorEnv`; `model`, `plant`, `randomize`,
    `timestep_s` and the arguments of the `task` (`setting_of`) in `TankendoEnv`.

    Raises:
        InputError: an argument that cannot be used; the message says what could.
    """
    setting = setting_of(**task)
    if timestep_s is not None:
        require_number("timestep_s", timestep_s, 0.0, strict=True)
    robot = model_of(model)
    sampler = sampler_for(randomize, robot)
    compiler = _compiler(engine, plant, timestep_s, device)
    drawn: Drawn | None = None
    if isinstance(sampler, Pool):
        compiler = _Once(compiler)
    compiled = compiler(robot) if sampler is None else _typical(sampler, compiler)
    if isinstance(sampler, Sampler) and engine == "arrays":
        drawn = _AtOnce(sampler, timestep_s)
    elif sampler is not None:
        drawn = _OneByOne(sampler, compiler)
    return Episodes(Arena(setting, compiled, n, threads, device), drawn, plant)


def model_of(model: ModelLike | None) -> Model:
    """Return a model that was given as it is or as a file's path; None: the packaged one.

    Raises:
        InputError: it is neither, or there is no such file, or it holds no model.
    """
    if not isinstance(model, Model | str | os.PathLike | None):
        raise InputError(f"model = {model!r}, must be a model file's path or a mecanum_env.model.Model")
    if isinstance(model, Model):
        return model
    return paper_model() if model is None else read_model(model)


def setting_of(
    *,
    task: TaskName = "dodge",
    difficulty: str = "normal",
    action_mode: ActionMode = "cartesian",
    observation_delay: float | None = None,
    opponent: OpponentLike | None = None,
    reward_weights: Mapping[str, float] | RewardWeights | None = None,
    rules: Rules | None = None,
    senses: Senses | VariedSenses | None = None,
    sensors: Sensors | None = None,
) -> TaskSetting:
    """Return what is the same in every episode, by the arguments that `TankendoEnv` documents.

    They are `task`, `difficulty`, `action_mode`, `observation_delay`, `opponent`, `reward_weights`, `rules`,
    `senses` and `sensors`.

    Raises:
        InputError: an argument that cannot be used; the message says what could.
    """
    if isinstance(opponent, Mapping):
        opponent = Opponents(opponent_for(difficulty), opponent)
    opponents: Opponents | None = None
    if isinstance(opponent, Opponents):
        opponents, opponent = opponent, opponent.base
    given = (("opponent", opponent, Opponent), ("rules", rules, Rules), ("sensors", sensors, Sensors))
    for name, value, kind in given:
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{name} = {value!r}, must be a mecanum_env.tankendo.{kind.__name__}")
    if not isinstance(senses, Senses | VariedSenses | None):
        raise InputError(f"senses = {senses!r}, must be a mecanum_env.senses.Senses or VariedSenses")
    sensors = Sensors() if sensors is None else sensors
    delay_s: Any = sensors.delay_s if observation_delay is None else observation_delay
    if not (isinstance(delay_s, Real) and 0.0 <= float(delay_s) <= 1.0):
        raise InputError(f"observation_delay = {delay_s!r}, must be seconds from 0 to 1")
    if not isinstance(reward_weights, RewardWeights):
        if not isinstance(reward_weights, Mapping | None):
            raise InputError(f'reward_weights = {reward_weights!r}, must be terms by name, {{"hit": 2.0}}')
        reward_weights = RewardWeights().replaced(reward_weights or {})
    return TaskSetting(
        task=task,
        opponent=opponent_for(difficulty) if opponent is None else opponent,
        rules=Rules() if rules is None else rules,
        sensors=replace(sensors, delay_s=float(delay_s)),
        weights=reward_weights,
        action_mode=action_mode,
        opponents=opponents,
        senses=senses,
    )


def _compiler(
    engine: Engine, plant: RobotPlant, timestep_s: float | None, device: str | None
) -> Callable[[Model], Robot]:
    """Return the function that makes a model ready for an engine.

    Raises:
        InputError: no such engine, or what it does not do.
    """
    require_one_of("engine", engine, get_args(Engine))
    if engine == "mujoco":
        if device is not None:
            raise InputError(f'device = {device!r}: only engine="arrays" has one')
        require_one_of("plant", plant, DEFAULT_TIMESTEP_S)
        return DrawnRobots(plant, timestep_s)
    if plant != "planar":
        raise InputError(f'engine = "arrays" has no rollers; leave out plant = {plant!r}, or the engine')
    return partial(planar_robot, timestep_s=timestep_s)


@dataclass(frozen=True)
class _OneByOne:
    """Draws robots and compiles them one after the other."""

    sampler: Sampler | Pool
    compiler: Callable[[Model], Robot]

    def __call__(self, rngs: Sequence[np.random.Generator]) -> list[Robot]:
        """Return a robot drawn with each of the generators."""
        return [self.compiler(self.sampler.draw(rng)) for rng in rngs]


class _AtOnce:
    """Draws robots for the engine of arrays, which computes them all at once where it can."""

    def __init__(self, sampler: Sampler, timestep_s: float | None) -> None:
        self._sampler, rng = sampler, np.random.default_rng(0)
        first = np.stack([*(sampler.numbers(rng) for _ in range(4)), *sampler.ends()], axis=-1)
        self._variations = Variations(sampler.model, sampler.names, sampler.model_of, first, timestep_s)

    def __call__(self, rngs: Sequence[np.random.Generator]) -> Sequence[Robot]:
        """Return a robot drawn with each of the generators."""
        return self._variations.robots(np.stack([self._sampler.numbers(rng) for rng in rngs], axis=-1))


class _Once:
    """A compiler that compiles every model once: robots of a pool come again and again."""

    def __init__(self, compiler: Callable[[Model], Robot]) -> None:
        self._compiler = compiler
        self._known: dict[int, tuple[Model, Robot]] = {}

    def __call__(self, model: Model) -> Robot:
        """Return the model, ready for the physics."""
        known = self._known.get(id(model))
        # A copy of this object has copies of the models, which are others.
        if known is None or known[0] is not model:
            known = self._known[id(model)] = (model, self._compiler(model))
        return known[1]


def _typical(sampler: Sampler | Pool, compiler: Callable[[Model], Robot]) -> Robot:
    """Return one drawn robot: with its effects it may have more bodies than the model's own.

    Raises:
        InputError: a robot that may be drawn cannot be simulated.
    """
    try:
        for edge in sampler.edges():
            compiler(edge)
    except InputError as error:
        raise InputError(f"randomize: {error}") from error
    return compiler(sampler.draw(np.random.default_rng(0)))


def row_info(info: Mapping[str, np.ndarray[Any, Any]], row: int) -> dict[str, Any]:
    """Return one row of an info of arrays, as plain Python numbers."""
    return {name: values[row].item() for name, values in info.items()}
