"""What the opponent does: it walks, strikes at an opening, and aims where it expects the robot to be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from mecanum_env.tankendo.chance import Chance
from mecanum_env.tankendo.constants import Opponent, Rules, Technique
from mecanum_env.tankendo.numbers import Number, State, mathematics, wrapped
from mecanum_env.tankendo.scene import BoolArray, RowArray, Scenes, separation
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

_APPROACH_PER_S = 2.5  # walking speed over the error of its distance
_MIN_LUNGE_M = 0.9  # shortest distance from where it stood to where its tip ends
_NUMBERS = (
    *("sight_delay_s", "lead", "habit", "extra_reach_m", "extra_size_m", "lower_s", "step_m", "recovery_s"),
    *("walk_m_s", "walk_m_s2", "turn_rad_s", "wander_m_s"),
)
_NO_ROWS, _NO_HITS = np.zeros(0, np.intp), np.zeros(0, bool)
_TECHNIQUE_NUMBERS = [field for field in fields(Technique) if field.name != "name"]


class Fighter:
    """The opponents of n episodes, which decide every `step_s` [s]."""

    def __init__(
        self, n: int, opponent: Opponent, rules: Rules, chance: Chance, scenes: Scenes, step_s: float
    ) -> None:
        self.opponents = [opponent] * n
        """The opponent of each episode."""
        self._rules = rules
        self._chance, self._scenes, self._step_s = chance, scenes, step_s
        self._math = mathematics(n)
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
        self.waiting = np.zeros((2, n))
        """Velocity of the robot when the sword rose last: vx, vy, shape (2, n) [m/s]."""
        self.missed_m = np.full(n, np.nan)
        """By how much the strike that ended in the last step missed [m], at most 0 for a hit; NaN without."""
        self._numbers = {name: np.zeros(n) for name in _NUMBERS}
        self._table = {field.name: np.zeros((len(opponent.techniques), n)) for field in _TECHNIQUE_NUMBERS}
        for row in range(n):
            self._meet(row, opponent)

    def restart(self, rows: RowArray, opponents: Sequence[Opponent]) -> None:
        """Begin episodes in some rows (m,) against `opponents` with as many techniques as the others."""
        for row, opponent in zip(rows.tolist(), opponents, strict=True):
            if opponent is not self.opponents[row]:
                self._meet(row, opponent)
        self.sword.clear(rows)
        self.waiting[:, rows] = 0.0
        self.exchange[rows], self.open_s[rows] = 0, 0.0
        self.feinted[rows] = self.pending[rows] = self.aimed[rows] = False

    def _meet(self, row: int, opponent: Opponent) -> None:
        self.opponents[row] = opponent
        for name, values in self._numbers.items():
            values[row] = getattr(opponent, name)
        if opponent.lead_form == "none":
            self._numbers["lead"][row] = 0.0
        if opponent.lead_form == "constant_velocity":
            self._numbers["habit"][row] = 1.0
        for name, table in self._table.items():
            table[:, row] = [getattr(technique, name) for technique in opponent.techniques]

    @property
    def sight_delay_s(self) -> FloatArray:
        """Delay with which each opponent sees the robot, shape (n,) [s]."""
        return self._numbers["sight_delay_s"]

    @property
    def wander_m_s(self) -> FloatArray:
        """Root mean square speed of each opponent's walk in the tracking task, shape (n,) [m/s]."""
        return self._numbers["wander_m_s"]

    def seen(self) -> list[Number]:
        """Return the numbers of the scenes as the opponents see them now."""
        return self._scenes.seen_by(self._math.of(self.sight_delay_s))

    def drawn(self, draws: State) -> State:
        """Return the draws, shape (exchanges, n), of the exchange that each episode is in, shape (n,)."""
        return self._math.array(self.current(draws))

    def current(self, draws: State) -> Number:
        """Return what `drawn` does as a number."""
        return self._math.chosen(draws, self._math.of(self.exchange) % self._chance.exchanges)

    def technique(self) -> RowArray:
        """Return the index of the technique of the exchange that each episode is in, shape (n,)."""
        return self.drawn(self._chance.technique)

    def has_struck(self, time_s: FloatArray) -> BoolArray:
        """Return where a strike has hit or missed at times (n,), shape (n,)."""
        return np.asarray(~self.sword.is_feint & (time_s >= self.sword.land_s))

    def sees_opening(self, seen: list[Number]) -> Number:
        """Return where the robot, as `seen` late, is at maai, facing and slow."""
        x, y, yaw, vx, vy, *_ = seen
        own_x, own_y = self._scenes.newest()[6:8]
        is_slow = vx * vx + vy * vy <= self._rules.slow_m_s**2
        return self._rules.at_maai(*separation(self._math, own_x - x, own_y - y, yaw)) & is_slow

    def decide(self, time_s: Number, may_strike: Number, seen: list[Number]) -> None:
        """Start a feint or strike where the robot has offered an opening for long enough.

        The time is now, `may_strike` says where the task allows a strike, and the scenes are as `seen` now.
        """
        math = self._math
        ready = may_strike & self.sword.idle(time_s)
        if math.any(ready):
            ready = ready & self.sees_opening(seen)
        open_s = math.where(ready, math.of(self.open_s) + self._step_s, 0.0)
        math.put(self.open_s, open_s)
        starts = open_s > self.current(self._chance.patience)
        if math.any(starts):
            self._start(np.flatnonzero(starts), math.array(time_s))

    def _start(self, rows: RowArray, time_s: FloatArray) -> None:
        """Start a feint or strike in some rows (m,) in the step that begins at `time_s` (n,)."""
        exchange = self.exchange[rows] % self._chance.exchanges
        feint = self._chance.feints[exchange, rows] & ~self.feinted[rows]
        sword, technique = self.sword, self._chance.technique[exchange, rows]
        start = time_s[rows] + self._chance.wait[exchange, rows] * self._step_s
        warning = self._chance.warning[exchange, rows]
        cut = start + np.where(
            feint, self._chance.feint_s[exchange, rows], warning - self._table["swing_s"][technique, rows]
        )
        land = np.where(feint, cut, start + warning)
        sword.raise_s[rows], sword.cut_s[rows], sword.land_s[rows] = start, cut, land
        sword.free_s[rows] = land + np.where(
            feint, self._numbers["lower_s"][rows], self._numbers["recovery_s"][rows]
        )
        sword.is_feint[rows] = feint
        sword.raised_m[rows] = self._table["raised_tip_m"][technique, rows]
        sword.raised_height_m[rows] = self._table["raised_height_m"][technique, rows]
        sword.end_height_m[rows] = self._table["target_height_m"][technique, rows]
        sword.origin[:, rows] = self._scenes.now[6:8, rows]
        self.open_s[rows] = 0.0
        self.feinted[rows] = feint
        self.pending[rows], self.aimed[rows] = ~feint, False

    def walk(
        self, time_s: Number, stands: Number, seen: list[Number], wanted: tuple[Number, Number] | None = None
    ) -> list[Number]:
        """Return position x, y [m], heading [rad] and velocity x, y [m/s] one step after a time.

        Who `stands` does not walk; the others keep maai, or aim for the velocity `wanted` [m/s]. The scenes
        are as `seen` when the step began.
        """
        math, numbers, step = self._math, self._numbers, self._step_s
        x, y, heading, vx, vy = self._scenes.newest()[6:]
        dx, dy = seen[0] - x, seen[1] - y
        if wanted is None:
            distance, most = math.maximum(math.sqrt(dx * dx + dy * dy), 1e-6), math.of(numbers["walk_m_s"])
            closing = _APPROACH_PER_S * (distance - self._rules.maai_m)
            speed, across = math.minimum(math.maximum(closing, -most), most), math.of(self._chance.drift)
            wanted = (speed * dx - across * dy) / distance, (speed * dy + across * dx) / distance
        fights = math.no(self.sword.idle(time_s))
        busy = stands | fights
        change_x = math.where(busy, 0.0, wanted[0]) - vx
        change_y = math.where(busy, 0.0, wanted[1]) - vy
        size = math.sqrt(change_x * change_x + change_y * change_y)
        share = math.minimum(1.0, math.of(numbers["walk_m_s2"]) * step / math.maximum(size, 1e-9))
        turn = wrapped(math.arctan2(dy, dx) - heading)
        largest = math.of(numbers["turn_rad_s"]) * step
        turned = math.where(busy, 0.0, math.minimum(math.maximum(turn, -largest), largest))
        velocity = vx + change_x * share, vy + change_y * share
        moved = [x + step * velocity[0], y + step * velocity[1], heading + turned, *velocity]
        strikes = fights & math.no(math.of(self.sword.is_feint))
        return self._stepped(time_s + step, strikes, moved) if math.any(strikes) else moved

    def _stepped(self, time_s: Number, strikes: Number, moved: list[Number]) -> list[Number]:
        """Return what `walk` does at a time, where the opponent `strikes`; elsewhere what it `moved`."""
        math = self._math
        x, y, heading = self._scenes.newest()[6:9]
        origin_x, origin_y = math.of(self.sword.origin)
        # In a strike, the step of the technique replaces the walk.
        forward = math.of(self._numbers["step_m"]) * self.sword.step_share(time_s)
        to_x = origin_x + forward * math.cos(heading)
        to_y = origin_y + forward * math.sin(heading)
        velocity = (to_x - x) / self._step_s, (to_y - y) / self._step_s
        stepped = [to_x, to_y, moved[2], *velocity]
        return [math.where(strikes, one, other) for one, other in zip(stepped, moved, strict=True)]

    def aim(self, end_s: Number) -> None:
        """Fix the aim of the swords that started forward in the step that ended at a time."""
        math, sword = self._math, self.sword
        pending = math.of(self.pending)
        if not math.any(pending):
            return
        raised = math.of(sword.raise_s)
        rose = pending & (raised > end_s - self._step_s) & (raised <= end_s)
        if math.any(rose):
            self._note(np.flatnonzero(rose), math.array(end_s))
        starts = pending & math.no(math.of(self.aimed)) & (math.of(sword.cut_s) <= end_s)
        if math.any(starts):
            self._fix_aim(np.flatnonzero(starts), math.array(end_s))

    def _note(self, rows: RowArray, end_s: FloatArray) -> None:
        """Note the velocities with which the robots in some rows (m,) waited for swords that rose."""
        then = self._scenes.ago_of(rows, end_s[rows] - self.sword.raise_s[rows])
        self.waiting[:, rows] = then[3:5]

    def _fix_aim(self, rows: RowArray, end_s: FloatArray) -> None:
        """Fix the aim in some rows (m,) in the step that ended at `end_s` (n,)."""
        sword = self.sword
        late = self.sight_delay_s[rows]
        seen = self._scenes.ago_of(rows, end_s[rows] - sword.cut_s[rows] + late)
        sword.end[:, rows] = self.aim_at(rows, seen)
        self.aimed[rows] = True

    def land(self, end_s: Number) -> tuple[RowArray, BoolArray]:
        """Return the rows (m,) whose strike ended in the step until a time, and which hit, (m,)."""
        math, sword = self._math, self.sword
        pending = math.of(self.pending)
        self.missed_m.fill(np.nan)
        lands = pending & (math.of(sword.land_s) <= end_s)
        if not math.any(lands):
            return _NO_ROWS, _NO_HITS
        rows = np.flatnonzero(lands)
        ago_s = math.array(end_s)[rows] - sword.land_s[rows]
        self.missed_m[rows] = self.margin(rows, self._scenes.ago_of(rows, ago_s), sword.end[:, rows])
        self.pending[rows] = self.feinted[rows] = False
        return rows, self.missed_m[rows] <= 0.0

    def aim_at(self, rows: RowArray, seen: FloatArray) -> FloatArray:
        """Return where the tips in some rows (m,) will end: x, y [m], shape (2, m).

        The robot's motion is led by `Opponent.lead` in the form `Opponent.lead_form`.

        `seen` are the scenes, shape (6 or more, m), one `sight_delay_s` before the swords start forward.
        """
        sword, table = self.sword, self._table
        numbers = {name: values[rows] for name, values in self._numbers.items()}
        exchange = self.exchange[rows] % self._chance.exchanges
        technique = self._chance.technique[exchange, rows]
        ahead = numbers["lead"] * (sword.land_s[rows] - sword.cut_s[rows] + numbers["sight_delay_s"])
        # Of the waiting motion only the share `habit` is expected to go on.
        expected = seen[3:5] - (1.0 - numbers["habit"]) * self.waiting[:, rows]
        offset, noise = table["target_m"][technique, rows], self._chance.aim_noise[:, exchange, rows]
        origin = sword.origin[:, rows]
        dx = seen[0] + offset * np.cos(seen[2]) + ahead * expected[0] + noise[0] - origin[0]
        dy = seen[1] + offset * np.sin(seen[2]) + ahead * expected[1] + noise[1] - origin[1]
        distance = np.maximum(np.sqrt(dx * dx + dy * dy), 1e-6)
        reach = np.maximum(table["reach_m"][technique, rows] + numbers["extra_reach_m"], _MIN_LUNGE_M)
        share = np.minimum(np.maximum(distance, _MIN_LUNGE_M), reach) / distance
        return np.array([origin[0] + share * dx, origin[1] + share * dy])

    def hits(self, rows: RowArray, robot: FloatArray, end: FloatArray) -> BoolArray:
        """Return whether the strikes in some rows (m,) hit, shape (m,).

        `robot` and `end` are those of `margin`.
        """
        return np.asarray(self.margin(rows, robot, end) <= 0.0)

    def margin(self, rows: RowArray, robot: FloatArray, end: FloatArray) -> FloatArray:
        """Return by how much the strikes in some rows (m,) miss, shape (m,) [m]; a hit is at most 0.

        `robot` are the scenes when the strikes end, shape (6 or more, m), `end` is where the tips end, shape
        (2, m) [m].
        """
        technique = self.technique()[rows]
        extra_m = self._numbers["extra_size_m"][rows]
        table = {name: values[technique, rows] for name, values in self._table.items()}
        offset = table["target_m"]
        x, y = robot[0] + offset * np.cos(robot[2]) - end[0], robot[1] + offset * np.sin(robot[2]) - end[1]
        return strike_margin(
            np.array([x, y]),
            end - self.sword.origin[:, rows],
            width_m=table["width_m"] + extra_m,
            depth_m=table["depth_m"] + extra_m,
            blade_m=table["blade_m"],
        )


def strike_margin(
    target: FloatArray, along: FloatArray, *, width_m: FloatArray, depth_m: FloatArray, blade_m: FloatArray
) -> FloatArray:
    """Return by how much strikes miss their targets, shape (m,) [m]; at most 0 for a hit.

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
    beside = np.maximum(np.abs(across) - width_m / 2, behind - depth_m)
    return np.asarray(np.maximum(beside, -blade_m - behind), float)
