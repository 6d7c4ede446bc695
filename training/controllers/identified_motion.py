"""The delay and the speed of a robot, found during the first seconds from its commands and its velocity.

A robot whose commands act d later moves as the model does, d later. One that slips or is held back moves a
share g of the way. So for each delay on a grid the measured velocity y is compared with what the model
predicted for that much earlier, u(d), by least squares with a normal prior of g around 1:

    g(d) = (sum u.y + p) / (sum u.u + p),   cost(d) = sum |y - g u|^2 + p (g - 1)^2,   p = (sigma / spread)^2

and the delay and share used are their means under exp(-cost / (2 sigma^2)) times the delay's prior. A robot
at rest tells nothing: then they stay as they were told.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from mecanum_env.effects.apply import drive_parameters
from mecanum_env.model import Model
from mecanum_env.tankendo import Observed, Sensors
from mecanum_env.units import FloatArray
from training.controllers.observed_motion import ObservationPredictor

_DELAYS_S: Final = np.arange(0.0, 0.2501, 0.01)
"""Delays that are compared [s]."""
_SIGMA_M_S: Final = 0.06
"""Standard deviation of a measured velocity around the prediction [m/s]: sensors and what the model lacks."""
_SHARE_SPREAD: Final = 0.15
"""Standard deviation of the share of the predicted speed that robots reach."""
_DELAY_SPREAD_S: Final = 0.06
"""Standard deviation of the delay around the one that was told [s]."""


class IdentifiedPredictor(ObservationPredictor):
    """An `ObservationPredictor` that identifies the delay and the speed of its robot as it drives.

    The model tells what to expect; the answer acts after the delay found so far, `command_s`. With `is_exact`
    the model is that of the robot itself, and nothing is left to find.
    """

    def __init__(self, model: Model, *, is_exact: bool = False) -> None:
        self._is_exact = is_exact
        self._told_s = drive_parameters(model).delay_s
        super().__init__(model)

    def reset(self) -> None:
        """Forget the episode and what was found in it."""
        super().reset()
        self._predicted, self._both = np.zeros(len(_DELAYS_S)), np.zeros(len(_DELAYS_S))
        self._measured = 0.0
        self._use(self._told_s, 1.0)

    def predict(self, seen: Observed) -> Observed:
        """Return the observation as it would be when the answer acts, as `ObservationPredictor` does."""
        if not self._is_exact:
            self._learn(np.array([float(seen.vx), float(seen.vy)]))
        return super().predict(seen)

    def _learn(self, measured: FloatArray) -> None:
        """Take in a measured velocity ahead and left [m/s], shape (2,)."""
        predicted = self.own.twists(Sensors.delay_s + _DELAYS_S)[:, :2]
        self._predicted += np.sum(predicted * predicted, axis=1)
        self._both += predicted @ measured
        self._measured += float(measured @ measured)
        prior = (_SIGMA_M_S / _SHARE_SPREAD) ** 2
        share = (self._both + prior) / (self._predicted + prior)
        cost = self._measured - 2.0 * share * self._both + share * share * self._predicted
        cost += prior * (share - 1.0) ** 2
        log_weight = -0.5 * cost / _SIGMA_M_S**2 - 0.5 * ((_DELAYS_S - self._told_s) / _DELAY_SPREAD_S) ** 2
        weight = np.exp(log_weight - np.max(log_weight))
        weight /= np.sum(weight)
        self._use(float(weight @ _DELAYS_S), float(weight @ share))

    def _use(self, delay_s: float, share: float) -> None:
        self.command_s, self.horizon_s = delay_s, Sensors.delay_s + delay_s
        self.share = np.array([share, share, 1.0])
