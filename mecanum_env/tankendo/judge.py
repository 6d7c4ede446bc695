"""What counts: hits, the two rules, rewards and the end of an episode, for each task.

`TankendoEnv` has the formulae of the reward terms, `RewardWeights` their weights.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from mecanum_env.tankendo.chance import EXCHANGES, WAVES, Chance
from mecanum_env.tankendo.constants import RewardWeights, Rules
from mecanum_env.tankendo.fighter import Fighter
from mecanum_env.tankendo.numbers import Many, Number, mathematics
from mecanum_env.tankendo.scene import RowArray, Scenes, separation
from mecanum_env.units import FloatArray

TERMS: Final = ("distance", "facing", "effort", "waiting", "hit", "success", "out")
"""Names of the reward terms, in the order in which they are summed."""
_SIGNS: Final = {name: 1.0 if name == "success" else -1.0 for name in TERMS}
_HOME_PER_S = 0.3  # in tracking, the opponent drifts back to the field's centre at this rate [1/s]


class Outcome(NamedTuple):
    """What a step led to, by the rules of one task; bools."""

    waiting: Number
    """The `waiting` term is due."""
    hit: Number
    """A strike hit the robot."""
    scored: Number
    """The `success` term is due."""
    terminated: Number
    success: Number
    """The episode is a success; known at its end."""


class Verdict(NamedTuple):
    """The outcome of a step and its reward."""

    outcome: Outcome
    terms: Sequence[Number]
    """Reward terms in the order of `TERMS`."""

    @property
    def reward(self) -> Number:
        """The sum of the terms."""
        # One after the other, whatever the number of episodes, so that one is rounded as many are.
        return sum(self.terms[1:], start=self.terms[0])


class Judge(ABC):
    """The judge of n episodes; subclasses are the tasks.

    What they are given and return are numbers of one episode or of many (`mecanum_env.tankendo.numbers`).
    """

    extra_observations: int = 0
    """How many numbers the task appends to an observation."""
    exchanges: int = EXCHANGES
    """After how many strikes an episode may begin again with the draws of the first."""

    def __init__(
        self, n: int, rules: Rules, weights: RewardWeights, fighter: Fighter, scenes: Scenes, chance: Chance
    ) -> None:
        self.n, self.rules, self.weights = n, rules, weights
        self.fighter, self.scenes, self.chance = fighter, scenes, chance
        self._math = mathematics(n)
        self._weights = [_SIGNS[name] * getattr(weights, name) for name in TERMS]

    @abstractmethod
    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""

    @abstractmethod
    def may_strike(self, time_s: Number) -> Number:
        """Return where the opponent may begin a strike at a time."""

    def stands(self) -> Number:
        """Return where the opponent does not walk."""
        return self._math.nowhere()

    def walk_velocity(self, time_s: Number) -> tuple[Number, Number] | None:
        """Return the velocity the opponent aims for at a time, along x and y [m/s]; None: keep maai."""
        return None

    def observe(self) -> Sequence[Number]:
        """Return what the task appends to an observation: `extra_observations` numbers."""
        return ()

    def report(self) -> dict[str, Number]:
        """Return what the task adds to `info` by name."""
        return {}

    def judge(self, end_s: Number, effort: Number) -> Verdict:
        """Judge the step until a time, given the length of the command's change, `effort`."""
        rules, least = self.rules, self._math.minimum
        distance, bearing = self.scenes.apart()
        out = self._left_field() | self._clashed()
        outcome = self._outcome(end_s, out)
        off = least(abs(distance - rules.maai_m) / rules.band_m, 3.0)
        turned = least(abs(bearing) / rules.facing_rad, 3.0)
        due = (off, turned, effort, outcome.waiting, outcome.hit, outcome.scored, out)
        # Added to 0.0, so that a term that is not due is not -0.0.
        terms = [weight * term + 0.0 for weight, term in zip(self._weights, due, strict=True)]
        return Verdict(outcome, terms)

    def _left_field(self) -> Number:
        """Return where the robot has left the field."""
        (x, y), half = self.scenes.newest()[:2], self.rules.field_m / 2
        return (abs(x) > half) | (abs(y) > half)

    def _clashed(self) -> Number:
        """Return where the robot has clashed with the opponent."""
        return self.scenes.apart()[0] < self.rules.clash_m

    @abstractmethod
    def _outcome(self, end_s: Number, out: Number) -> Outcome:
        """Return what the step that ended at a time led to; `out`: who left the field or clashed."""

    def _separation_at(self, rows: RowArray, now_s: Number, then_s: FloatArray) -> tuple[Number, Number]:
        """Return distance [m] and bearing [rad] of some rows (m,) at the times `then_s` (n,), arrays (m,)."""
        then = self.scenes.ago_of(rows, self._math.array(now_s)[rows] - then_s[rows])
        return separation(Many(len(rows)), then[6] - then[0], then[7] - then[1], then[2])


class Dodge(Judge):
    """One strike: offer an opening, evade the strike, and be back at maai, facing, one second later."""

    exchanges = 1

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.check_s = np.full(self.n, np.inf)
        """When a robot that was not hit must be back [s]; infinite before the strike has ended."""

    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""
        self.check_s[rows] = np.inf

    def may_strike(self, time_s: Number) -> Number:
        """Return where the strike has not come yet, whatever the time."""
        return self._math.of(self.check_s) == np.inf

    def stands(self) -> Number:
        """Return where the strike is over and the opponent waits for the robot."""
        return self._math.of(self.check_s) < np.inf

    def _outcome(self, end_s: Number, out: Number) -> Outcome:
        math = self._math
        waiting, success = math.of(self.check_s) == np.inf, math.nowhere()
        rows, hits = self.fighter.land(end_s)
        hit = math.marked(rows, hits)
        if len(rows):
            self.check_s[rows] = self.fighter.sword.land_s[rows] + self.rules.return_s
        due = (math.of(self.check_s) <= end_s) & math.no(out)
        if math.any(due):
            rows = np.flatnonzero(due)
            back = self.rules.at_maai(*self._separation_at(rows, end_s, self.check_s))
            success = math.marked(rows, back)
        return Outcome(waiting, hit, success, out | hit | due, success)


class Track(Judge):
    """No strike: keep maai to an opponent that walks about, and face it, for most of the time."""

    exchanges = 1

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self._counted, self._kept = np.zeros(self.n), np.zeros(self.n)

    def restart(self, rows: RowArray) -> None:
        """Begin an episode in some rows, shape (m,)."""
        self._counted[rows] = self._kept[rows] = 0.0

    def may_strike(self, time_s: Number) -> Number:
        """Return False, whatever the time."""
        return self._math.nowhere()

    def walk_velocity(self, time_s: Number) -> tuple[Number, Number]:
        """Return the sum of sine waves that the opponent walks at a time, along x and y [m/s]."""
        math = self._math
        size = math.of(self.fighter.wander_m_s) * math.sqrt(2.0 / WAVES)
        velocity = []
        for waves, home in zip(math.of(self.chance.waves), self.scenes.newest()[6:8], strict=True):
            total, *rest = (math.sin(frequency * time_s + phase) for frequency, phase in waves)
            for wave in rest:
                total = total + wave
            velocity.append(size * total - _HOME_PER_S * home)
        return velocity[0], velocity[1]

    def report(self) -> dict[str, Number]:
        """Return the share of the counted time at maai and facing."""
        math = self._math
        return {"kept_share": math.of(self._kept) / math.maximum(math.of(self._counted), 1.0)}

    def _outcome(self, end_s: Number, out: Number) -> Outcome:
        math, rules = self._math, self.rules
        counts = end_s > rules.track_settle_s
        self._counted += counts
        self._kept += counts & rules.at_maai(*self.scenes.apart())
        over = end_s >= rules.track_time_s - 1e-9
        kept = math.of(self._kept) >= rules.track_share * math.of(self._counted)
        never, success = math.nowhere(), over & math.no(out) & kept
        return Outcome(never, never, success, out, success)


class ForPoints(Judge):
    """What all fights for points share: the score, the pause after a point, and the observation of both."""

    extra_observations = 3

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.points = np.zeros((2, self.n), np.intp)
        """Points of the robot and of the opponent."""
        self._pause_until_s = np.zeros(self.n)

    def restart(self, rows: RowArray) -> None:
        """Begin a fight in some rows, shape (m,)."""
        self.points[:, rows] = 0
        self._pause_until_s[rows] = 0.0

    def may_strike(self, time_s: Number) -> Number:
        """Return where the pause after a point is over at a time."""
        return time_s >= self._math.of(self._pause_until_s)

    @abstractmethod
    def own_strikes(self) -> Number:
        """Return where the robot's own sword strikes."""

    def observe(self) -> Sequence[Number]:
        """Return the points of robot and opponent, and whether the robot's sword strikes."""
        return [*self._math.of(self.points), self.own_strikes()]

    def report(self) -> dict[str, Number]:
        """Return the points of both."""
        own, other = self._math.of(self.points.copy())
        return {"points": own, "points_against": other}

    def _hits(self, end_s: Number) -> Number:
        """Return where a strike of the opponent ended in the step until a time and counts."""
        rows, hits = self.fighter.land(end_s)
        self.fighter.exchange[rows] += 1
        counts = self._math.array(end_s)[rows] >= self._pause_until_s[rows]
        return self._math.marked(rows, hits & counts)

    def _count(self, end_s: Number, scored: Number, hit: Number) -> Number:
        """Count points for and against at a time; return where one was given and a pause begins."""
        math, paused = self._math, scored | hit
        if math.any(paused):
            self.points[0] += scored
            self.points[1] += hit
            until_s = math.where(paused, end_s + self.rules.duel_pause_s, math.of(self._pause_until_s))
            self._pause_until_s[:] = until_s
        return paused


class Duel(ForPoints):
    """Evade strikes and step in while the opponent recovers; within reach the robot strikes by itself."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.own_hit_s = np.full(self.n, np.inf)
        """When the strike of the robot that is under way ends [s]; infinite while there is none."""

    def restart(self, rows: RowArray) -> None:
        """Begin a duel in some rows, shape (m,)."""
        super().restart(rows)
        self.own_hit_s[rows] = np.inf

    def own_strikes(self) -> Number:
        """Return where the robot's own sword strikes."""
        return self._math.of(self.own_hit_s) < np.inf

    def _outcome(self, end_s: Number, out: Number) -> Outcome:
        math, rules, sword = self._math, self.rules, self.fighter.sword
        hit = self._hits(end_s)
        scored = self._own_strike_hits(end_s) & math.no(hit)
        paused = self._count(end_s, scored, hit)
        own_hit_s = math.where(paused, np.inf, math.of(self.own_hit_s))
        # The robot's strike begins while the opponent still recovers from one that missed.
        distance, bearing = self.scenes.apart()
        land_s, free_s = math.of(sword.land_s), math.of(sword.free_s)
        recovers = math.no(math.of(sword.is_feint)) & (land_s <= end_s) & (end_s < free_s)
        begins = (
            recovers
            & (own_hit_s == np.inf)
            & self.may_strike(end_s)
            & (distance <= rules.own_reach_m)
            & (abs(bearing) <= rules.own_aim_rad)
        )
        self.own_hit_s[:] = math.where(begins, end_s + rules.own_strike_s, own_hit_s)
        own, other = math.of(self.points)
        won, lost = own >= rules.duel_points, other >= rules.duel_points
        always = math.no(math.nowhere())
        return Outcome(always, hit, scored, out | won | lost, won & math.no(out))

    def _own_strike_hits(self, end_s: Number) -> Number:
        """Return where a strike of the robot ended in the step until a time and hit."""
        ends = self._math.of(self.own_hit_s) <= end_s
        if not self._math.any(ends):
            return self._math.nowhere()
        rows, rules = np.flatnonzero(ends), self.rules
        distance, bearing = self._separation_at(rows, end_s, self.own_hit_s)
        self.own_hit_s[rows] = np.inf
        near = (distance <= rules.own_reach_m) & (abs(bearing) <= 2 * rules.own_aim_rad)
        return self._math.marked(rows, near)
