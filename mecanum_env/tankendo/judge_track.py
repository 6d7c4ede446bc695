"""The tracking task: the opponent walks about, the robot keeps maai and faces it."""

from __future__ import annotations

from typing import Any

import numpy as np

from mecanum_env.tankendo.chance import WAVES
from mecanum_env.tankendo.constants import Rules
from mecanum_env.tankendo.judge import Judge, Verdict
from mecanum_env.tankendo.opponent import BoolArray
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
