"""Tankendo for two robots: PettingZoo's parallel interface to one bout."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Final, Unpack

import gymnasium
import numpy as np
import numpy.typing as npt

from mecanum_env.errors import BackendError, InputError, install_command, require_one_of
from mecanum_env.rendering.view import Frame
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.actions import checked_action
from mecanum_env.tankendo.bout import Poses, duel_arena
from mecanum_env.tankendo.build import ModelLike, TaskArguments, row_info

if TYPE_CHECKING:
    from mecanum_env.tankendo.duel_drawing import DuelPainter

try:
    from pettingzoo import ParallelEnv
except ImportError as error:
    raise BackendError(
        f"MecanumTankendoDuel needs PettingZoo; install it with {install_command('duel')}"
    ) from error

PLAYERS: Final = ("first", "second")
"""The agents."""
Array = npt.NDArray[np.float32]


# PettingZoo has no types.
class MecanumTankendoDuel(ParallelEnv):  # type: ignore[misc]
    """Tankendo between two commanded robots: best of three, with the same rules for both.

    The agents are "first" and "second". Actions, observations (23 numbers) and arguments are those of the
    task "duel" of `TankendoEnv`, for each agent from its own side: each has its own frame of the field, in
    which it starts on the side of negative x, so that one policy can play both sides. Both robots are in one
    MuJoCo model.

    **Strikes.** The sword of a robot moves by itself, as the scripted opponent's does: it rises when its
    owner faces the other robot and has seen an opening of it for long enough (the other is at maai, faces its
    owner and is slow, as seen late). Techniques, feints, timing, reach, aim and lead are those of `opponent`.
    Where a robot drives meanwhile is its own affair: the reach counts from where it is when its sword starts
    forward.

    **Points.** A hit is a point; strikes of both that hit in the same command period cancel each other. After
    a point no strike begins for a second. Two points win. Who leaves the field loses, and so does who drives
    into the other (centres within 0.65 m): the one that is faster towards the other, or both. At the time
    limit the higher score wins.

    **Rewards.** The terms *distance*, *facing*, *effort*, *hit* and *out* of `TankendoEnv`; *success* for
    each point and for the other's leaving the field or driving into this one. Points and faults of one are
    the other's loss.

    `info` of each agent is that of the duel: `points`, `points_against`, `is_success` (it has won), `hit`,
    `distance_m`, `bearing_rad`, and the `technique` of the other's sword.

    Args:
        model: path of a model file, or a `Model`, of both robots; by default the packaged one.
        plant: "planar" or "rollers".
        timestep_s: upper bound of the physics step [s].
        render_mode: None or "rgb_array".
        task: the other arguments of `TankendoEnv`, such as `difficulty`, `action_mode`, `opponent`, `rules`.

    Raises:
        InputError: an argument that cannot be used.
    """

    metadata: ClassVar[dict[str, Any]] = {
        "name": "mecanum_tankendo_duel_v0",
        "render_modes": ["rgb_array"],
        "render_fps": 10,
        "is_parallelizable": True,
    }

    def __init__(
        self,
        *,
        model: ModelLike | None = None,
        plant: RobotPlant = "planar",
        timestep_s: float | None = None,
        render_mode: str | None = None,
        **task: Unpack[TaskArguments],
    ) -> None:
        if render_mode is not None:
            require_one_of("render_mode", render_mode, ["rgb_array"])
        self.render_mode = render_mode
        self.arena = duel_arena(1, model=model, plant=plant, timestep_s=timestep_s, **task)
        self.plant: RobotPlant = plant
        self.possible_agents = list(PLAYERS)
        self.agents: list[str] = []
        limits = self.arena.setting.observation_limits
        self.observation_spaces = {
            player: gymnasium.spaces.Box(-limits, limits, dtype=np.float32) for player in PLAYERS
        }
        self.action_spaces = {player: gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32) for player in PLAYERS}
        self._rng: np.random.Generator | None = None
        self._painter: DuelPainter | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: all but the renderer, which it opens anew when it draws."""
        return {**vars(self), "_painter": None}

    def observation_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return the space of an agent's observations, always the same object."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> gymnasium.spaces.Box:
        """Return the space of an agent's actions, always the same object."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, dict[str, Any]]]:
        """Begin a bout; return the first observations and infos by agent.

        Args:
            seed: of this and all following bouts; None: the generator goes on.
            options: `"swapped": True` exchanges the players of the bout that the seed gives: start, chance of
                the swords, noise; `"poses"` are two starting poses x [m], y [m], yaw [rad], each in its
                player's frame. PettingZoo's tests pass others, so these are ignored.

        Raises:
            InputError: poses that are not two times three finite numbers.
        """
        given = {} if options is None else options
        poses = _poses(given["poses"]) if "poses" in given else None
        if seed is not None or self._rng is None:
            self._rng, _ = gymnasium.utils.seeding.np_random(seed)
        self.arena.begin([0], [self._rng], swapped=bool(given.get("swapped", False)), poses=poses)
        self.agents = list(PLAYERS)
        info = self.arena.state_info()
        return self._by_player(self.arena.observe()), {
            player: row_info(info, row) for row, player in enumerate(PLAYERS)
        }

    def step(
        self, actions: Mapping[str, npt.NDArray[np.float32]]
    ) -> tuple[
        dict[str, Array], dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]
    ]:
        """Send both agents' `actions`, shape (3,) each; return what PettingZoo wants, each by agent.

        Raises:
            InputError: an agent without an action, or with one of another shape, or not finite.
            gymnasium.error.ResetNeeded: no bout has begun, or it is over.
        """
        if not self.agents:
            raise gymnasium.error.ResetNeeded("step() without a bout; call reset() first")
        if missing := [player for player in PLAYERS if player not in actions]:
            raise InputError(f"actions: none for {', '.join(missing)}; both robots take a command")
        both = np.stack([checked_action(actions[player], (3,)) for player in PLAYERS])
        step = self.arena.step(both)
        if self.arena.ended.all():
            self.agents = []
        rows = list(enumerate(PLAYERS))
        return (
            self._by_player(step.observation),
            {player: float(step.reward[row]) for row, player in rows},
            {player: bool(step.terminated[row]) for row, player in rows},
            {player: bool(step.truncated[row]) for row, player in rows},
            {player: row_info(step.info, row) for row, player in rows},
        )

    def state(self) -> Array:
        """Return both observations, one after the other, shape (46,)."""
        return self.arena.observe().ravel()

    def render(self) -> Frame | None:
        """Return a picture, shape (480, 640, 3), in the mode "rgb_array"."""
        from mecanum_env.tankendo.duel_drawing import DuelPainter

        if self.render_mode is None:
            gymnasium.logger.warn('render() needs MecanumTankendoDuel(render_mode="rgb_array")')
            return None
        if self._painter is None:
            self._painter = DuelPainter(self.arena, self.plant)
        frame: Frame = self._painter.frame()
        return frame

    def close(self) -> None:
        """Close the renderer."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def _by_player(self, rows: Array) -> dict[str, Array]:
        return dict(zip(PLAYERS, rows, strict=True))


def _poses(value: Any) -> Poses:
    try:
        (x, y, yaw), (other_x, other_y, other_yaw) = np.asarray(value, float).tolist()
    except (TypeError, ValueError):
        x = y = yaw = other_x = other_y = other_yaw = np.nan
    if not np.isfinite([x, y, yaw, other_x, other_y, other_yaw]).all():
        raise InputError(f"options: poses = {value!r}, must be two poses x [m], y [m], yaw [rad]")
    return (x, y, yaw), (other_x, other_y, other_yaw)
