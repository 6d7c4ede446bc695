"""Bouts of two commanded robots, n side by side: the arena in which each is the other's opponent.

The rows are the players, each in its own frame (`pair`). A row is what a row of `Arena` is: a robot and its
opponent with a sword. Here the opponent's body is the other robot, and the scripted walk is left out; sword,
openings, aim, hits, observation and reward terms are the same code.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, Unpack

import numpy as np

from mecanum_env.errors import InputError, require_at_least
from mecanum_env.simulator import RobotPlant
from mecanum_env.tankendo.arena import Arena, Robot, TaskName, TaskSetting
from mecanum_env.tankendo.build import ModelLike, TaskArguments, model_of, setting_of
from mecanum_env.tankendo.constants import require_number
from mecanum_env.tankendo.fighter import Fighter
from mecanum_env.tankendo.judge import ForPoints, Judge, Outcome
from mecanum_env.tankendo.numbers import Number, wrapped
from mecanum_env.tankendo.pair import PairBatch, compile_pair, others, turned
from mecanum_env.tankendo.plant import Compiled
from mecanum_env.tankendo.scene import BoolArray, RowArray
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.link import MOST_SEEDS

Result = Literal["first", "second", "draw"]
"""Who has won a bout."""
Poses = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Pose x [m], y [m], yaw [rad] of each player in its own frame."""


_EQUAL: Final = 1e-9
"""Closing speeds times distance [m^2/s] that differ by less are equal."""


class Swordsman(Fighter):
    """The swords of commanded robots.

    The step of a technique is what the robot is commanded to drive, so the reach counts from where the robot
    is when its sword starts forward, and not from where it was when the sword rose.
    """

    def _fix_aim(self, rows: RowArray, end_s: FloatArray) -> None:
        then = self._scenes.ago_of(rows, end_s[rows] - self.sword.cut_s[rows])
        self.sword.origin[:, rows] = then[6:8]
        super()._fix_aim(rows, end_s)


class Bout(ForPoints):
    """Best of three between two players with the same rules.

    A sword rises as that of the scripted opponent does: when its owner has seen an opening of the other for
    long enough; its owner must face the other, too. Strikes of both that hit in the same command period
    cancel each other. Who leaves the field loses, and so does who drives into the other: the player that is
    faster towards the other when they clash, or both. At the time limit the higher score wins.
    """

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the opponent may begin a strike at times (n,), shape (n,)."""
        _, bearing = self.scenes.separation()
        faces = others(np.abs(bearing)) <= self.rules.facing_rad
        return np.asarray(super().may_strike(time_s) & faces)

    def own_strikes(self) -> BoolArray:
        """Return where the player's own strike is under way, shape (n,)."""
        return np.asarray(others(self.fighter.pending))

    def _clashed(self) -> BoolArray:
        """Return where the player has driven into the other, shape (n,)."""
        scene = self.scenes.now
        closing = scene[3] * (scene[6] - scene[0]) + scene[4] * (scene[7] - scene[1])
        return np.asarray(super()._clashed() & (closing >= others(closing) - _EQUAL))

    def _outcome(self, end_s: FloatArray, out: BoolArray) -> Outcome:
        rules = self.rules
        hit = self._hits(end_s)
        hit &= ~others(hit)
        scored = np.asarray(others(hit))
        self._count(end_s, scored, hit)
        complete = np.asarray((self.points >= rules.duel_points).any(axis=0))
        won_by_fault = others(out) & ~out
        fault = out | others(out)
        late = end_s >= rules.duel_time_s - 1e-9
        ahead = self.points[0] > self.points[1]
        success = np.where(fault, won_by_fault, ahead & (complete | late))
        never = np.zeros(self.n, bool)
        return Outcome(never, hit, scored | won_by_fault, fault | complete, success)


class DuelArena(Arena):
    """n bouts side by side; its 2n rows are the first players and then the second ones.

    `pair` is that of `compile_pair`. The task of the setting must be "duel", and the opponent in it is the
    sword of both players: when it strikes, with what techniques, how late it sees.

    Raises:
        InputError: a time limit shorter than one step.
    """

    _fighter = Swordsman
    _judges: Mapping[TaskName, type[Judge]] = {"duel": Bout}

    def __init__(self, setting: TaskSetting, pair: Compiled, n: int, threads: int = 1) -> None:
        self.bouts = n
        """Number of bouts."""
        super().__init__(setting, pair, 2 * n, threads)

    def _open_robots(self, compiled: Robot, threads: int, device: str | None) -> PairBatch:
        assert isinstance(compiled, Compiled)
        return PairBatch(compiled, self.bouts, threads)

    def begin(
        self,
        bouts: Sequence[int],
        rngs: Sequence[np.random.Generator],
        *,
        swapped: bool = False,
        poses: Poses | None = None,
    ) -> None:
        """Begin new bouts, each with its generator of `rngs`.

        Args:
            bouts: which ones, shape (m,).
            rngs: their generators, the only source of randomness.
            swapped: let the players exchange starts, swords' chance and sensors' noise; the other way round
                the same bout, so that two controllers can play both sides of it.
            poses: where the players start, instead of where they are drawn.
        """
        first = np.array(bouts, np.intp)
        second = first + self.bouts
        at = np.concatenate([first, second])
        seeds = np.array([rng.integers(MOST_SEEDS, size=2) for rng in rngs]).reshape(-1, 2)
        # What is drawn first decides where both stand.
        lead, follow = (second, first) if swapped else (first, second)
        own = [np.random.default_rng(int(seed)) for seed in seeds[:, :: -1 if swapped else 1].T.ravel()]
        opponents = self.chance.draw(at, own)
        start, distance = self.chance.start_pose, self.chance.start_distance
        start[:2, follow] = -start[:2, lead]
        start[0, follow] -= distance[lead]
        if poses is not None:
            for rows, pose in zip((first, second), poses, strict=True):
                start[:, rows] = np.array(pose, float)[:, None]
        if self.sensing is not None:
            for row, rng in zip(at.tolist(), own, strict=True):
                self.sensing.restart(row, rng)
        self._begin(at, [self._common] * len(at), opponents)

    def _first_scenes(self, at: RowArray) -> FloatArray:
        motion = np.zeros((6, self.n))
        motion[:3] = self.chance.start_pose
        other = others(turned(motion))[:, at]
        return np.concatenate([motion[:, at], other[:2], wrapped(other[2])[None], np.zeros((2, len(at)))])

    def _opponents(self, start_s: Number, seen: list[Number]) -> Sequence[Number]:
        """Return the five numbers of the opponents one step after a time: they are the other robots."""
        x, y, yaw, vx, vy, _ = others(turned(self.robots.motion()))
        before = self.scenes.now[8]
        return [x, y, before + wrapped(yaw - before), vx, vy]

    def results(self) -> list[Result | None]:
        """Return who has won each bout that ended with the last step, and None for the others."""
        won, names = self.succeeded, ("first", "second")
        found: list[Result | None] = []
        for bout in range(self.bouts):
            rows = (bout, bout + self.bouts)
            winners: list[Any] = [name for name, row in zip(names, rows, strict=True) if won[row]]
            found.append((winners or ["draw"])[0] if self.ended[bout] else None)
        return found


def duel_arena(
    bouts: int = 1,
    *,
    model: ModelLike | None = None,
    plant: RobotPlant = "planar",
    timestep_s: float | None = None,
    threads: int = 1,
    **task: Unpack[TaskArguments],
) -> DuelArena:
    """Return an arena for a number of bouts, between two robots of one model, by a number of `threads`.

    The other arguments are those of `TankendoEnv`: `model`, `plant`, `timestep_s`, and those of the `task`
    but its name.

    Raises:
        InputError: an argument that cannot be used; the message says what could.
    """
    require_at_least(1, bouts=bouts)
    if timestep_s is not None:
        require_number("timestep_s", timestep_s, 0.0, strict=True)
    if "task" in task:
        raise InputError(f"task = {task['task']!r}: a bout of two robots has no other task")
    task["task"] = "duel"
    return DuelArena(setting_of(**task), compile_pair(model_of(model), plant, timestep_s), bouts, threads)
