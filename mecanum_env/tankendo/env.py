"""Tankendo for one robot: the Gymnasium environment."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt

from mecanum_env.simulator import Plant
from mecanum_env.tankendo.actions import ActionMode
from mecanum_env.tankendo.arena import TaskName
from mecanum_env.tankendo.build import ModelLike, build, row_info
from mecanum_env.tankendo.constants import Opponent, RewardWeights, Rules, Sensors
from mecanum_env.tankendo.randomize import Randomize

Observation = npt.NDArray[np.float32]


class TankendoEnv(gymnasium.Env[Observation, npt.NDArray[np.float32]]):
    """One robot against the opponent."""

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 10}  # noqa: RUF012

    def __init__(
        self,
        task: TaskName = "dodge",
        model: ModelLike | None = None,
        plant: Plant = "planar",
        difficulty: str = "normal",
        action_mode: ActionMode = "cartesian",
        observation_delay: float | None = None,
        opponent: Opponent | None = None,
        randomize: Randomize = "none",
        reward_weights: Mapping[str, float] | RewardWeights | None = None,
        rules: Rules | None = None,
        sensors: Sensors | None = None,
        timestep_s: float | None = None,
        render_mode: str | None = None,
    ) -> None:
        self._built = build(
            1,
            task=task,
            model=model,
            plant=plant,
            difficulty=difficulty,
            action_mode=action_mode,
            observation_delay=observation_delay,
            opponent=opponent,
            randomize=randomize,
            reward_weights=reward_weights,
            rules=rules,
            sensors=sensors,
            timestep_s=timestep_s,
        )
        self.arena = self._built.arena
        self.action_space: gymnasium.Space[Any] = self._built.action_space()
        self.observation_space: gymnasium.Space[Any] = self._built.observation_space()
        self.render_mode = render_mode

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Begin an episode; return the first observation and info.

        Args:
            seed: of this and all following episodes; None goes on with the generator as it is.
            options: none are known.
        """
        super().reset(seed=seed)
        self._built.restart(0, self.np_random)
        return self.arena.observe()[0], row_info(self.arena.state_info(), 0)

    def step(self, action: npt.NDArray[np.float32]) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Send one command; return observation, reward, terminated, truncated, info.

        Args:
            action: shape (3,), see the class.
        """
        step = self.arena.step(np.asarray(action)[None])
        return (
            step.observation[0],
            float(step.reward[0]),
            bool(step.terminated[0]),
            bool(step.truncated[0]),
            row_info(step.info, 0),
        )
