"""What counts: hits, the two rules, rewards and the end of an episode, for each task.

`TankendoEnv` has the formulae of the reward terms, `RewardWeights` their weights.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.tankendo.chance import WAVES, Chance
from mecanum_env.tankendo.constants import RewardWeights, Rules
from mecanum_env.tankendo.opponent import Fighter
from mecanum_env.tankendo.scene import BoolArray, RowArray, Scenes, separation
from mecanum_env.units import FloatArray

TERMS: Final = ("distance", "facing", "effort", "waiting", "hit", "success", "out")
"""Names of the reward terms, in the order in which they are summed."""
_SIGNS: Final = {name: 1.0 if name == "success" else -1.0 for name in TERMS}
_HOME_PER_S = 0.3  # in tracking, the opponent drifts back to the field's centre at this rate [1/s]


@dataclass(frozen=True)
class Outcome:
    """What a step led to, by the rules of one task; arrays (n,) of bool."""

    waiting: BoolArray
    """The `waiting` term is due."""
    hit: BoolArray
    """A strike hit the robot."""
    scored: BoolArray
    """The `success` term is due."""
    terminated: BoolArray
    success: BoolArray
    """The episode is a success; known at its end."""


@dataclass(frozen=True)
class Verdict:
    """The outcome of a step and its reward."""

    outcome: Outcome
    terms: FloatArray
    """Reward terms in the order of `TERMS`, shape (7, n)."""

    @property
    def reward(self) -> FloatArray:
        """The sum of the terms, shape (n,)."""
        # One after the other, whatever the number of episodes, so that one is rounded as many are.
        total: FloatArray = sum(self.terms[1:], start=self.terms[0])
        return total


class Judge(ABC):
    """The judge of n episodes; subclasses are the tasks."""

    extra_observations: int = 0
    """How many numbers the task appends to an observation."""

    def __init__(
        self, n: int, rules: Rules, weights: RewardWeights, fighter: Fighter, scenes: Scenes, chance: Chance
    ) -> None:
        self.n, self.rules, self.weights = n, rules, weights
        self.fighter, self.scenes, self.chance = fighter, scenes, chance
        self._weights = np.array([_SIGNS[name] * getattr(weights, name) for name in TERMS])[:, None]

    @abstractmethod
    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""

    @abstractmethod
    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the opponent may begin a strike at times (n,), shape (n,)."""

    def stands(self) -> BoolArray:
        """Return where the opponent does not walk, shape (n,)."""
        return np.zeros(self.n, bool)

    def walk_velocity(self, time_s: FloatArray) -> FloatArray | None:
        """Return the velocity the opponent aims for at times (n,), shape (2, n) [m/s]; None: keep maai."""
        return None

    def observe(self) -> FloatArray:
        """Return what the task appends to an observation, shape (extra_observations, n)."""
        return np.zeros((0, self.n))

    def report(self) -> dict[str, Any]:
        """Return what the task adds to `info`: arrays (n,) by name."""
        return {}

    def judge(self, end_s: FloatArray, effort: FloatArray) -> Verdict:
        """Judge the step until `end_s` (n,), given the length of the command's change, `effort` (n,)."""
        rules, scene = self.rules, self.scenes.now
        distance, bearing = self.scenes.separation()
        half = rules.field_m / 2
        out = (np.abs(scene[0]) > half) | (np.abs(scene[1]) > half) | (distance < rules.clash_m)
        outcome = self._outcome(end_s, out)
        # All terms at once: a single environment calls this in each step.
        terms = np.empty((len(TERMS), self.n))
        terms[0] = np.abs(distance - rules.maai_m) / rules.band_m
        terms[1] = np.abs(bearing) / rules.facing_rad
        np.minimum(terms[:2], 3.0, out=terms[:2])
        terms[2], terms[3], terms[4] = effort, outcome.waiting, outcome.hit
        terms[5], terms[6] = outcome.scored, out
        terms *= self._weights
        # Added to 0.0, so that a term that is not due is not -0.0.
        terms += 0.0
        return Verdict(outcome, terms)

    @abstractmethod
    def _outcome(self, end_s: FloatArray, out: BoolArray) -> Outcome:
        """Return what the step that ended at `end_s` (n,) led to; `out`: who left the field or clashed."""

    def _separation_at(
        self, rows: RowArray, now_s: FloatArray, then_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return distance [m] and bearing [rad] of some rows at the times `then_s` (n,), shape (m,) each."""
        return separation(self.scenes.ago_of(rows, now_s[rows] - then_s[rows]))


class Dodge(Judge):
    """One strike: offer an opening, evade the strike, and be back at maai, facing, one second later."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.check_s = np.full(self.n, np.inf)
        """When a robot that was not hit must be back [s]; infinite before the strike has ended."""

    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""
        self.check_s[rows] = np.inf

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the strike has not come yet, shape (n,), whatever the times (n,)."""
        return np.asarray(np.isinf(self.check_s))

    def stands(self) -> BoolArray:
        """Return where the strike is over and the opponent waits for the robot, shape (n,)."""
        return np.asarray(np.isfinite(self.check_s))

    def _outcome(self, end_s: FloatArray, out: BoolArray) -> Outcome:
        waiting, (hit, success) = np.isinf(self.check_s), np.zeros((2, self.n), bool)
        rows, hits = self.fighter.land(end_s)
        hit[rows] = hits
        self.check_s[rows] = self.fighter.sword.land_s[rows] + self.rules.return_s
        due = (self.check_s <= end_s) & ~out
        if due.any():
            rows = np.flatnonzero(due)
            success[rows] = self.rules.at_maai(*self._separation_at(rows, end_s, self.check_s))
        return Outcome(waiting, hit, success, out | hit | due, success)


class Track(Judge):
    """No strike: keep maai to an opponent that walks about, and face it, for most of the time."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._counted, self._kept = np.zeros(self.n), np.zeros(self.n)

    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""
        self._counted[rows] = self._kept[rows] = 0.0

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return False everywhere, shape (n,), whatever the times (n,)."""
        return np.zeros(self.n, bool)

    def walk_velocity(self, time_s: FloatArray) -> FloatArray:
        """Return the sum of sine waves that the opponent walks at times (n,), shape (2, n) [m/s]."""
        frequency, phase = self.chance.waves[:, :, 0], self.chance.waves[:, :, 1]
        wave = np.sin(frequency * time_s + phase)
        size = self.fighter.wander_m_s * np.sqrt(2.0 / WAVES)
        total = sum((wave[:, i] for i in range(1, WAVES)), start=wave[:, 0])
        return np.asarray(size * total - _HOME_PER_S * self.scenes.now[6:8])

    def report(self) -> dict[str, Any]:
        """Return the share of the counted time at maai and facing, shape (n,)."""
        return {"kept_share": self._kept / np.maximum(self._counted, 1.0)}

    def _outcome(self, end_s: FloatArray, out: BoolArray) -> Outcome:
        rules, never = self.rules, np.zeros(self.n, bool)
        counts = end_s > rules.track_settle_s
        self._counted += counts
        self._kept += counts & rules.at_maai(*self.scenes.separation())
        over = end_s >= rules.track_time_s - 1e-9
        success = over & ~out & (self._kept >= rules.track_share * self._counted)
        return Outcome(never, never, success, out, success)


class Duel(Judge):
    """Evade strikes and step in while the opponent recovers; within reach the robot strikes by itself."""

    extra_observations = 3

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.points = np.zeros((2, self.n), np.intp)
        """Points of the robot and of the opponent."""
        self.own_hit_s = np.full(self.n, np.inf)
        """When the strike of the robot that is under way ends [s]; infinite while there is none."""
        self._pause_until_s = np.zeros(self.n)

    def restart(self, rows: RowArray) -> None:
        """Begin a duel in some rows, shape (m,)."""
        self.points[:, rows] = 0
        self.own_hit_s[rows], self._pause_until_s[rows] = np.inf, 0.0

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the pause after a point is over at times (n,), shape (n,)."""
        return time_s >= self._pause_until_s

    def observe(self) -> FloatArray:
        """Return the points of robot and opponent, and whether the robot's sword strikes, shape (3, n)."""
        return np.concatenate([self.points.astype(float), np.isfinite(self.own_hit_s)[None].astype(float)])

    def report(self) -> dict[str, Any]:
        """Return the points of both, shape (n,) each."""
        return {"points": self.points[0].copy(), "points_against": self.points[1].copy()}

    def _outcome(self, end_s: FloatArray, out: BoolArray) -> Outcome:
        rules, sword = self.rules, self.fighter.sword
        hit = np.zeros(self.n, bool)
        rows, hits = self.fighter.land(end_s)
        hit[rows] = hits & (end_s[rows] >= self._pause_until_s[rows])
        self.fighter.exchange[rows] += 1
        scored = self._own_strike_hits(end_s) & ~hit
        self.points += np.array([scored, hit])
        paused = scored | hit
        self._pause_until_s = np.where(paused, end_s + rules.duel_pause_s, self._pause_until_s)
        self.own_hit_s = np.where(paused, np.inf, self.own_hit_s)
        # The robot's strike begins while the opponent still recovers from one that missed.
        distance, bearing = self.scenes.separation()
        recovers = ~sword.is_feint & (sword.land_s <= end_s) & (end_s < sword.free_s)
        begins = (
            recovers
            & np.isinf(self.own_hit_s)
            & (end_s >= self._pause_until_s)
            & (distance <= rules.own_reach_m)
            & (np.abs(bearing) <= rules.own_aim_rad)
        )
        self.own_hit_s = np.where(begins, end_s + rules.own_strike_s, self.own_hit_s)
        won, lost = self.points >= rules.duel_points
        return Outcome(np.ones(self.n, bool), hit, scored, out | won | lost, won & ~out)

    def _own_strike_hits(self, end_s: FloatArray) -> BoolArray:
        """Return where a strike of the robot ended in the step until `end_s` (n,) and hit, shape (n,)."""
        scored = np.zeros(self.n, bool)
        rows = np.flatnonzero(self.own_hit_s <= end_s)
        if len(rows):
            distance, bearing = self._separation_at(rows, end_s, self.own_hit_s)
            rules = self.rules
            scored[rows] = (distance <= rules.own_reach_m) & (np.abs(bearing) <= 2 * rules.own_aim_rad)
            self.own_hit_s[rows] = np.inf
        return scored
