"""From the arguments of `gymnasium.make` to an arena: what the single and the vector environment share."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any

import gymnasium
import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.model import Model, paper_model, read_model
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.actions import ActionMode
from mecanum_env.tankendo.arena import Arena, Step, TaskName, TaskSetting
from mecanum_env.tankendo.constants import (
    Opponent,
    RewardWeights,
    Rules,
    Sensors,
    opponent_for,
    require_number,
)
from mecanum_env.tankendo.plant import Compiled, compile_model
from mecanum_env.tankendo.randomize import Randomize, Sampler, sampler_for
from mecanum_env.units import FloatArray

ModelLike = Model | str | os.PathLike[str]


@dataclass(frozen=True)
class Built:
    """An environment's parts."""

    arena: Arena
    sampler: Sampler | None
    """Draws the robot of each episode; None: always the model."""
    plant: RobotPlant
    timestep_s: float | None

    def restart(self, row: int, rng: np.random.Generator) -> None:
        """Begin an episode in one row, with chance from rng."""
        self.arena.restart(row, rng, self._robot(rng))

    def step(self, actions: FloatArray) -> Step:
        """Play one command period in all rows with actions (n, 3).

        Raises:
            gymnasium.error.ResetNeeded: a row in which no episode has begun.
        """
        if not self.arena.begun.all():
            raise gymnasium.error.ResetNeeded("step() before an episode has begun; call reset() first")
        return self.arena.step(actions)

    def _robot(self, rng: np.random.Generator) -> Compiled | None:
        if self.sampler is None:
            return None
        return compile_model(self.sampler.draw(rng), self.plant, self.timestep_s)

    def action_space(self) -> gymnasium.spaces.Box:
        """Return the space of one action."""
        return gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)

    def observation_space(self) -> gymnasium.spaces.Box:
        """Return the space of one observation."""
        limits = self.arena.setting.observation_limits
        return gymnasium.spaces.Box(-limits, limits, dtype=np.float32)


def build(
    n: int,
    *,
    task: TaskName,
    model: ModelLike | None,
    plant: RobotPlant,
    difficulty: str,
    action_mode: ActionMode,
    observation_delay: float | None,
    opponent: Opponent | None,
    randomize: Randomize,
    reward_weights: Mapping[str, float] | RewardWeights | None,
    rules: Rules | None,
    sensors: Sensors | None,
    timestep_s: float | None,
    threads: int = 1,
) -> Built:
    """Build n environments; the arguments are those of `TankendoEnv`.

    Args:
        n: how many.
        task: what is played.
        model: a model file's path, a model, or None for the packaged one.
        plant: "rollers" or "planar".
        difficulty: of the opponent, where none is given.
        action_mode: see `mecanum_env.tankendo.actions`.
        observation_delay: replaces the sensors' [s].
        opponent: replaces the difficulty's.
        randomize: see `mecanum_env.tankendo.randomize`.
        reward_weights: all, or some by name.
        rules: replace the default ones.
        sensors: replace the default ones.
        timestep_s: upper bound of the physics step [s].
        threads: that step the physics.

    Raises:
        InputError: an argument that is not usable; the message says what would be.
    """
    given = (("opponent", opponent, Opponent), ("rules", rules, Rules), ("sensors", sensors, Sensors))
    for name, value, kind in given:
        if value is not None and not isinstance(value, kind):
            raise InputError(f"{name} = {value!r}, must be a mecanum_env.tankendo.{kind.__name__}")
    if timestep_s is not None:
        require_number("timestep_s", timestep_s, 0.0, strict=True)
    sensors = Sensors() if sensors is None else sensors
    delay_s: Any = sensors.delay_s if observation_delay is None else observation_delay
    if not (isinstance(delay_s, Real) and 0.0 <= float(delay_s) <= 1.0):
        raise InputError(f"observation_delay = {delay_s!r}, must be seconds from 0 to 1")
    if not isinstance(reward_weights, RewardWeights):
        if not isinstance(reward_weights, Mapping | None):
            raise InputError(f'reward_weights = {reward_weights!r}, must be terms by name, {{"hit": 2.0}}')
        reward_weights = RewardWeights().replaced(reward_weights or {})
    setting = TaskSetting(
        task=task,
        opponent=opponent_for(difficulty) if opponent is None else opponent,
        rules=Rules() if rules is None else rules,
        sensors=replace(sensors, delay_s=float(delay_s)),
        weights=reward_weights,
        action_mode=action_mode,
    )
    model = _model(model)
    sampler = sampler_for(randomize, model)
    compiled = compile_model(model, plant, timestep_s)
    if sampler is not None:
        compiled = _typical(sampler, plant, timestep_s)
    return Built(Arena(setting, compiled, n, threads), sampler, plant, timestep_s)


def _model(model: ModelLike | None) -> Model:
    if model is None:
        return paper_model()
    if isinstance(model, Model):
        return model
    if not isinstance(model, str | os.PathLike):
        raise InputError(f"model = {model!r}, must be a model file's path or a mecanum_env.model.Model")
    return read_model(model)


def _typical(sampler: Sampler, plant: RobotPlant, timestep_s: float | None) -> Compiled:
    """Return a drawn robot: one whose effects have left neutral may have more parts than the model's own.

    Raises:
        InputError: robots that are drawn cannot be simulated.
    """
    try:
        for edge in sampler.edges():
            compile_model(edge, plant, timestep_s)
    except InputError as error:
        raise InputError(f"randomize: {error}") from error
    return compile_model(sampler.draw(np.random.default_rng(0)), plant, timestep_s)


def row_info(info: Mapping[str, np.ndarray[Any, Any]], row: int) -> dict[str, Any]:
    """Return one row of an info of arrays, as plain Python numbers."""
    return {name: values[row].item() for name, values in info.items()}
