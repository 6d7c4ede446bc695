"""The oracle: it rehearses the episode on the simulator itself; its success is the bound of a certificate.

Everything random in an episode is drawn at its start and everything after that follows from the commands, so
copies of the episode, with the same robot, effects, latency, opponent and rules, can be played to the end
with many scripts (`scripts`): waiting motion, evasion and return. The oracle sends the commands of one that
succeeds. It knows which strike comes and when, but like any controller it answers a strike only when an
observation can have shown it; before, it waits as it chose to. A script that succeeds shows that the episode
can be won so; where none does it may still be winnable, by a controller that happens to move early.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.actions import FULL_V_RPM, command_to_action
from mecanum_env.tankendo.arena import Arena
from mecanum_env.units import FloatArray
from training.controllers.dodges import Scripts, random_scripts, script_twists, twist_commands
from training.controllers.foresight import Foresight
from training.controllers.interface import Command

_SIDE_BY_SIDE: Final = 48
"""Scripts that are played together."""
_ROUNDS: Final = 8
"""Rounds of scripts until the oracle gives up; the first is random, half of each other is near the best."""
_BEST: Final = 8
_SEED: Final = 0
"""The scripts' seed: the same for every episode, so that the oracle is the same everywhere."""
_MOST_OVER: Final = 0.9
"""Share of scripts whose episode is over at which a rehearsal ends."""
_SAFE_M: Final = 0.02
"""Margin of a miss beyond which a larger one counts no more [m]."""


@dataclass(frozen=True)
class Rehearsal:
    """How n scripts ended."""

    success: npt.NDArray[np.bool_]
    score: FloatArray
    """The larger, the closer to a success: margin of the strike [m], and error of the return [m]."""
    commands: FloatArray
    """Commands of every step, shape (steps, n, 3)."""


class Oracle:
    """Plays the first script that succeeded in rehearsals of the episode in a row of an arena.

    It plans in `reset`, which must follow the reset of the environment. In tasks other than the dodge it is
    `Foresight`.
    """

    def __init__(self, arena: Arena, row: int = 0) -> None:
        self._arena, self._row = arena, row
        self._other = Foresight(arena, row)
        self._commands = np.zeros((0, 3))
        self._next = 0

    def reset(self) -> None:
        """Rehearse the episode that has begun in the arena's row."""
        self._other.reset()
        self._next = 0
        if self._arena.setting.task == "dodge" and self._arena.begun[self._row]:
            self._commands = best_commands(self._arena, self._row)

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        if self._next >= len(self._commands):
            return self._other.act(observation)
        v, theta, vc = (int(number) for number in self._commands[self._next])
        self._next += 1
        return v, theta, vc


def best_commands(arena: Arena, row: int) -> FloatArray:
    """Return the commands, shape (steps, 3), of the best script found for the episode in an arena's row."""
    rng = np.random.default_rng(_SEED)
    scripts = random_scripts(_SIDE_BY_SIDE, rng)
    known: Scripts | None = None
    scores = np.zeros(0)
    best: tuple[float, FloatArray] = (-np.inf, np.zeros((0, 3)))
    for _ in range(_ROUNDS):
        played = rehearse(arena, row, scripts)
        won = np.flatnonzero(played.success)
        first = int(won[0]) if len(won) else int(np.argmax(played.score))
        if len(won) or played.score[first] > best[0]:
            best = float(played.score[first]), played.commands[:, first]
        if len(won):
            break
        known = scripts if known is None else known.joined(scripts)
        scores = np.concatenate([scores, played.score])
        leaders = np.argsort(-scores, kind="stable")[:_BEST]
        half = _SIDE_BY_SIDE // 2
        near = known.near(leaders[rng.integers(len(leaders), size=half)], rng)
        scripts = near.joined(random_scripts(_SIDE_BY_SIDE - half, rng))
    return best[1]


def rehearse(arena: Arena, row: int, scripts: Scripts) -> Rehearsal:
    """Play n scripts to the end of the episode in a row of an arena, each on a copy of its own."""
    n = len(scripts)
    copies = arena.copies(row, n)
    model, fighter = copies.robots.model_of(0), copies.fighter
    limit_rpm = min(model.wheel.saturation_rpm, FULL_V_RPM)
    home, towards = np.zeros((2, n)), np.zeros(n)
    success, over, struck = np.zeros((3, n), bool)
    score, commands = np.full(n, -9.0), []
    # One success is enough, and who is never struck keeps the others waiting.
    while over.mean() < _MOST_OVER and not success.any():
        scene, now = copies.scenes.now, copies.time_s()
        idle = ~fighter.pending & ~struck
        home = np.where(idle, scene[6:8], home)
        towards = np.where(idle, np.arctan2(scene[7] - scene[1], scene[6] - scene[0]), towards)
        is_seen = fighter.pending & (fighter.sword.raise_s <= now - copies.setting.sensors.delay_s)
        left = np.where(struck, -np.inf, np.where(is_seen, fighter.sword.land_s - now, np.inf))
        wanted = script_twists(
            scripts,
            scene,
            maai_m=copies.setting.rules.maai_m,
            left_s=left,
            home=home,
            towards_rad=towards,
        )
        commands.append(twist_commands(wanted, model.robot, limit_rpm))
        was_pending = fighter.pending.copy()
        step = copies.step(command_to_action(commands[-1]))
        lands = np.flatnonzero(was_pending & ~fighter.pending & ~over)
        if len(lands):
            ago = copies.time_s()[lands] - fighter.sword.land_s[lands]
            robot = copies.scenes.ago_of(lands, ago)
            margin = fighter.margin(lands, robot, fighter.sword.end[:, lands])
            score[lands] = np.minimum(margin, _SAFE_M)
        struck |= was_pending & ~fighter.pending
        ends = (step.terminated | step.truncated) & ~over
        success |= ends & copies.succeeded
        distance, bearing = copies.scenes.separation()
        rules = copies.setting.rules
        off = np.maximum(np.abs(distance - rules.maai_m) - rules.band_m, 0.0) + np.maximum(
            np.abs(bearing) - rules.facing_rad, 0.0
        )
        score = np.where(ends & ~copies.hit, score - off, score)
        over |= ends
    return Rehearsal(success, score, np.array(commands))
