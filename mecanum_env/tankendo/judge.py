"""Hits, the two rules, rewards and ends of an episode: what all tasks share, and the dodge.

Terms of the reward, all tasks (weights: `RewardWeights`):

| term | a step |
|---|---|
| `distance` | -weight * min(abs(distance - maai) / band, 3) |
| `facing` | -weight * min(abs(bearing) / facing angle, 3) |
| `effort` | -weight * length of the change of (V cos theta, V sin theta, VC), each over its full value |
| `waiting` | -weight before the strike has come; in the duel always, in tracking never |
| `hit` | -weight when a strike hits the robot |
| `success` | +weight when the episode is one, or a point is made in the duel |
| `out` | -weight when the robot leaves the field or clashes |
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from mecanum_env.tankendo.chance import Chance
from mecanum_env.tankendo.constants import RewardWeights, Rules
from mecanum_env.tankendo.opponent import Fighter
from mecanum_env.tankendo.scene import BoolArray, RowArray, Scenes, separation
from mecanum_env.units import FloatArray

TERMS: Final = ("distance", "facing", "effort", "waiting", "hit", "success", "out")
"""Names of the reward's terms, in the order in which they are summed."""
_WORST = 3.0


@dataclass(frozen=True)
class Verdict:
    """What a step brought to n episodes."""

    terms: dict[str, FloatArray]
    """The reward's terms by name, (n,) each."""
    terminated: BoolArray
    success: BoolArray
    """Whether the episode is a success, known at its end."""
    hit: BoolArray
    """Whether a strike hit the robot in this step."""

    @property
    def reward(self) -> FloatArray:
        """The sum of the terms, (n,)."""
        total = np.zeros(self.terminated.shape)
        for name in TERMS:
            total += self.terms[name]
        return total


class Judge:
    """The judge of n episodes; this one lets the opponent strike and ends on leaving the field or a clash.

    Args:
        n: number of episodes.
        rules: what counts.
        weights: of the reward's terms.
        fighter: the opponents.
        scenes: where everybody is.
        chance: what was drawn.
    """

    extra_observations: int = 0
    """Numbers that the task adds to an observation."""

    def __init__(
        self,
        n: int,
        rules: Rules,
        weights: RewardWeights,
        fighter: Fighter,
        scenes: Scenes,
        chance: Chance,
    ) -> None:
        self.n, self.rules, self.weights = n, rules, weights
        self.fighter, self.scenes, self.chance = fighter, scenes, chance

    @staticmethod
    def time_limit_s(rules: Rules) -> float:
        """Return how long an episode may last [s] by the rules."""
        return rules.dodge_time_s

    def restart(self, row: int) -> None:
        """Begin an episode in one row."""

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the opponent may begin a strike at times (n,), shape (n,)."""
        return np.ones(time_s.shape, bool)

    def stands(self, time_s: FloatArray) -> BoolArray:
        """Return where the opponent does not walk at times (n,), shape (n,)."""
        return np.zeros(time_s.shape, bool)

    def wish(self, time_s: FloatArray) -> FloatArray | None:
        """Return the velocity that the opponent wants at times (n,), (2, n) [m/s]; None: keep distance."""
        return None

    def observe(self, time_s: FloatArray) -> FloatArray:
        """Return what the task adds to an observation at times (n,), shape (extra_observations, n)."""
        return np.zeros((0, self.n))

    def report(self) -> dict[str, Any]:
        """Return what the task adds to `info`, arrays (n,) by name."""
        return {}

    def judge(self, end_s: FloatArray, effort: FloatArray) -> Verdict:
        """Judge the step that ended at `end_s`, (n,), with the command's change `effort`, (n,)."""
        raise NotImplementedError

    def common_terms(self, effort: FloatArray) -> tuple[dict[str, FloatArray], BoolArray]:
        """Return the terms that do not depend on the task, and who left the field or clashed.

        Args:
            effort: length of the command's change, (n,).
        """
        rules, weights, scene = self.rules, self.weights, self.scenes.now
        distance, bearing = self.scenes.separation()
        half = rules.field_m / 2
        out = (np.abs(scene[0]) > half) | (np.abs(scene[1]) > half) | (distance < rules.clash_m)
        off = np.abs(distance - rules.maai_m) / rules.band_m
        terms = {
            "distance": -weights.distance * np.minimum(off, _WORST),
            "facing": -weights.facing * np.minimum(np.abs(bearing) / rules.facing_rad, _WORST),
            "effort": 0.0 - weights.effort * effort,
            "out": 0.0 - weights.out * out,
        }
        return terms, out

    def at_maai(self, rows: RowArray, ago_s: FloatArray) -> BoolArray:
        """Return whether robots `rows` (m,) were at maai and facing `ago_s` (m,) before now, shape (m,)."""
        distance, bearing = separation(self.scenes.ago_of(rows, ago_s))
        rules = self.rules
        there: BoolArray = (np.abs(distance - rules.maai_m) <= rules.band_m) & (
            np.abs(bearing) <= rules.facing_rad
        )
        return there


class Dodge(Judge):
    """One strike: be open, evade it, and be back at maai, facing, a second later."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.check_s = np.full(self.n, np.inf)
        """When a robot that was not hit must be back [s]; infinite before the strike ends."""

    def restart(self, row: int) -> None:
        """Begin an episode in one row."""
        self.check_s[row] = np.inf

    def may_strike(self, time_s: FloatArray) -> BoolArray:
        """Return where the strike has not come yet, shape (n,), whatever the times (n,)."""
        waits: BoolArray = np.isinf(self.check_s)
        return waits

    def stands(self, time_s: FloatArray) -> BoolArray:
        """Return where the strike is over, shape (n,), whatever the times (n,): it waits for the robot."""
        over: BoolArray = np.isfinite(self.check_s)
        return over

    def judge(self, end_s: FloatArray, effort: FloatArray) -> Verdict:
        """Judge the step that ended at `end_s`, (n,), with the command's change `effort`, (n,)."""
        terms, out = self.common_terms(effort)
        hit, success, terminated = (np.zeros(self.n, bool) for _ in range(3))
        waits = np.isinf(self.check_s)
        rows, hits = self.fighter.land(end_s)
        hit[rows] = hits
        self.check_s[rows] = self.fighter.sword.land_s[rows] + self.rules.return_s
        due = (self.check_s <= end_s) & ~out
        if due.any():
            rows = np.flatnonzero(due)
            success[rows] = self.at_maai(rows, end_s[rows] - self.check_s[rows])
        terminated[:] = out | hit | due
        terms["waiting"] = np.asarray(0.0 - self.weights.waiting * waits, float)
        terms["hit"] = np.asarray(0.0 - self.weights.hit * hit, float)
        terms["success"] = np.asarray(self.weights.success * success, float)
        return Verdict(terms, terminated, success, hit)
