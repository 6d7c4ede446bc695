"""The oracle: it looks into the simulator and knows when and where the strike comes: an upper bound."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.arena import Arena
from mecanum_env.units import FloatArray
from training.controllers.interface import Command, twist_command
from training.controllers.tracking import Proportional

_SPEED_M_S, _ACCELERATION_M_S2 = 1.05, 3.5  # of the packaged robot, with a little in hand
_TICK_S = 0.02
_DIRECTIONS = 16
_HORIZON_S = 0.5  # before, a point mass is too far off what the robot will do
_LOYALTY = 0.5
_LATE_TICKS = 1  # between a command and the motion it asks for
_SPREAD_M = (0.0, 0.015, 0.03, 0.045)  # how far off a plan may be


class Oracle:
    """Tries many ways to move until the strike ends, on a point mass, against the strike as it will be.

    A way is one velocity until some command, then another. It takes the one that is missed most surely and,
    of those, the one that ends nearest to maai.

    Args:
        arena: what it looks into; `env.unwrapped.arena`.
        row: which of its episodes.
    """

    def __init__(self, arena: Arena, row: int = 0) -> None:
        self._arena, self._row = arena, row
        maai = arena.setting.rules.maai_m
        self.reset()
        self._wait = Proportional(distance_m=maai + 0.15)
        self._return = Proportional(distance_m=maai, gain_per_s=4.0)

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
        """Return the velocity in the field to ask for now [m/s]."""
        arena, row = self._arena, self._row
        fighter, sword = arena.fighter, arena.fighter.sword
        now_s = float(arena.time_s()[row])
        ticks = max(1, round((sword.land_s[row] - now_s) / _TICK_S))
        first, second, switch = _ways(ticks)
        if self._plan is not None:
            # What it is about, once more: a point mass's little advantage is not worth another turn.
            kept_first, kept_second, switch_s = self._plan
            first = np.concatenate([first, kept_first[:, None]], axis=1)
            second = np.concatenate([second, kept_second[:, None]], axis=1)
            switch = np.append(switch, round((switch_s - now_s) / _TICK_S))
        path = _paths(arena.scenes.now[:, row], first, second, switch, ticks)  # (ticks + 1, 6, ways)
        n = first.shape[1]
        rows = np.full(n, row)
        if fighter.aimed[row]:
            end = np.repeat(sword.end[:, row, None], n, axis=1)
        else:
            seen_s = sword.cut_s[row] - fighter.constants.sight_delay_s
            seen_tick = round((seen_s - now_s) / _TICK_S)
            if seen_tick >= 0:
                seen = path[min(seen_tick, ticks)]
            else:
                seen = np.repeat(arena.scenes.ago_of(rows[:1], np.array([now_s - seen_s])), n, axis=1)
            end = fighter.aim_at(rows, seen)
        missed = np.zeros(n)
        for spread in _SPREAD_M:
            clear = np.ones(n, bool)
            for dx, dy in ((spread, 0.0), (-spread, 0.0), (0.0, spread), (0.0, -spread)):
                robot = path[-1].copy()
                robot[0] += dx
                robot[1] += dy
                clear &= ~fighter.hits(rows, robot, end)
            missed += clear
        away = path[-1, :2] - sword.origin[:, row, None]
        distance = np.sqrt(away[0] ** 2 + away[1] ** 2)
        score = missed - 0.5 * np.abs(distance - arena.setting.rules.maai_m)
        if self._plan is not None:
            score[-1] += _LOYALTY
        best = int(np.argmax(score))
        self._plan = (first[:, best], second[:, best], now_s + _TICK_S * switch[best])
        wanted = first[:, best] if switch[best] > 0 else second[:, best]
        return float(wanted[0]), float(wanted[1])


def _ways(ticks: int) -> tuple[FloatArray, FloatArray, npt.NDArray[np.intp]]:
    """Return first and second velocities, (2, n) [m/s], and the tick of the change, (n,)."""
    angles = 2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    velocities = np.concatenate(
        [_SPEED_M_S * np.array([np.cos(angles), np.sin(angles)]), np.zeros((2, 1))], axis=1
    )
    changes = np.arange(5, max(ticks, 6), 5)  # commands last five ticks
    one, other, change = np.meshgrid(
        np.arange(_DIRECTIONS + 1), np.arange(_DIRECTIONS + 1), changes, indexing="ij"
    )
    return velocities[:, one.ravel()], velocities[:, other.ravel()], change.ravel()


def _paths(
    scene: FloatArray, first: FloatArray, second: FloatArray, switch: npt.NDArray[np.intp], ticks: int
) -> FloatArray:
    """Return the robots' scenes (ticks + 1, 6, n) of a point mass that follows the velocities."""
    n = first.shape[1]
    path = np.empty((ticks + 1, 6, n))
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
