"""The score of a policy on development episodes, in one batch: what a training reports as it goes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Model
from mecanum_env.tankendo.actions import ActionMode
from mecanum_env.tankendo.vector import TankendoVectorEnv
from mecanum_env.units import FloatArray
from training.controllers.features import stack_features
from training.train.privileged import Privileged


class Actor(Protocol):
    """What is scored: a `Network`, or what acts as one."""

    @property
    def stack(self) -> int:
        """How many observations it sees."""

    @property
    def privileged(self) -> int:
        """How many numbers that no robot senses follow them."""

    @property
    def action_mode(self) -> ActionMode:
        """Meaning of an action."""

    def features(self, observation: npt.NDArray[np.floating]) -> FloatArray:
        """Return what it sees of observations, shape (n, k): their features, shape (n, f)."""

    def actions(self, stacked: FloatArray) -> FloatArray:
        """Return actions, shape (n, 3), of stacked features, shape (n, stack * k)."""


def successes(network: Actor, seeds: Sequence[int], **arguments: Any) -> npt.NDArray[np.bool_]:
    """Return which of the episodes with these seeds a network wins, shape (len(seeds),).

    The `arguments` are those of `TankendoVectorEnv` but for `num_envs`, `autoreset_mode` and `action_mode`.
    """
    won, _ = _played(network, seeds, arguments)
    return won


def successes_of_robots(
    network: Actor, seeds: Sequence[int], robots: Sequence[Model], **arguments: Any
) -> list[npt.NDArray[np.bool_]]:
    """Return which episodes a network wins on each of the robots, of those that any episode is played on.

    Every episode draws its robot. The `arguments` are those of `successes`, without model and randomize.
    """
    won, played_on = _played(network, seeds, {**arguments, "model": robots[0], "randomize": tuple(robots)})
    rows = [np.array([one is robot for one in played_on]) for robot in robots]
    return [won[own] for own in rows if own.any()]


def _played(
    network: Actor, seeds: Sequence[int], arguments: Mapping[str, Any]
) -> tuple[npt.NDArray[np.bool_], list[Model]]:
    """Return which episodes are won, and the robot of each."""
    env = TankendoVectorEnv(
        len(seeds), autoreset_mode="Disabled", action_mode=network.action_mode, **arguments
    )
    observation, _ = env.reset(seed=list(seeds))
    arena, memory = env.arena, None
    robots = [arena.robots.model_of(row) for row in range(len(seeds))]
    watcher = Privileged(arena) if network.privileged else None
    won, over = np.zeros(len(seeds), bool), np.zeros(len(seeds), bool)
    while not over.all():
        memory = stack_features(memory, network.features(observation), network.stack)
        # The rows of episodes that are over go on; what they do no longer counts.
        seen = memory if watcher is None else np.concatenate([memory, watcher.numbers()], axis=-1)
        step = arena.step(network.actions(seen))
        observation = step.observation
        won |= step.info["is_success"] & (step.terminated | step.truncated) & ~over
        over |= step.terminated | step.truncated
    env.close()
    return won, robots
