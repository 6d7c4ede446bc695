"""Residuals of single runs, at their own times: their mean at others, and its weight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray


@dataclass(frozen=True, eq=False)
class Series:
    """The residual of one channel of a run, on the clock of another run; arrays of shape (n,)."""

    time_s: FloatArray
    residual: FloatArray
    weight: FloatArray

    def nearest(self, at: FloatArray) -> npt.NDArray[np.intp]:
        """Return the numbers of the samples that are nearest to some times `at`, (m,)."""
        middle = 0.5 * (self.time_s[1:] + self.time_s[:-1])
        return np.searchsorted(middle, at)


def mean_of(series: Sequence[Series], at: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the mean of some `series` at some times (m,), between samples, and its weight, each (m,)."""
    weights = [np.interp(at, s.time_s, s.weight) / _kept_variance(at, s.time_s) for s in series]
    values = [np.interp(at, s.time_s, s.residual) for s in series]
    return np.average(values, axis=0, weights=weights), np.sum(weights, axis=0)


def _kept_variance(at: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the variance of white noise of unit variance between samples: interpolation takes off some."""
    if time_s.size < 2:
        return np.ones(at.size)
    after = np.clip(np.searchsorted(time_s, at), 1, time_s.size - 1)
    share = np.clip((at - time_s[after - 1]) / (time_s[after] - time_s[after - 1]), 0.0, 1.0)
    return np.asarray(share**2 + (1.0 - share) ** 2)
