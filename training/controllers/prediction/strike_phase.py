"""Which strike is under way and when it lands, estimated from how the tip moves.

The sword rises from guard along a smooth curve to a place that depends on the technique, then goes forward.
The estimator keeps a grid of hypotheses (technique, feint or strike, start and length of the rise), adds up
the log-likelihood of each observation, normal with the sensors' noise, and reads all it says off the weights.
A strike differs from a feint by its longer rise and by the step of the opponent's body.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Observed, Opponent, Sensors
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from mecanum_env.units import FloatArray

_RATE_S = 0.01  # the tip's seen velocity is its mean over this time
_STEP_MEAN_S = 0.2  # the seen velocity of the body is its mean over this time
_START_GRID_S, _LENGTH_GRID_S = 0.01, 0.02
_LOOK_BACK_S = 0.2
_ALARM = 25.0  # chi^2 of four numbers beyond which the sword has left its guard; by chance once in 20,000
_MODEL_M, _MODEL_M_S, _BODY_M_S = 0.005, 0.05, 0.12  # what the curves leave out, beside the sensors' noise
_SECOND_FEINT = 0.02
_OUTLIER = 6.0  # standard deviations that one number counts at most


@dataclass(frozen=True)
class StrikePriors:
    """What is held possible before anything is seen; the defaults span all levels of difficulty."""

    warning_s: tuple[float, float] = (0.36, 0.74)
    """From the first motion of a strike to its hit [s]."""
    feint_s: tuple[float, float] = (0.14, 0.30)
    """How long the sword rises in a feint [s]."""
    feint_probability: float = 0.3
    """Of the first rise; a second feint in a row is held unlikely."""


@dataclass(frozen=True)
class StrikeEstimate:
    """What is known of the sword; hypotheses have arrays (m,) of equal length, likeliest first."""

    weight: FloatArray
    """Probability of each hypothesis; they sum to 1."""
    technique: npt.NDArray[np.intp]
    """Index into `Opponent.techniques`."""
    is_feint: npt.NDArray[np.bool_]
    cut_in_s: FloatArray
    """Until the sword goes forward [s]; negative: it does."""
    land_in_s: FloatArray
    """Until the hit [s]; of a feint, until the sword sinks."""
    row: npt.NDArray[np.intp]
    """Of the estimator's grid."""

    @property
    def strike_probability(self) -> float:
        """That it is a strike and no feint."""
        return float(np.sum(self.weight[~self.is_feint]))

    @property
    def land_s(self) -> float:
        """Mean time until the hit, if it is a strike [s]; nan if it surely is none."""
        weight = np.where(self.is_feint, 0.0, self.weight)
        return float(np.sum(weight * self.land_in_s) / np.sum(weight)) if weight.any() else float("nan")

    def technique_probabilities(self, count: int) -> FloatArray:
        """Return the probability of each of the `count` techniques, shape (count,)."""
        return np.asarray(np.bincount(self.technique, self.weight, minlength=count), float)


class StrikePhase:
    """Estimates the phase of the strike, one observation every `step_s`.

    Args:
        opponent: its techniques, step, and times of recovery are taken as known.
        priors: what else is held possible.
        sensors: their noise and delay.
        step_s: between two observations.
    """

    def __init__(
        self,
        opponent: Opponent | None = None,
        priors: StrikePriors | None = None,
        sensors: Sensors | None = None,
        step_s: float = 0.1,
    ) -> None:
        self._opponent = Opponent() if opponent is None else opponent
        self._priors = StrikePriors() if priors is None else priors
        self._sensors = Sensors() if sensors is None else sensors
        self._step_s = step_s
        self._grid = _Grid(self._opponent, self._priors)
        place, rate = self._sensors.position_m, self._sensors.tip_velocity_m_s
        body = self._sensors.velocity_m_s
        # ahead (a difference of two places), height, rates of both, speed of the body.
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
        self._log: FloatArray | None = None
        self._null = 0.0
        self._alarm_s = 0.0

    def update(self, seen: Observed) -> StrikeEstimate | None:
        """Take in the next observation `seen`; return what is known, or None while the sword is on guard."""
        self._clock_s += self._step_s
        shown_s = self._clock_s - self._sensors.delay_s
        features = _features(seen)
        calm = features - _GUARD
        chi2 = float(np.sum((calm[:4] / self._sigma[:4]) ** 2))
        if self._log is None:
            self._past = [*self._past[-1:], (shown_s, features)]
            if chi2 < _ALARM:
                return None
            self._alarm_s = shown_s
            self._log = self._grid.log_prior(
                _SECOND_FEINT if self._feinted else self._priors.feint_probability
            )
            self._null = 0.0
            new = self._past
        else:
            new = [(shown_s, features)]
        for time_s, numbers in new:
            self._log = self._log + self._likelihood(time_s, numbers)
            self._null += -0.5 * float(np.sum(((numbers - _GUARD)[:4] / self._sigma[:4]) ** 2))
        if self._is_over(shown_s, chi2):
            self._to_guard()
            return None
        return self._estimate()

    def stepped_m(self, estimate: StrikeEstimate, in_s: float = 0.0) -> float:
        """Return how far the opponent's body has stepped forward [m] by the likeliest hypothesis.

        Args:
            estimate: the last one.
            in_s: this long after now [s].
        """
        strikes = np.flatnonzero(~estimate.is_feint)
        if not len(strikes):
            return 0.0
        return self._grid.stepped_m(int(estimate.row[strikes[0]]), self._clock_s + in_s - self._alarm_s)

    def _likelihood(self, time_s: float, features: FloatArray) -> FloatArray:
        predicted, known = self._grid.features(time_s - self._alarm_s)
        sigma = self._sigma[:, None]
        off = np.minimum(np.abs(features[:, None] - predicted) / sigma, _OUTLIER)
        total: FloatArray = -0.5 * np.sum(np.where(known, off * off, 1.0), axis=0)
        return total

    def _is_over(self, shown_s: float, chi2: float) -> bool:
        assert self._log is not None
        best = int(np.argmax(self._log))
        age = shown_s - self._alarm_s
        back = age >= self._grid.free[best]
        never = chi2 < _ALARM and self._null > self._log[best] + 5.0
        if back and chi2 < _ALARM:
            self._feinted = bool(self._grid.is_feint[best])
        return never or (back and chi2 < _ALARM)

    def _estimate(self) -> StrikeEstimate:
        assert self._log is not None
        weight = np.exp(self._log - np.max(self._log))
        order = np.argsort(-weight)
        weight = weight[order]
        cumulative = np.cumsum(weight)
        order = order[: 1 + int(np.searchsorted(cumulative, 0.999 * cumulative[-1]))]
        weight = weight[: len(order)]
        now = self._clock_s - self._alarm_s
        grid = self._grid
        return StrikeEstimate(
            weight / weight.sum(),
            grid.technique[order],
            grid.is_feint[order],
            grid.cut[order] - now,
            grid.land[order] - now,
            order,
        )


_GUARD = np.array([GUARD_TIP_M, GUARD_HEIGHT_M, 0.0, 0.0, 0.0])


def _features(seen: Observed) -> FloatArray:
    """Return the tip's distance ahead and height [m], their rates, and the body's speed [m/s], (5,)."""
    along = np.array([float(seen.tip_x - seen.opponent_x), float(seen.tip_y - seen.opponent_y)])
    ahead = max(float(np.hypot(*along)), 1e-6)
    along = along / ahead
    body = np.array([float(seen.opponent_vx), float(seen.opponent_vy)])
    tip = np.array([float(seen.tip_vx), float(seen.tip_vy)])
    return np.array(
        [ahead, float(seen.tip_height), along @ (tip - body), float(seen.tip_rising), float(along @ body)]
    )


class _Grid:
    """The hypotheses; times are seconds after the alarm, all arrays (m,)."""

    def __init__(self, opponent: Opponent, priors: StrikePriors) -> None:
        warnings = np.arange(priors.warning_s[0], priors.warning_s[1] + 1e-9, _LENGTH_GRID_S)
        feints = np.arange(priors.feint_s[0], priors.feint_s[1] + 1e-9, _LENGTH_GRID_S)
        starts = np.arange(-_LOOK_BACK_S, 1e-9, _START_GRID_S)
        kinds = [(w, False) for w in warnings] + [(f, True) for f in feints]
        techniques = opponent.techniques
        technique, kind, start = np.meshgrid(
            np.arange(len(techniques)), np.arange(len(kinds)), starts, indexing="ij"
        )
        self.technique: npt.NDArray[np.intp] = technique.ravel().astype(np.intp)
        self.is_feint = np.array([feint for _, feint in kinds])[kind.ravel()]
        self.start = start.ravel()
        length = np.array([seconds for seconds, _ in kinds])[kind.ravel()]
        swing = np.array([t.swing_s for t in techniques])[self.technique]
        self.land = self.start + length
        self.cut = np.where(self.is_feint, self.land, self.land - swing)
        self.free = self.land + np.where(self.is_feint, opponent.lower_s, opponent.recovery_s)
        self._drawn = np.array(
            [
                [t.raised_tip_m - GUARD_TIP_M for t in techniques],
                [t.raised_height_m - GUARD_HEIGHT_M for t in techniques],
            ]
        )[:, self.technique]
        self._end_height = np.array([t.target_height_m for t in techniques])[self.technique]
        self._step_m = opponent.step_m
        self._share = np.where(
            self.is_feint, 1.0 / (len(feints) * len(starts)), 1.0 / (len(warnings) * len(starts))
        ) / len(techniques)

    def log_prior(self, feint_probability: float) -> FloatArray:
        """Return the log of each hypothesis' probability before anything is seen."""
        kind = np.where(self.is_feint, feint_probability, 1.0 - feint_probability)
        log: FloatArray = np.log(kind * self._share)
        return log

    def features(self, time_s: float) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return what each hypothesis says of the five features, (5, m), and where it says something."""
        ahead, height = self._tip(time_s)
        before, lower = self._tip(time_s - _RATE_S)
        body = np.where(
            self.is_feint,
            0.0,
            self._step_m
            / _STEP_MEAN_S
            * (self._stepped(time_s + 0.25 * _STEP_MEAN_S) - self._stepped(time_s - 0.75 * _STEP_MEAN_S)),
        )
        predicted = np.array([ahead, height, (ahead - before) / _RATE_S, (height - lower) / _RATE_S, body])
        known = np.ones(predicted.shape, bool)
        # Once it goes forward, how far depends on where it is aimed, which is not seen.
        known[[0, 2]] = self.is_feint | (time_s <= self.cut)
        return predicted, known

    def stepped_m(self, row: int, time_s: float) -> float:
        """Return how far the body is forward [m] by one hypothesis."""
        return self._step_m * float(self._stepped(time_s)[row])

    def _tip(self, time_s: float) -> tuple[FloatArray, FloatArray]:
        rise = _smooth((time_s - self.start) / (self.cut - self.start))
        back = _smooth((time_s - self.land) / (self.free - self.land))
        forward = np.clip((time_s - self.cut) / np.maximum(self.land - self.cut, 1e-9), 0.0, 1.0) ** 2
        forward = np.where(self.is_feint, 0.0, forward)
        ahead = GUARD_TIP_M + rise * (1.0 - back) * self._drawn[0]
        height = GUARD_HEIGHT_M + rise * self._drawn[1]
        height = height + forward * (self._end_height - height)
        return ahead, height + back * (GUARD_HEIGHT_M - height)

    def _stepped(self, time_s: float) -> FloatArray:
        forward = _smooth((time_s - self.start) / (self.land - self.start))
        return forward - _smooth((time_s - self.land) / (self.free - self.land))


def _smooth(share: FloatArray) -> FloatArray:
    share = np.clip(share, 0.0, 1.0)
    smooth: FloatArray = share * share * (3.0 - 2.0 * share)
    return smooth
