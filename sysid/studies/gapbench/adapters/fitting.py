"""Fitting effects to logs by least squares, for methods that search the parameters of a simulator."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.predicted import predict_all, without_engine_warnings
from sysid.logs import Run
from sysid.studies.gapbench.case_folder import CHANNEL

_FAILED_RPM = 1e3
"""Error that a model has which cannot be simulated."""

_MOST_ALIKE = 0.9
"""Correlation of neighbouring errors, at most: steady errors of a model are not counted as one sample."""

ModelOf = Callable[[FloatArray], Model]
"""Parameters, shape (p,) -> simulator with them."""


@dataclass(frozen=True)
class Fitted:
    """Parameters that fit some logs best."""

    values: FloatArray
    """Shape (p,)."""
    deviations: FloatArray
    """Their standard deviations, shape (p,), if samples as far apart as errors remember were independent."""
    variance: float
    """Mean squared error [rpm2]."""

    def bic(self, samples: float) -> float:
        """Return the Bayesian information criterion for a number of independent `samples`."""
        return samples * math.log(self.variance) + self.values.size * math.log(samples)


@dataclass(frozen=True, eq=False)
class Logs:
    """Runs that are simulated together, one of each group of repeats."""

    runs: Sequence[Run]

    @cached_property
    def chosen(self) -> tuple[Run, ...]:
        """The first run of each group."""
        return tuple({run.group: run for run in reversed(self.runs)}.values())

    def errors(self, model: Model) -> FloatArray:
        """Return measured minus simulated speed [rpm] of all chosen runs, shape (n,), missing samples out."""
        runs = self.chosen
        try:
            with without_engine_warnings():
                predicted = predict_all(model, runs)
            parts = [
                run.channels[CHANNEL] - channels[CHANNEL]
                for run, channels in zip(runs, predicted, strict=True)
            ]
        except MecanumError:
            parts = [np.full(run.time_s.size, _FAILED_RPM) for run in runs]
        together = np.concatenate(parts)
        known = np.concatenate([np.isfinite(run.channels[CHANNEL]) for run in runs])
        picked: FloatArray = together[known]
        return picked

    def fit(
        self, model_of: ModelOf, start: Sequence[float], low: Sequence[float], high: Sequence[float]
    ) -> Fitted:
        """Return the parameters between `low` and `high` with the least squares, searched from a start.

        `model_of` is smooth enough for finite differences of a hundredth of the range.
        """
        if not len(start):
            residuals = self.errors(model_of(np.empty(0)))
            return Fitted(np.empty(0), np.empty(0), float(np.mean(residuals**2)))
        lows, highs = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        span = highs - lows

        def of_share(share: FloatArray) -> FloatArray:
            return self.errors(model_of(lows + share * span))

        began = np.clip((np.asarray(start, dtype=float) - lows) / span, 0.01, 0.99)
        done = least_squares(of_share, began, bounds=(0.0, 1.0), diff_step=0.01, max_nfev=12)
        variance = float(np.mean(done.fun**2))
        inverse = np.linalg.pinv(done.jac.T @ done.jac * independent(done.fun) / done.fun.size)
        spread = np.sqrt(np.maximum(np.diag(inverse), 0.0) * variance) * span
        return Fitted(lows + done.x * span, spread, variance)


def independent(errors: FloatArray) -> float:
    """Return how many independent samples a series of errors, shape (n,), is worth, at least 10."""
    size = errors.size
    if size < 10 or not np.any(errors):
        return 10.0
    centred = errors - errors.mean()
    rho = float(np.clip(centred[1:] @ centred[:-1] / (centred @ centred), 0.0, _MOST_ALIKE))
    return max(size * (1.0 - rho) / (1.0 + rho), 10.0)
