"""Tankendo for many robots at once: Gymnasium's vector interface over one batch of physics."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mecanum_env.errors import InputError
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.actions import ActionMode, checked_action
from mecanum_env.tankendo.arena import TaskName
from mecanum_env.tankendo.build import ModelLike, build, row_info
from mecanum_env.tankendo.constants import Opponent, RewardWeights, Rules, Sensors
from mecanum_env.tankendo.randomize import Randomize

Array = npt.NDArray[Any]


class TankendoVectorEnv(VectorEnv[Array, Array, Array]):
    """`num_envs` independent copies of `TankendoEnv`, each equal to it bit for bit.

    `gymnasium.make_vec("MecanumTankendo-v0", num_envs=64)` makes one. An episode that ends begins anew within
    the same step (`AutoresetMode.SAME_STEP`): the observation is then the first of the next episode, and
    `info["final_obs"]` and `info["final_info"]` hold the last of the old one. With a seed s, environment i is
    `TankendoEnv` with the seed s + i.

    Args:
        num_envs: how many.
        render_mode: None; many together are not drawn.
        threads: that step the physics; 0: as many as there are processors.

    All others: as for `TankendoEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        task: TaskName = "dodge",
        model: ModelLike | None = None,
        plant: RobotPlant = "planar",
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
        threads: int = 1,
    ) -> None:
        if num_envs < 1:
            raise InputError(f"num_envs = {num_envs}, must be at least 1")
        if render_mode is not None:
            raise InputError(
                f"render_mode = {render_mode!r}: robots in one batch are not drawn; use gymnasium.make, or "
                'make_vec with vectorization_mode="sync"'
            )
        self._built = build(
            num_envs,
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
            threads=threads,
        )
        self.metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}
        self.num_envs = num_envs
        self.arena = self._built.arena
        self.single_action_space: gymnasium.Space[Any] = self._built.action_space()
        self.single_observation_space: gymnasium.Space[Any] = self._built.observation_space()
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._rngs = [np.random.default_rng() for _ in range(num_envs)]

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | Array | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Array, dict[str, Any]]:
        """Begin an episode in every environment; return the first observations and info.

        Args:
            seed: s: environment i gets s + i; a sequence: each its own; None goes on with the generators.
            options: `{"reset_mask": array of bool}` begins only some anew.

        Raises:
            InputError: seeds or a mask that do not fit; nothing has begun.
        """
        seeds = self._seeds(seed)
        mask = np.asarray((options or {}).get("reset_mask", np.ones(self.num_envs, bool)))
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise InputError(
                f"reset_mask: {mask.dtype} of shape {mask.shape}, must be bool of shape ({self.num_envs},)"
            )
        for row in np.flatnonzero(mask).tolist():
            own = seeds[row]
            if own is not None:
                self._rngs[row], _ = gymnasium.utils.seeding.np_random(own)
            self._built.restart(row, self._rngs[row])
        return self.arena.observe(), _with_masks(self.arena.state_info())

    def _seeds(self, seed: int | Sequence[int | None] | Array | None) -> list[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        try:
            seeds = [None if one is None else operator.index(one) for one in seed]
        except TypeError as error:
            raise InputError(
                f"seed = {seed!r}, must be a whole number, or one for each environment"
            ) from error
        if len(seeds) != self.num_envs:
            raise InputError(f"seed: {len(seeds)} seeds, must be {self.num_envs}, one for each environment")
        return seeds

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Send a command to each robot; return observations, rewards, terminated, truncated, info.

        Args:
            actions: shape (num_envs, 3), see `TankendoEnv`.

        Raises:
            InputError: actions of another shape, or not finite; nothing has moved.
            gymnasium.error.ResetNeeded: no episode has begun.
        """
        step = self._built.step(checked_action(actions, (self.num_envs, 3)))
        info = _with_masks(step.info)
        observation = step.observation
        done = step.terminated | step.truncated
        if done.any():
            last = np.full(self.num_envs, None, object)
            for row in np.flatnonzero(done):
                last[row] = observation[row]
                self._built.restart(int(row), self._rngs[row])
            info["final_obs"], info["_final_obs"] = last, done
            info["final_info"] = _with_masks(step.info, done)
            info["_final_info"] = done
            observation = np.where(done[:, None], self.arena.observe(), observation)
        return observation, step.reward, step.terminated, step.truncated, info

    def info_of(self, info: Mapping[str, Any], row: int) -> dict[str, Any]:
        """Return one environment's part of an info, by its row, as the single environment would give it."""
        plain = {name: value for name, value in info.items() if f"_{name}" in info and "final" not in name}
        return row_info(plain, row)


def _with_masks(info: Mapping[str, Array], mask: Array | None = None) -> dict[str, Any]:
    """Add to each array of an info, as Gymnasium does, for which environments it holds."""
    masks: dict[str, Any] = dict(info)
    for name, values in info.items():
        masks[f"_{name}"] = np.ones(len(values), bool) if mask is None else mask
    return masks
