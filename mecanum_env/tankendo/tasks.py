"""The tracking task: the opponent walks about, the robot keeps maai and faces it.

The duel: the robot strikes too, best of three.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mecanum_env.tankendo.chance import WAVES
from mecanum_env.tankendo.constants import Rules
from mecanum_env.tankendo.judge import Judge, Verdict
from mecanum_env.tankendo.scene import BoolArray, separation
from mecanum_env.units import FloatArray

_HOME_PER_S = 0.3  # how hard it is drawn back to the middle of the field


class Track(Judge):
    """No strike; a success is being at maai and facing for most of the time."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._counted, self._kept = np.zeros(self.n), np.zeros(self.n)

    @staticmethod
    def time_limit_s(rules: Rules) -> float:
        """Return how long an episode lasts [s] by the rules."""
        return rules.track_time_s

    def restart(self, row: int) -> None:
        """Begin an episode in one row."""
        self._counted[row] = self._kept[row] = 0.0

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return nowhere, shape (n,), whatever the times (n,)."""
        return np.zeros(time_s.shape, bool)

    def wish(self, time_s: FloatArray) -> FloatArray:
        """Return the sum of sine waves that the opponent walks at times (n,), (2, n) [m/s]."""
        frequency, phase = self.chance.waves[:, :, 0], self.chance.waves[:, :, 1]
        wave = np.sin(frequency * time_s + phase)
        size = self.fighter.constants.wander_m_s * np.sqrt(2.0 / WAVES)
        total: FloatArray = wave[:, 0]
        for i in range(1, WAVES):
            total = total + wave[:, i]
        wish: FloatArray = size * total - _HOME_PER_S * self.scenes.now[6:8]
        return wish

    def report(self) -> dict[str, Any]:
        """Return the share of the counted time at maai and facing, (n,)."""
        return {"kept_share": self._kept / np.maximum(self._counted, 1.0)}

    def judge(self, end_s: FloatArray, effort: FloatArray) -> Verdict:
        """Judge the step that ended at `end_s`, (n,), with the command's change `effort`, (n,)."""
        rules = self.rules
        terms, out = self.common_terms(effort)
        distance, bearing = self.scenes.separation()
        kept = (np.abs(distance - rules.maai_m) <= rules.band_m) & (np.abs(bearing) <= rules.facing_rad)
        counts = end_s > rules.track_settle_s
        self._counted += counts
        self._kept += counts & kept
        over = end_s >= rules.track_time_s - 1e-9
        success = over & ~out & (self._kept >= rules.track_share * self._counted)
        nothing = np.zeros(self.n, bool)
        terms["waiting"] = np.zeros(self.n)
        terms["hit"] = np.asarray(0.0 - self.weights.hit * nothing, float)
        terms["success"] = np.asarray(self.weights.success * success, float)
        return Verdict(terms, out, success, nothing)


class Duel(Judge):
    """Evade strikes and step in while the opponent recovers: the robot's arm strikes by itself in reach."""

    extra_observations = 3

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.points = np.zeros((2, self.n), np.intp)
        """Points of the robot and of the opponent."""
        self.own_hit_s = np.full(self.n, np.inf)
        """When the robot's strike that is under way ends [s]; infinite: none is."""
        self._pause_until_s = np.zeros(self.n)

    @staticmethod
    def time_limit_s(rules: Rules) -> float:
        """Return how long a duel may last [s] by the rules."""
        return rules.duel_time_s

    def restart(self, row: int) -> None:
        """Begin a duel in one row."""
        self.points[:, row] = 0
        self.own_hit_s[row], self._pause_until_s[row] = np.inf, 0.0

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where no point was just made, at times (n,), shape (n,)."""
        return time_s >= self._pause_until_s

    def observe(self, time_s: FloatArray) -> FloatArray:
        """Return points of the robot, of the opponent, and whether the own sword strikes, (3, n)."""
        return np.concatenate([self.points.astype(float), np.isfinite(self.own_hit_s)[None].astype(float)])

    def report(self) -> dict[str, Any]:
        """Return the points of both, (n,) each."""
        return {"points": self.points[0].copy(), "points_against": self.points[1].copy()}

    def judge(self, end_s: FloatArray, effort: FloatArray) -> Verdict:
        """Judge the step that ended at `end_s`, (n,), with the command's change `effort`, (n,)."""
        rules, sword = self.rules, self.fighter.sword
        terms, out = self.common_terms(effort)
        hit = np.zeros(self.n, bool)
        rows, hits = self.fighter.land(end_s)
        hit[rows] = hits & (end_s[rows] >= self._pause_until_s[rows])
        self.fighter.exchange[rows] += 1
        scored = self._strike(end_s) & ~hit
        self.points[0] += scored
        self.points[1] += hit
        paused = scored | hit
        self._pause_until_s = np.where(paused, end_s + rules.duel_pause_s, self._pause_until_s)
        self.own_hit_s = np.where(paused, np.inf, self.own_hit_s)
        # The robot begins to strike where the opponent is still recovering from a strike that missed.
        distance, bearing = self.scenes.separation()
        open_now = ~sword.is_feint & (sword.land_s <= end_s) & (end_s < sword.free_s)
        begins = (
            open_now
            & np.isinf(self.own_hit_s)
            & (end_s >= self._pause_until_s)
            & (distance <= rules.own_reach_m)
            & (np.abs(bearing) <= rules.own_aim_rad)
        )
        self.own_hit_s = np.where(begins, end_s + rules.own_strike_s, self.own_hit_s)
        won, lost = self.points >= rules.duel_points
        terms["waiting"] = np.full(self.n, -self.weights.waiting)
        terms["hit"] = np.asarray(0.0 - self.weights.hit * hit, float)
        terms["success"] = np.asarray(self.weights.success * scored, float)
        return Verdict(terms, out | won | lost, won & ~out, hit)

    def _strike(self, end_s: FloatArray) -> BoolArray:
        """Return where a strike of the robot ended in the step until `end_s`, and hit, shape (n,)."""
        scored = np.zeros(self.n, bool)
        ends = self.own_hit_s <= end_s
        if ends.any():
            rows = np.flatnonzero(ends)
            distance, bearing = separation(self.scenes.ago_of(rows, end_s[rows] - self.own_hit_s[rows]))
            rules = self.rules
            scored[rows] = (distance <= rules.own_reach_m) & (np.abs(bearing) <= 2 * rules.own_aim_rad)
            self.own_hit_s[rows] = np.inf
        return scored
