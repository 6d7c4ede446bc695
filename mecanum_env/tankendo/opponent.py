"""What the opponent does: it walks, strikes at an opening, and aims where it expects the robot to be."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from mecanum_env.tankendo.chance import EXCHANGES, Chance
from mecanum_env.tankendo.constants import Opponent, Rules, Technique
from mecanum_env.tankendo.scene import BoolArray, RowArray, Scenes, separation, wrapped
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

_APPROACH_PER_S = 2.5  # walking speed over the error of its distance
_MIN_LUNGE_M = 0.9  # shortest distance from where it stood to where its tip ends


class Fighter:
    """The opponents of n episodes, which decide every `step_s` [s]."""

    def __init__(
        self, n: int, opponent: Opponent, rules: Rules, chance: Chance, scenes: Scenes, step_s: float
    ) -> None:
        self.constants, self._rules = opponent, rules
        self._chance, self._scenes, self._step_s = chance, scenes, step_s
        self.sword = Sword(n)
        self.exchange = np.zeros(n, np.intp)
        """Strikes of the episode so far, shape (n,)."""
        self.feinted = np.zeros(n, bool)
        """Whether it has feinted in this exchange, which it does at most once."""
        self.open_s = np.zeros(n)
        """How long the opponent has seen an opening [s]."""
        self.pending = np.zeros(n, bool)
        """Whether a strike is under way that has neither hit nor missed yet."""
        self.aimed = np.zeros(n, bool)
        """Whether the aim of this strike is fixed."""
        self._all = np.arange(n)
        self._table = {
            field.name: np.array([getattr(technique, field.name) for technique in opponent.techniques])
            for field in fields(Technique)
        }

    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""
        self.sword.clear(rows)
        self.exchange[rows], self.open_s[rows] = 0, 0.0
        self.feinted[rows] = self.pending[rows] = self.aimed[rows] = False

    def drawn(self, draws: FloatArray) -> FloatArray:
        """Return the draws, shape (exchanges, n), of the exchange that each episode is in, shape (n,)."""
        return draws[self.exchange % EXCHANGES, self._all]

    def technique(self) -> RowArray:
        """Return the index of the technique of the exchange that each episode is in, shape (n,)."""
        return np.asarray(self._chance.technique[self.exchange % EXCHANGES, self._all])

    def has_struck(self, time_s: FloatArray) -> BoolArray:
        """Return where a strike has hit or missed at times (n,), shape (n,)."""
        return np.asarray(~self.sword.is_feint & (time_s >= self.sword.land_s))

    def sees_opening(self) -> BoolArray:
        """Return where the robot, as seen late, is at maai, facing and slow, shape (n,)."""
        now, seen = self._scenes.now, self._scenes.ago(self.constants.sight_delay_s)
        scene = seen.copy()
        scene[6:] = now[6:]
        is_slow: BoolArray = seen[3] * seen[3] + seen[4] * seen[4] <= self._rules.slow_m_s**2
        return self._rules.at_maai(*separation(scene)) & is_slow

    def decide(self, time_s: FloatArray, may_strike: BoolArray) -> None:
        """Start a feint or strike where the robot has offered an opening for long enough.

        The time is now, and `may_strike` says where the task allows a strike, shape (n,) each.
        """
        ready = may_strike & self.sword.idle(time_s)
        self.open_s = np.where(ready & self.sees_opening(), self.open_s + self._step_s, 0.0)
        starts = self.open_s > self.drawn(self._chance.patience)
        if not starts.any():
            return
        rows = np.flatnonzero(starts)
        exchange = self.exchange[rows] % EXCHANGES
        feint = self._chance.feints[exchange, rows] & ~self.feinted[rows]
        sword, technique = self.sword, self._chance.technique[exchange, rows]
        start = time_s[rows] + self._chance.wait[exchange, rows] * self._step_s
        warning = self._chance.warning[exchange, rows]
        cut = start + np.where(
            feint, self._chance.feint_s[exchange, rows], warning - self._table["swing_s"][technique]
        )
        land = np.where(feint, cut, start + warning)
        sword.raise_s[rows], sword.cut_s[rows], sword.land_s[rows] = start, cut, land
        sword.free_s[rows] = land + np.where(feint, self.constants.lower_s, self.constants.recovery_s)
        sword.is_feint[rows] = feint
        sword.raised_m[rows] = self._table["raised_tip_m"][technique]
        sword.raised_height_m[rows] = self._table["raised_height_m"][technique]
        sword.end_height_m[rows] = self._table["target_height_m"][technique]
        sword.origin[:, rows] = self._scenes.now[6:8, rows]
        self.open_s[rows] = 0.0
        self.feinted[rows] = feint
        self.pending[rows], self.aimed[rows] = ~feint, False

    def walk(self, time_s: FloatArray, stands: BoolArray, wanted: FloatArray | None = None) -> FloatArray:
        """Return position [m], heading [rad] and velocity [m/s] one step after `time_s` (n,), shape (5, n).

        Who `stands`, shape (n,), does not walk; the others keep maai, or aim for the velocities `wanted`,
        shape (2, n) [m/s].
        """
        constants, step = self.constants, self._step_s
        seen, now = self._scenes.ago(constants.sight_delay_s), self._scenes.now
        dx, dy = seen[0] - now[6], seen[1] - now[7]
        distance = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        if wanted is None:
            closing = _APPROACH_PER_S * (distance - self._rules.maai_m)
            speed = np.minimum(np.maximum(closing, -constants.walk_m_s), constants.walk_m_s)
            across = self._chance.drift
            wanted = np.array([(speed * dx - across * dy) / distance, (speed * dy + across * dx) / distance])
        fights = ~self.sword.idle(time_s)
        busy = stands | fights
        change = np.where(busy, 0.0, wanted) - now[9:11]
        size = np.sqrt(change[0] * change[0] + change[1] * change[1])
        velocity = now[9:11] + change * np.minimum(1.0, constants.walk_m_s2 * step / np.maximum(size, 1e-9))
        turn = wrapped(np.arctan2(dy, dx) - now[8])
        largest = constants.turn_rad_s * step
        heading = now[8] + np.where(busy, 0.0, np.minimum(np.maximum(turn, -largest), largest))
        position = now[6:8] + step * velocity
        strikes = fights & ~self.sword.is_feint
        if strikes.any():
            # In a strike, the step of the technique replaces the walk.
            forward = constants.step_m * self.sword.step_share(time_s + step)
            stepped = self.sword.origin + forward * np.stack([np.cos(now[8]), np.sin(now[8])])
            position = np.where(strikes, stepped, position)
            velocity = np.where(strikes, (stepped - now[6:8]) / step, velocity)
        return np.concatenate([position, heading[None], velocity])

    def aim(self, end_s: FloatArray) -> None:
        """Fix the aim of the swords that started forward in the step that ended at `end_s`, shape (n,)."""
        starts = self.pending & ~self.aimed & (self.sword.cut_s <= end_s)
        if not starts.any():
            return
        rows, sword = np.flatnonzero(starts), self.sword
        seen = self._scenes.ago_of(rows, end_s[rows] - sword.cut_s[rows] + self.constants.sight_delay_s)
        sword.end[:, rows] = self.aim_at(rows, seen)
        self.aimed[rows] = True

    def land(self, end_s: FloatArray) -> tuple[RowArray, BoolArray]:
        """Return the rows (m,) whose strike ended in the step until `end_s` (n,), and which hit, (m,)."""
        lands = self.pending & (self.sword.land_s <= end_s)
        if not lands.any():
            return np.zeros(0, np.intp), np.zeros(0, bool)
        rows, sword = np.flatnonzero(lands), self.sword
        hit = self.hits(rows, self._scenes.ago_of(rows, end_s[rows] - sword.land_s[rows]), sword.end[:, rows])
        self.pending[rows] = self.feinted[rows] = False
        return rows, hit

    def aim_at(self, rows: RowArray, seen: FloatArray) -> FloatArray:
        """Return where the tips in some rows (m,) will end: x, y [m], shape (2, m).

        `seen` are the scenes, shape (6 or more, m), one `sight_delay_s` before the swords start forward.
        """
        constants, sword, table = self.constants, self.sword, self._table
        exchange = self.exchange[rows] % EXCHANGES
        technique = self._chance.technique[exchange, rows]
        ahead = constants.lead * (sword.land_s[rows] - sword.cut_s[rows] + constants.sight_delay_s)
        offset, noise = table["target_m"][technique], self._chance.aim_noise[:, exchange, rows]
        origin = sword.origin[:, rows]
        dx = seen[0] + offset * np.cos(seen[2]) + ahead * seen[3] + noise[0] - origin[0]
        dy = seen[1] + offset * np.sin(seen[2]) + ahead * seen[4] + noise[1] - origin[1]
        distance = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        reach = np.maximum(table["reach_m"][technique] + constants.extra_reach_m, _MIN_LUNGE_M)
        share = np.minimum(np.maximum(distance, _MIN_LUNGE_M), reach) / distance
        return np.array([origin[0] + share * dx, origin[1] + share * dy])

    def hits(self, rows: RowArray, robot: FloatArray, end: FloatArray) -> BoolArray:
        """Return whether the strikes in some rows (m,) hit, shape (m,).

        `robot` are the scenes when the strikes end, shape (6 or more, m), `end` is where the tips end, shape
        (2, m) [m].
        """
        table, technique = self._table, self.technique()[rows]
        offset = table["target_m"][technique]
        x, y = robot[0] + offset * np.cos(robot[2]) - end[0], robot[1] + offset * np.sin(robot[2]) - end[1]
        return strike_hits(
            np.array([x, y]),
            end - self.sword.origin[:, rows],
            width_m=table["width_m"][technique] + self.constants.extra_size_m,
            depth_m=table["depth_m"][technique] + self.constants.extra_size_m,
            blade_m=table["blade_m"][technique],
        )


def strike_hits(
    target: FloatArray, along: FloatArray, *, width_m: FloatArray, depth_m: FloatArray, blade_m: FloatArray
) -> BoolArray:
    """Return whether strikes hit their targets, shape (m,).

    Args:
        target: position of the target relative to where the tip ends, shape (2, m) [m].
        along: vector from where the opponent stood to where the tip ends, shape (2, m) [m].
        width_m: width of the target across the strike, shape (m,).
        depth_m: how far the target may be behind the tip's end, shape (m,).
        blade_m: how far it may be before the tip's end, shape (m,).
    """
    length = np.sqrt(along[0] * along[0] + along[1] * along[1])
    behind = (target[0] * along[0] + target[1] * along[1]) / length
    across = (target[1] * along[0] - target[0] * along[1]) / length
    return np.asarray((np.abs(across) <= width_m / 2) & (behind <= depth_m) & (behind >= -blade_m))
