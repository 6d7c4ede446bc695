"""The opponent's strike: when it will land, estimated from the motion of the tip, and by how much it misses.

The sword rises from guard along a smooth curve to a place that depends on the technique, then goes forward
(`mecanum_env.tankendo.sword`). The estimator keeps a grid of hypotheses (technique, feint or strike, start
and length of the rise) and adds up the log-likelihood of each observation under the sensors' noise. A strike
differs from a feint by its longer rise and by the step of the opponent's body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Observed, Opponent, Sensors
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M, TIP_VELOCITY_S, StrikeTimes
from mecanum_env.units import FloatArray

WARNING_S, _FEINT_S = (0.28, 1.02), (0.14, 0.30)
"""Ranges of the time from the first motion of a strike to its hit, and of the rise in a feint [s]; they span
all levels of difficulty, and the warnings that a certificate varies."""
_FEINT, _SECOND_FEINT = 0.3, 0.02
"""Probability that a rise is a feint: usually, and after a feint."""
_STEP_MEAN_S = 0.2
"""The observed velocity of a body that steps forward is taken as its mean over this time [s]."""
_START_GRID_S, _LENGTH_GRID_S = 0.01, 0.02
"""Spacing of the hypotheses' start and length of the rise [s]."""
_LOOK_BACK_S = 0.2
"""The rise began at most this long before it was noticed [s]."""
_ALARM = 25.0
"""Chi-square of four numbers above which the sword has left its guard; exceeded by chance once in 20,000."""
_MODEL_M, _MODEL_M_S, _BODY_M_S = 0.005, 0.05, 0.12
"""Standard deviations of the curves' own error, added to the sensors' noise: places, rates, body speed."""
_OUTLIER = 6.0
"""Largest deviation of one number that counts, in standard deviations."""
_RETURN_MARGIN = 5.0
"""Log-likelihood by which "still on guard" must exceed the best hypothesis to end a false alarm."""
_KEPT_PROBABILITY = 0.999
"""Share of the probability that the hypotheses of an estimate hold."""
_SHORTEST_M = 0.9
"""The opponent strikes no nearer than this to where it stands [m]; as `mecanum_env.tankendo.fighter`."""
_GUARD = np.array([GUARD_TIP_M, GUARD_HEIGHT_M, 0.0, 0.0, 0.0])
"""The five features of `_features` on guard."""


@dataclass(frozen=True)
class StrikeEstimate:
    """The m likeliest hypotheses, likeliest first; all arrays have shape (m,)."""

    weight: FloatArray
    """Probability of each hypothesis; they sum to 1."""
    technique: npt.NDArray[np.intp]
    """Index into `Opponent.techniques`."""
    is_feint: npt.NDArray[np.bool_]
    cut_in_s: FloatArray
    """Time until the sword goes forward [s]; negative if it already does."""
    land_in_s: FloatArray
    """Time until the hit [s]; of a feint, until the sword sinks."""
    row: npt.NDArray[np.intp]
    """Row in the estimator's grid."""

    @property
    def strike_probability(self) -> float:
        """Probability that the motion is a strike and no feint."""
        return float(np.sum(self.weight[~self.is_feint]))

    @property
    def land_s(self) -> float:
        """Mean time until the hit, given that it is a strike [s]; NaN if it surely is a feint."""
        weight = np.where(self.is_feint, 0.0, self.weight)
        return float(np.sum(weight * self.land_in_s) / np.sum(weight)) if weight.any() else float("nan")


class StrikePhase:
    """Estimates the phase of the strike from one observation every `step_s`.

    The opponent's techniques, its step and its times of recovery are taken as known, and that its warning is
    within a range [s].
    """

    def __init__(
        self,
        opponent: Opponent | None = None,
        step_s: float = 0.1,
        warning_s: tuple[float, float] = WARNING_S,
    ) -> None:
        self._grid = _Grid(Opponent() if opponent is None else opponent, warning_s)
        self._step_s = step_s
        place, rate, body = Sensors.position_m, Sensors.tip_velocity_m_s, Sensors.velocity_m_s
        # Of the features: the first is a difference of two places, the third one of two velocities.
        self._sigma = np.array(
            [
                np.hypot(np.sqrt(2.0) * place, _MODEL_M),
                np.hypot(place, _MODEL_M),
                np.hypot(np.hypot(rate, body), _MODEL_M_S),
                np.hypot(rate, _MODEL_M_S),
                np.hypot(body, _BODY_M_S),
            ]
        )
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._clock_s = -self._step_s
        self._feinted = False
        self._to_guard()

    def _to_guard(self) -> None:
        self._past: list[tuple[float, FloatArray]] = []
        self._log_weight: FloatArray | None = None
        self._log_guard = 0.0
        self._alarm_s = 0.0

    def update(self, seen: Observed) -> StrikeEstimate | None:
        """Take in the next observation `seen`; return the estimate, or None while the sword is on guard."""
        self._clock_s += self._step_s
        shown_s = self._clock_s - Sensors.delay_s
        features = _features(seen)
        chi2 = self._chi2_on_guard(features)
        if self._log_weight is None:
            self._past = [*self._past[-1:], (shown_s, features)]
            if chi2 < _ALARM:
                return None
            self._alarm_s = shown_s
            self._log_weight = self._grid.log_prior(_SECOND_FEINT if self._feinted else _FEINT)
            self._log_guard = 0.0
            new = self._past
        else:
            new = [(shown_s, features)]
        for time_s, numbers in new:
            self._log_weight = self._log_weight + self._log_likelihood(time_s, numbers)
            self._log_guard += -0.5 * self._chi2_on_guard(numbers)
        if self._is_over(self._log_weight, shown_s, chi2):
            self._to_guard()
            return None
        return self._estimate(self._log_weight)

    def stepped_m(self, estimate: StrikeEstimate, in_s: float = 0.0) -> float:
        """Return how far the body will have stepped forward [m] in `in_s` by the likeliest strike."""
        strikes = np.flatnonzero(~estimate.is_feint)
        if not len(strikes):
            return 0.0
        return self._grid.stepped_m(int(estimate.row[strikes[0]]), self._clock_s + in_s - self._alarm_s)

    def _chi2_on_guard(self, features: FloatArray) -> float:
        return float(np.sum(((features - _GUARD)[:4] / self._sigma[:4]) ** 2))

    def _log_likelihood(self, time_s: float, features: FloatArray) -> FloatArray:
        predicted, known = self._grid.features(time_s - self._alarm_s)
        deviation = np.minimum(np.abs(features[:, None] - predicted) / self._sigma[:, None], _OUTLIER)
        # A number that a hypothesis does not predict counts as one standard deviation off.
        return np.asarray(-0.5 * np.sum(np.where(known, deviation * deviation, 1.0), axis=0))

    def _is_over(self, log_weight: FloatArray, shown_s: float, chi2: float) -> bool:
        """Return whether the sword is on guard again, or never left it; remember whether it was a feint."""
        if chi2 >= _ALARM:
            return False
        likeliest = int(np.argmax(log_weight))
        if shown_s - self._alarm_s >= self._grid.times.free_s[likeliest]:
            self._feinted = bool(self._grid.times.is_feint[likeliest])
            return True
        return bool(self._log_guard > log_weight[likeliest] + _RETURN_MARGIN)

    def _estimate(self, log_weight: FloatArray) -> StrikeEstimate:
        weight = np.exp(log_weight - np.max(log_weight))
        order = np.argsort(-weight)
        weight = weight[order]
        cumulative = np.cumsum(weight)
        order = order[: 1 + int(np.searchsorted(cumulative, _KEPT_PROBABILITY * cumulative[-1]))]
        weight = weight[: len(order)]
        now, times = self._clock_s - self._alarm_s, self._grid.times
        return StrikeEstimate(
            weight=weight / weight.sum(),
            technique=self._grid.technique[order],
            is_feint=times.is_feint[order],
            cut_in_s=times.cut_s[order] - now,
            land_in_s=times.land_s[order] - now,
            row=order,
        )


def _features(seen: Observed) -> FloatArray:
    """Return the tip's distance ahead and height [m], their rates, and the body's speed [m/s], shape (5,)."""
    along = np.array([float(seen.tip_x - seen.opponent_x), float(seen.tip_y - seen.opponent_y)])
    ahead = max(float(np.hypot(*along)), 1e-6)
    along = along / ahead
    body = np.array([float(seen.opponent_vx), float(seen.opponent_vy)])
    tip = np.array([float(seen.tip_vx), float(seen.tip_vy)])
    return np.array(
        [ahead, float(seen.tip_height), along @ (tip - body), float(seen.tip_rising), float(along @ body)]
    )


class _Grid:
    """The hypotheses, m of them; times are seconds after the alarm, arrays have shape (m,)."""

    def __init__(self, opponent: Opponent, warning_s: tuple[float, float]) -> None:
        warnings, feints = (
            np.arange(shortest, longest + 1e-9, _LENGTH_GRID_S) for shortest, longest in (warning_s, _FEINT_S)
        )
        starts = np.arange(-_LOOK_BACK_S, 1e-9, _START_GRID_S)
        techniques = opponent.techniques
        axes = np.arange(len(techniques)), np.arange(len(warnings) + len(feints)), starts
        technique, kind, start = (axis.ravel() for axis in np.meshgrid(*axes, indexing="ij"))
        self.technique: npt.NDArray[np.intp] = technique.astype(np.intp)
        is_feint = kind >= len(warnings)
        land = start + np.concatenate([warnings, feints])[kind]

        def each(name: str) -> FloatArray:
            return np.asarray(np.array([getattr(one, name) for one in techniques], float)[technique])

        cut = np.where(is_feint, land, land - each("swing_s"))
        free = land + np.where(is_feint, opponent.lower_s, opponent.recovery_s)
        self.times = StrikeTimes(start, cut, land, free, is_feint)
        self._raised_m, self._raised_height_m = each("raised_tip_m"), each("raised_height_m")
        self._end_height_m = each("target_height_m")
        self._step_m = opponent.step_m
        lengths = np.where(is_feint, len(feints), len(warnings))
        self._share = 1.0 / (lengths * len(starts)) / len(techniques)

    def log_prior(self, feint_probability: float) -> FloatArray:
        """Return the logarithm of each hypothesis's prior probability."""
        kind = np.where(self.times.is_feint, feint_probability, 1.0 - feint_probability)
        return np.asarray(np.log(kind * self._share), float)

    def features(self, time_s: float) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return the features that each hypothesis predicts, (5, m), and which of them it does predict."""
        ahead, height = self._tip(time_s)
        ahead_before, height_before = self._tip(time_s - TIP_VELOCITY_S)
        stepped = self.times.step_share(time_s + 0.25 * _STEP_MEAN_S)
        body = self._step_m / _STEP_MEAN_S * (stepped - self.times.step_share(time_s - 0.75 * _STEP_MEAN_S))
        rates = (ahead - ahead_before) / TIP_VELOCITY_S, (height - height_before) / TIP_VELOCITY_S
        predicted = np.array([ahead, height, *rates, body])
        known = np.ones(predicted.shape, bool)
        # Once the sword goes forward, its distance depends on the aim, which cannot be observed.
        known[[0, 2]] = self.times.is_feint | (time_s <= self.times.cut_s)
        return predicted, known

    def stepped_m(self, row: int, time_s: float) -> float:
        """Return how far the body has stepped forward [m] by the hypothesis in a row."""
        return self._step_m * float(self.times.step_share(time_s)[row])

    def _tip(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        """Return the tip's distance ahead, as if it did not go forward, and its height [m]."""
        shares = self.times.shares(time_s)
        drawn = shares.ahead(self._raised_m)
        height = shares.height(self._raised_height_m, self._end_height_m)
        return shares.place(drawn, drawn, GUARD_TIP_M), height


@dataclass(frozen=True)
class RobotStates:
    """Robots at one time: position x, y [m], yaw [rad], velocity vx, vy [m/s]; arrays of one shape."""

    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    vx: FloatArray
    vy: FloatArray


def miss_margin(
    opponent: Opponent,
    technique: npt.NDArray[np.intp],
    origin: FloatArray,
    seen: RobotStates,
    landed: RobotStates,
    waiting: FloatArray,
) -> FloatArray:
    """Return by how much strikes miss the robots [m], negative for a hit, in the shape of the robots' arrays.

    The opponent aims at the robot's target as it saw it, moved on with the velocity that it expects, within
    its reach: `mecanum_env.tankendo.fighter` without the noise of the aim. An adaptive opponent expects of
    the velocity with which the robot waited only the share `habit` to go on.

    Args:
        opponent: its reach, lead, sight delay and techniques are used.
        technique: index of each strike's technique; it broadcasts against the robots' arrays.
        origin: position x, y of the opponent when the strike began [m], shape (2,).
        seen: the robots when they were last seen, one sight delay before the sword goes forward.
        landed: the robots when the strikes land.
        waiting: velocity of the robot when the sword rose: vx, vy [m/s], shape (2,) or (2, n).
    """
    table = {
        name: np.array([getattr(t, name) for t in opponent.techniques])[technique]
        for name in ("swing_s", "reach_m", "width_m", "depth_m", "blade_m", "target_m")
    }
    lead = 0.0 if opponent.lead_form == "none" else opponent.lead
    past = (1.0 - opponent.habit) * waiting if opponent.lead_form == "adaptive" else np.zeros(2)
    ahead_s = lead * (table["swing_s"] + opponent.sight_delay_s)
    offset = table["target_m"]
    dx = seen.x + offset * np.cos(seen.yaw) + ahead_s * (seen.vx - past[0]) - origin[0]
    dy = seen.y + offset * np.sin(seen.yaw) + ahead_s * (seen.vy - past[1]) - origin[1]
    wanted = np.maximum(np.hypot(dx, dy), 1e-6)
    reach = np.maximum(table["reach_m"] + opponent.extra_reach_m, _SHORTEST_M)
    length = np.minimum(np.maximum(wanted, _SHORTEST_M), reach)
    along_x, along_y = dx / wanted, dy / wanted
    x = landed.x + offset * np.cos(landed.yaw) - origin[0] - length * along_x
    y = landed.y + offset * np.sin(landed.yaw) - origin[1] - length * along_y
    behind, across = x * along_x + y * along_y, y * along_x - x * along_y
    half_width = (table["width_m"] + opponent.extra_size_m) / 2
    depth = table["depth_m"] + opponent.extra_size_m
    beside = np.maximum(np.abs(across) - half_width, behind - depth)
    return np.asarray(np.maximum(beside, -table["blade_m"] - behind), float)
