"""What the opponent does: walk, strike at an opening, aim where it expects the robot to be."""

from __future__ import annotations

import numpy as np

from mecanum_env.tankendo.chance import EXCHANGES, Chance
from mecanum_env.tankendo.constants import Opponent, Rules
from mecanum_env.tankendo.scene import BoolArray, RowArray, Scenes, separation, wrapped
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

_APPROACH_PER_S = 2.5  # how hard it corrects its distance
_MIN_LUNGE_M = 0.9
_NOBODY = np.zeros(0, np.intp)


class Fighter:
    """The opponents of n episodes.

    Args:
        n: number of episodes.
        opponent: how they fight.
        rules: maai, and what an opening is.
        chance: what was drawn for each episode.
        scenes: where everybody is.
        step_s: time between two steps.
    """

    def __init__(
        self, n: int, opponent: Opponent, rules: Rules, chance: Chance, scenes: Scenes, step_s: float
    ) -> None:
        self.constants, self._rules = opponent, rules
        self._chance, self._scenes, self._step_s = chance, scenes, step_s
        self.sword = Sword(n)
        self.exchange = np.zeros(n, np.intp)
        """Strikes of the episode so far."""
        self.feinted = np.zeros(n, bool)
        self.open_s = np.zeros(n)
        """How long the robot has been open in the opponent's eyes [s]."""
        self.pending = np.zeros(n, bool)
        """A strike is under way that has not hit or missed yet."""
        self.aimed = np.zeros(n, bool)
        self._all = np.arange(n)
        self._table = {
            name: np.array([getattr(technique, name) for technique in opponent.techniques])
            for name in (
                *("swing_s", "reach_m", "width_m", "depth_m", "blade_m", "target_m", "target_height_m"),
                *("raised_tip_m", "raised_height_m"),
            )
        }

    def restart(self, row: int) -> None:
        """Begin an episode in one row."""
        self.sword.clear(row)
        self.exchange[row], self.open_s[row] = 0, 0.0
        self.feinted[row] = self.pending[row] = self.aimed[row] = False

    def drawn(self, what: FloatArray) -> FloatArray:
        """Return what was drawn (exchanges, n) for the exchange that each episode is in, shape (n,)."""
        return what[self.exchange % EXCHANGES, self._all]

    def technique(self) -> RowArray:
        """Return the index of the technique of the exchange that each episode is in, shape (n,)."""
        drawn: RowArray = self._chance.technique[self.exchange % EXCHANGES, self._all]
        return drawn

    def has_struck(self, time_s: FloatArray) -> BoolArray:
        """Return where a strike is over and the sword on its way back, or back, at times (n,), shape (n,)."""
        struck: BoolArray = ~self.sword.is_feint & (time_s >= self.sword.land_s)
        return struck

    def sees_opening(self) -> BoolArray:
        """Return where the robot, as seen late, is at maai, facing and slow, shape (n,)."""
        now, seen = self._scenes.now, self._scenes.ago(self.constants.sight_delay_s)
        scene = seen.copy()
        scene[6:] = now[6:]
        distance, bearing = separation(scene)
        rules = self._rules
        speed2 = seen[3] * seen[3] + seen[4] * seen[4]
        opening: BoolArray = (
            (np.abs(distance - rules.maai_m) <= rules.band_m)
            & (np.abs(bearing) <= rules.facing_rad)
            & (speed2 <= rules.slow_m_s**2)
        )
        return opening

    def decide(self, time_s: FloatArray, may_strike: BoolArray) -> None:
        """Start a feint or strike where the robot has been open for long enough.

        Args:
            time_s: now, (n,).
            may_strike: where the task allows it, (n,).
        """
        ready = may_strike & self.sword.idle(time_s)
        self.open_s = np.where(ready & self.sees_opening(), self.open_s + self._step_s, 0.0)
        starts = self.open_s > self.drawn(self._chance.patience)
        if not starts.any():
            return
        rows = np.flatnonzero(starts)
        which = self.exchange[rows] % EXCHANGES
        feint = self._chance.feints[which, rows] & ~self.feinted[rows]
        sword, technique = self.sword, self._chance.technique[which, rows]
        start = time_s[rows] + self._chance.wait[which, rows] * self._step_s
        cut = start + np.where(
            feint,
            self._chance.feint_s[which, rows],
            self._chance.warning[which, rows] - self._table["swing_s"][technique],
        )
        land = np.where(feint, cut, start + self._chance.warning[which, rows])
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

    def walk(self, time_s: FloatArray, stands: BoolArray, wish: FloatArray | None = None) -> FloatArray:
        """Return place [m], heading [rad] and velocity [m/s] one step later, shape (5, n).

        Args:
            time_s: now, (n,).
            stands: who does not walk, (n,).
            wish: velocity that it would like instead of keeping its distance, (2, n) [m/s].
        """
        constants, step = self.constants, self._step_s
        seen, now = self._scenes.ago(constants.sight_delay_s), self._scenes.now
        dx, dy = seen[0] - now[6], seen[1] - now[7]
        distance = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        if wish is None:
            wanted = _APPROACH_PER_S * (distance - self._rules.maai_m)
            speed = np.minimum(np.maximum(wanted, -constants.walk_m_s), constants.walk_m_s)
            across = self._chance.drift
            wish = np.array([(speed * dx - across * dy) / distance, (speed * dy + across * dx) / distance])
        fights = ~self.sword.idle(time_s)
        busy = stands | fights
        change = np.where(busy, 0.0, wish) - now[9:11]
        size = np.sqrt(change[0] * change[0] + change[1] * change[1])
        velocity = now[9:11] + change * np.minimum(1.0, constants.walk_m_s2 * step / np.maximum(size, 1e-9))
        turn = wrapped(np.arctan2(dy, dx) - now[8])
        most = constants.turn_rad_s * step
        heading = now[8] + np.where(busy, 0.0, np.minimum(np.maximum(turn, -most), most))
        place = now[6:8] + step * velocity
        struck = fights & ~self.sword.is_feint
        if struck.any():
            # In a strike its place is its step; the velocity is that of the step.
            forward = constants.step_m * self.sword.step_share(time_s + step)
            stepped = self.sword.origin + forward * np.stack([np.cos(now[8]), np.sin(now[8])])
            place = np.where(struck, stepped, place)
            velocity = np.where(struck, (stepped - now[6:8]) / step, velocity)
        after = np.empty((5, len(time_s)))
        after[:2], after[2], after[3:] = place, heading, velocity
        return after

    def aim(self, end_s: FloatArray) -> None:
        """Lock the aim of the swords that started forward during the step that ended now, at `end_s` (n,)."""
        starts = self.pending & ~self.aimed & (self.sword.cut_s <= end_s)
        if not starts.any():
            return
        rows, sword = np.flatnonzero(starts), self.sword
        seen = self._scenes.ago_of(rows, end_s[rows] - sword.cut_s[rows] + self.constants.sight_delay_s)
        sword.end[:, rows] = self.aim_at(rows, seen)
        self.aimed[rows] = True

    def land(self, end_s: FloatArray) -> tuple[RowArray, BoolArray]:
        """Return the rows (m,) whose strike ended in the step until `end_s`, (n,), and which hit, (m,)."""
        lands = self.pending & (self.sword.land_s <= end_s)
        if not lands.any():
            return _NOBODY, np.zeros(0, bool)
        rows, sword = np.flatnonzero(lands), self.sword
        hit = self.hits(rows, self._scenes.ago_of(rows, end_s[rows] - sword.land_s[rows]), sword.end[:, rows])
        self.pending[rows] = False
        self.feinted[rows] = False
        return rows, hit

    def aim_at(self, rows: RowArray, seen: FloatArray) -> FloatArray:
        """Return where tips will end, (2, m), for robots as seen when the swords start forward.

        Args:
            rows: the episodes, (m,).
            seen: the robots then, one `sight_delay_s` ago: scenes (6 or more, m).
        """
        constants, sword, table = self.constants, self.sword, self._table
        which = self.exchange[rows] % EXCHANGES
        technique = self._chance.technique[which, rows]
        ahead = constants.lead * (sword.land_s[rows] - sword.cut_s[rows] + constants.sight_delay_s)
        offset, noise = table["target_m"][technique], self._chance.aim_noise[:, which, rows]
        origin = sword.origin[:, rows]
        dx = seen[0] + offset * np.cos(seen[2]) + ahead * seen[3] + noise[0] - origin[0]
        dy = seen[1] + offset * np.sin(seen[2]) + ahead * seen[4] + noise[1] - origin[1]
        wanted = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        reach = np.maximum(table["reach_m"][technique] + constants.extra_reach_m, _MIN_LUNGE_M)
        length = np.minimum(np.maximum(wanted, _MIN_LUNGE_M), reach) / wanted
        return np.array([origin[0] + length * dx, origin[1] + length * dy])

    def hits(self, rows: RowArray, robot: FloatArray, end: FloatArray) -> BoolArray:
        """Return whether strikes hit, (m,).

        Args:
            rows: the episodes, (m,).
            robot: the robots when the strikes end, scenes (6 or more, m).
            end: where the tips end, (2, m).
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
        target: place of the target, seen from where the tip ends, (2, m) [m].
        along: from where the opponent stood to where the tip ends, (2, m) [m].
        width_m: of the target, across the strike.
        depth_m: that the target may be behind the tip's end.
        blade_m: that it may be before it.
    """
    length = np.sqrt(along[0] * along[0] + along[1] * along[1])
    behind = (target[0] * along[0] + target[1] * along[1]) / length
    across = (target[1] * along[0] - target[0] * along[1]) / length
    hits: BoolArray = (np.abs(across) <= width_m / 2) & (behind <= depth_m) & (behind >= -blade_m)
    return hits
