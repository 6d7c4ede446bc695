"""Planning a strike with what only the simulator knows, for tasks without a rehearsal: the duel, tracking."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.arena import Arena
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.tracking import Proportional

_SPEED_M_S, _ACCELERATION_M_S2 = 1.05, 3.5
"""Limits of the point mass: slightly below those of the packaged robot [m/s], [m/s^2]."""
_TICK_S = 0.02
_COMMAND_TICKS = 5
"""Ticks per command period of 0.1 s."""
_LATE_TICKS = 1
"""Delay from a command to the motion, in ticks."""
_DIRECTIONS = 16
_HORIZON_S = 0.5
"""It plans once the strike lands within this time [s]; earlier, a point mass predicts the robot too badly."""
_CONTINUATION_BONUS = 0.5
"""Bonus for continuing the last plan, in score."""
_SPREAD_M = (0.0, 0.015, 0.03, 0.045)
"""Errors of the final place that a plan is tried with [m]."""
_WAIT_MARGIN_M = 0.15
"""Distance beyond maai while it waits [m]."""


class Foresight:
    """Tries motions of a point mass until the strike ends, against the strike as it will be.

    A motion is one velocity until some command, then another one. It takes the one that the strike
    misses most surely and, among equals, the one that ends nearest to maai. Its episode is that in a row of
    the arena, `env.unwrapped.arena`.
    """

    def __init__(self, arena: Arena, row: int = 0) -> None:
        self._arena, self._row = arena, row
        self._maai_m = arena.setting.rules.maai_m
        self._wait = Proportional(distance_m=self._maai_m + _WAIT_MARGIN_M)
        self._return = Proportional(distance_m=self._maai_m, gain_per_s=4.0)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._plan: tuple[FloatArray, FloatArray, float] | None = None

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        fighter, row = self._arena.fighter, self._row
        left_s = fighter.sword.land_s[row] - self._arena.time_s()[row]
        if not fighter.pending[row]:
            self._plan = None
        if not fighter.pending[row] or left_s > _HORIZON_S:
            struck = fighter.has_struck(self._arena.time_s())[row]
            return (self._return if struck else self._wait).act(observation)
        vx, vy = self._best_velocity()
        yaw = self._arena.scenes.now[2, row]
        cos, sin = np.cos(yaw), np.sin(yaw)
        return twist_command(cos * vx + sin * vy, cos * vy - sin * vx, 0.0, self._wait.robot)

    def _best_velocity(self) -> tuple[float, float]:
        """Return the velocity to command now, in the world frame [m/s]."""
        arena, row = self._arena, self._row
        fighter, sword = arena.fighter, arena.fighter.sword
        now_s = float(arena.time_s()[row])
        ticks = max(1, round((sword.land_s[row] - now_s) / _TICK_S))
        first, second, switch = _candidates(ticks)
        if self._plan is not None:
            last_first, last_second, switch_s = self._plan
            first = np.concatenate([first, last_first[:, None]], axis=1)
            second = np.concatenate([second, last_second[:, None]], axis=1)
            switch = np.append(switch, round((switch_s - now_s) / _TICK_S))
        path = _paths(arena.scenes.now[:, row], first, second, switch, ticks)
        n = first.shape[1]
        rows = np.full(n, row)
        if fighter.aimed[row]:
            end = np.repeat(sword.end[:, row, None], n, axis=1)
        else:
            ago_s = now_s - (sword.cut_s[row] - float(fighter.sight_delay_s[row]))
            seen_tick = round(-ago_s / _TICK_S)
            if seen_tick >= 0:
                seen = path[min(seen_tick, ticks)]
            else:
                seen = np.repeat(arena.scenes.ago_of(rows[:1], np.array([ago_s])), n, axis=1)
            end = fighter.aim_at(rows, seen)
        missed = np.zeros(n)
        for spread in _SPREAD_M:
            clear = np.ones(n, bool)
            for dx, dy in ((spread, 0.0), (-spread, 0.0), (0.0, spread), (0.0, -spread)):
                robot = path[-1].copy()
                robot[:2] += np.array([[dx], [dy]])
                clear &= ~fighter.hits(rows, robot, end)
            missed += clear
        away = path[-1, :2] - sword.origin[:, row, None]
        score = missed - 0.5 * np.abs(np.sqrt(away[0] ** 2 + away[1] ** 2) - self._maai_m)
        if self._plan is not None:
            score[-1] += _CONTINUATION_BONUS
        best = int(np.argmax(score))
        self._plan = (first[:, best], second[:, best], now_s + _TICK_S * switch[best])
        wanted = first[:, best] if switch[best] > 0 else second[:, best]
        return float(wanted[0]), float(wanted[1])


def _candidates(ticks: int) -> tuple[FloatArray, FloatArray, npt.NDArray[np.intp]]:
    """Return first and second velocities, (2, n) [m/s], and the tick at which they change, (n,)."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    velocities = np.concatenate(
        [_SPEED_M_S * np.array([np.cos(angles), np.sin(angles)]), np.zeros((2, 1))], axis=1
    )
    choices = np.arange(_DIRECTIONS + 1)
    changes = np.arange(_COMMAND_TICKS, max(ticks, _COMMAND_TICKS + 1), _COMMAND_TICKS)
    one, other, change = (axis.ravel() for axis in np.meshgrid(choices, choices, changes, indexing="ij"))
    return velocities[:, one], velocities[:, other], change


def _paths(
    scene: FloatArray, first: FloatArray, second: FloatArray, switch: npt.NDArray[np.intp], ticks: int
) -> FloatArray:
    """Return the scenes of a point mass that follows the velocities, shape (ticks + 1, 6, n)."""
    path = np.empty((ticks + 1, 6, first.shape[1]))
    path[0] = scene[:6, None]
    most = _ACCELERATION_M_S2 * _TICK_S
    for tick in range(ticks):
        wanted = np.where(tick < switch + _LATE_TICKS, first, second)
        if tick < _LATE_TICKS:
            wanted = path[0, 3:5]
        change = wanted - path[tick, 3:5]
        size = np.maximum(np.sqrt(change[0] ** 2 + change[1] ** 2), 1e-9)
        path[tick + 1] = path[tick]
        path[tick + 1, 3:5] += change * np.minimum(1.0, most / size)
        path[tick + 1, :2] += _TICK_S * 0.5 * (path[tick, 3:5] + path[tick + 1, 3:5])
    return path
