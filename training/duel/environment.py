"""Bouts of a learner against frozen players, as one environment of Stable-Baselines3."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
import numpy.typing as npt
from stable_baselines3.common.vec_env import VecEnv

from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.actions import action_to_command, command_to_action
from mecanum_env.tankendo.bout import duel_arena
from training.duel.match import Player, PlayerFactory

Array = npt.NDArray[Any]


class DuelVecEnv(VecEnv):  # type: ignore[misc]
    """`bouts` bouts of a learner, the first player of each, against frozen others, drawn from a pool.

    The learner's side is no loss of generality: each player has a frame of its own. An episode that is over
    begins anew in the step that ends it.

    Args:
        bouts: number of bouts side by side.
        pool: makes the others; each bout draws one of them with equal probability.
        seed: of all that is drawn.
        model: of both robots; None: the packaged one.
        plant: "planar" or "rollers".
        task: further arguments of `duel_arena`; the learner's actions are "cartesian".
    """

    def __init__(
        self,
        bouts: int,
        pool: Sequence[PlayerFactory],
        seed: int,
        *,
        model: Model | None = None,
        plant: RobotPlant = "planar",
        **task: Any,
    ) -> None:
        self.arena = duel_arena(bouts, model=model, plant=plant, action_mode="command", **task)
        self.pool = list(pool)
        self._rng = np.random.default_rng(seed)
        self._rngs = [np.random.default_rng(self._rng.integers(2**40)) for _ in range(bouts)]
        self._others: list[Player] = []
        self._actions: Array = np.zeros((bouts, 3))
        self.render_mode = None
        limits = self.arena.setting.observation_limits
        super().__init__(
            bouts,
            gymnasium.spaces.Box(-limits, limits, dtype=np.float32),
            gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32),
        )

    def _other(self) -> Player:
        number = int(self._rng.integers(len(self.pool)))
        return self.pool[number](int(self._rng.integers(2**31)))

    def reset(self) -> Array:
        """Begin all bouts anew; return the learner's first observations."""
        self.arena.begin(range(self.num_envs), self._rngs)
        self._others = [self._other() for _ in range(self.num_envs)]
        self.reset_infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        return self.arena.observe()[: self.num_envs]

    def step_async(self, actions: Array) -> None:
        """Take the learner's actions, shape (bouts, 3)."""
        self._actions = actions

    def step_wait(self) -> tuple[Array, Array, Array, list[dict[str, Any]]]:
        """Step; return the learner's observations, rewards, ends and infos."""
        n = self.num_envs
        seen = self.arena.observe()[n:]
        theirs = [player.act(one) for player, one in zip(self._others, seen, strict=True)]
        commands = np.concatenate([action_to_command(self._actions, "cartesian"), np.array(theirs, float)])
        step = self.arena.step(command_to_action(commands))
        infos: list[dict[str, Any]] = [{} for _ in range(n)]
        done, observation = self.arena.ended[:n].copy(), step.observation[:n].copy()
        rows = np.flatnonzero(done).tolist()
        for row in rows:
            infos[row] = {
                "terminal_observation": step.observation[row],
                "TimeLimit.truncated": bool(step.truncated[row]),
                "is_success": bool(step.info["is_success"][row]),
            }
            self._others[row] = self._other()
        if rows:
            self.arena.begin(rows, [self._rngs[row] for row in rows])
            observation[rows] = self.arena.observe()[rows]
        return observation, step.reward[:n].astype(np.float32), done, infos

    def close(self) -> None:
        """Do nothing: there is no renderer."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """Return the attribute `attr_name`, for each of the `indices`."""
        return [getattr(self, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set the attribute `attr_name` to a value, whatever the `indices`."""
        setattr(self, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call `method_name` with `method_args` and `method_kwargs`; a result for each of the `indices`."""
        found = getattr(self, method_name)(*method_args, **method_kwargs)
        return [found for _ in self._get_indices(indices)]

    def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
        """Return False for each of the `indices`: nothing here is inside a `wrapper_class`."""
        return [False for _ in self._get_indices(indices)]
