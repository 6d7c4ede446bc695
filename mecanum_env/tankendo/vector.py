"""Tankendo for many robots at once: Gymnasium's vector interface over one batch of physics."""

from __future__ import annotations

import operator
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Unpack

import gymnasium
import numpy as np
import numpy.typing as npt
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mecanum_env.errors import InputError, require_one_of
from mecanum_env.tankendo.actions import checked_action
from mecanum_env.tankendo.build import Arguments, Engine, build, row_info
from mecanum_env.tankendo.chance import DRAWN, Start
from mecanum_env.tankendo.scene import BoolArray, RowArray

if TYPE_CHECKING:
    from mecanum_env.model import Model
    from mecanum_env.rendering.view import Frame
    from mecanum_env.tankendo.drawing import Painter

Array = npt.NDArray[Any]


class TankendoVectorEnv(VectorEnv[Array, Array, Array]):
    """`num_envs` independent copies of `TankendoEnv`, each equal to it bit for bit.

    `gymnasium.make_vec("MecanumTankendo-v0", num_envs=64, autoreset_mode="SameStep")` makes one. With a seed
    s, environment i is `TankendoEnv` with the seed s + i. `autoreset_mode` says when an episode that is over
    is reset, as Gymnasium defines it:

    - "NextStep": by the next step, which ignores the action, gives the first observation of the new episode,
      a reward of 0, and no end.
    - "SameStep": within the step that ends them, which gives the first observation of the new episode; the
      last observation and info of the old one are in `info["final_obs"]` and `info["final_info"]`.
    - "Disabled": by `reset(options={"reset_mask": mask})` alone, the mask an array (num_envs,) of bool.

    `engine` is "mujoco", or "arrays" for thousands of robots without slip (`mecanum_env.batch`): the same
    task on the same motion, but for rounding. `device` lets torch compute that motion, on "cpu" or "cuda";
    None: numpy does. `threads` is the number of threads of "mujoco"; 0: as many as there are processors.
    `render_mode` must be None with "mujoco"; with "arrays" it may be "rgb_array": `render` puts the state of
    the first robot into MuJoCo and draws it. All other arguments are those of `TankendoEnv`.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        threads: int = 1,
        engine: Engine = "mujoco",
        device: str | None = None,
        **arguments: Unpack[Arguments],
    ) -> None:
        if num_envs < 1:
            raise InputError(f"num_envs = {num_envs}, must be at least 1")
        if engine == "arrays" and render_mode is not None:
            require_one_of("render_mode", render_mode, ["rgb_array"])
        elif render_mode is not None:
            raise InputError(
                f"render_mode = {render_mode!r}: robots in one batch are not drawn; use gymnasium.make, or "
                'make_vec with vectorization_mode="sync"'
            )
        if not isinstance(autoreset_mode, AutoresetMode):
            require_one_of("autoreset_mode", autoreset_mode, [mode.value for mode in AutoresetMode])
        self._autoreset_mode = AutoresetMode(autoreset_mode)
        self._episodes = build(num_envs, threads, engine=engine, device=device, **arguments)
        self.metadata = {
            "autoreset_mode": self._autoreset_mode,
            "render_modes": ["rgb_array"] if engine == "arrays" else [],
            "render_fps": 10,
        }
        self.render_mode = render_mode
        self._painter: Painter | None = None
        self._drawn: Model | None = None
        self.num_envs = num_envs
        self.arena = self._episodes.arena
        self.single_action_space: gymnasium.Space[Any] = self._episodes.action_space()
        self.single_observation_space: gymnasium.Space[Any] = self._episodes.observation_space()
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
            seed: s: environment i gets s + i; a sequence: one seed each; None: the generators go on.
            options: those of `TankendoEnv`, the same for all environments; with `"reset_mask"`, an array
                (num_envs,) of bool, only some environments begin an episode.

        Raises:
            InputError: seeds or options that do not fit; nothing has changed.
        """
        seeds = self._seeds(seed)
        start = self._episodes.start_of(options, "reset_mask")
        mask = self._mask((options or {}).get("reset_mask", np.ones(self.num_envs, bool)))
        if seeds is not None:
            for row in np.flatnonzero(mask).tolist():
                if seeds[row] is not None:
                    self._rngs[row], _ = gymnasium.utils.seeding.np_random(seeds[row])
        self._restart(mask, start)
        return self.arena.observed.copy(), self._with_first({}, np.flatnonzero(mask))

    def _seeds(self, seed: int | Sequence[int | None] | Array | None) -> list[int | None] | None:
        if seed is None:
            return None
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

    def _mask(self, value: Any) -> BoolArray:
        mask = np.asarray(value)
        if mask.shape != (self.num_envs,) or mask.dtype != bool:
            raise InputError(
                f"reset_mask: {mask.dtype} of shape {mask.shape}, must be bool of shape ({self.num_envs},)"
            )
        if not mask.any():
            raise InputError("reset_mask: all False, must be True for at least one environment")
        return mask

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Send a command to each robot; return observations, rewards, terminated, truncated, info.

        `actions` have the shape (num_envs, 3), see `TankendoEnv`.

        Raises:
            InputError: actions of another shape, or not finite; nothing has moved.
            gymnasium.error.ResetNeeded: no episode has begun, or without autoreset one is over.
        """
        everybody, mode = np.ones(self.num_envs, bool), self._autoreset_mode
        # The physics steps every row; in a row that was over before, the reset replaces the result.
        was_over = self.arena.ended.copy() if mode is AutoresetMode.NEXT_STEP else ~everybody
        step = self._episodes.step(checked_action(actions, (self.num_envs, 3)), was_over)
        terminated, truncated = step.terminated & ~was_over, step.truncated & ~was_over
        reward = np.where(was_over, 0.0, step.reward)
        resets = terminated | truncated if mode is AutoresetMode.SAME_STEP else was_over
        if not resets.any():
            return step.observation.copy(), reward, terminated, truncated, _with_masks(step.info, everybody)
        last = step.observation[resets]
        self._restart(resets, DRAWN)
        # The info of a reset lacks what a step adds.
        info = self._with_first(_with_masks(step.info, ~resets), np.flatnonzero(resets))
        if mode is AutoresetMode.SAME_STEP:
            final = np.full(self.num_envs, None, object)
            for row, observation in zip(np.flatnonzero(resets), last, strict=True):
                final[row] = observation
            info |= {"final_obs": final, "final_info": _with_masks(step.info, resets)}
            info |= {"_final_obs": resets, "_final_info": resets.copy()}
        return self.arena.observed.copy(), reward, terminated, truncated, info

    def render(self) -> tuple[Frame, ...] | None:
        """Return a picture of the first environment, shape (480, 640, 3), alone in a tuple."""
        from mecanum_env.tankendo.drawing import Painter

        if self.render_mode is None:
            gymnasium.logger.warn('render() needs render_mode="rgb_array" and engine="arrays" in make_vec')
            return None
        drawn = self.arena.robots.model_of(0)
        if self._painter is None or self._drawn is not drawn:
            self.close_extras()
            self._painter, self._drawn = Painter(self.arena, self._episodes.plant), drawn
        return (self._painter.frame(),)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the renderer; Gymnasium's further arguments `kwargs` are not used."""
        if self._painter is not None:
            self._painter.close()
            self._painter = None

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy or a pickle holds: all but the renderer, which it opens anew when it draws."""
        return {**vars(self), "_painter": None}

    def info_of(self, info: Mapping[str, Any], row: int) -> dict[str, Any]:
        """Return what an info says of one environment, by its row, as the single environment gives it."""
        names = [name for name in info if name[0] != "_" and not name.startswith("final_")]
        return row_info({name: info[name] for name in names if info[f"_{name}"][row]}, row)

    def _with_first(self, info: dict[str, Any], rows: RowArray) -> dict[str, Any]:
        """Return the masked `info` of others, with that of the episodes that have just begun in rows (m,)."""
        for name, values in self.arena.first_info(rows).items():
            for key, new in ((name, values), (f"_{name}", np.ones(len(rows), bool))):
                whole = info.setdefault(key, np.zeros(self.num_envs, new.dtype))
                whole[rows] = new
        return info

    def _restart(self, rows: BoolArray, start: Start) -> None:
        chosen = np.flatnonzero(rows)
        self._episodes.restart(chosen.tolist(), [self._rngs[row] for row in chosen.tolist()], start)
        self.arena.observe_first(chosen)


def _with_masks(info: Mapping[str, Array], mask: BoolArray) -> dict[str, Any]:
    """Add to each array of an info, as Gymnasium does, for which environments it holds; others get 0."""
    masked: dict[str, Any] = {}
    others = ~mask
    for name, values in info.items():
        kept = np.array(values, ndmin=1)  # a copy; a step of one episode has numbers
        kept[others] = 0
        masked[name], masked[f"_{name}"] = kept, mask.copy()
    return masked
