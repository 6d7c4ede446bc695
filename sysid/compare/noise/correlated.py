"""Noise by which repeats differ for longer than a sample."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray

_SIGNIFICANT: Final = 4.0  # standard deviations of an autocorrelation that is zero
_LAGS: Final = 40
"""Number of lags of the repeats' autocovariance."""


@dataclass(frozen=True)
class CorrelatedNoise:
    """The part of a channel's noise by which repeats differ for longer than a sample."""

    share: float
    """Share of the variance."""
    time_s: float
    """Correlation time [s]: the autocovariance has fallen to 1/e."""


def find_correlated(parts: Sequence[FloatArray], interval_s: float) -> CorrelatedNoise | None:
    """Return the correlated part of the noise, None if its autocorrelation is insignificant.

    Args:
        parts: deviations of repeats from their mean, or from one another, each (repeats, samples); 0 where
            there is no sample, or none of settled noise.
        interval_s: time from one sample to the next [s].
    """
    products, samples = np.zeros(_LAGS), 0
    for part in parts:
        samples += int(np.count_nonzero(np.any(part, axis=0))) * len(part)
        for lag in range(min(_LAGS, part.shape[1])):
            products[lag] += float(np.sum(part[:, lag:] * part[:, : part.shape[1] - lag]))
    if products[0] <= 0.0:
        return None
    autocorrelation = products / products[0]
    if autocorrelation[1] < _SIGNIFICANT / math.sqrt(samples):
        return None
    # Lag 0 contains the white part; the ratio of lags 2 and 1 tells how fast the correlated part decays.
    decay = autocorrelation[2] / autocorrelation[1] if autocorrelation[2] > 0.0 else 0.1
    decay = float(np.clip(decay, 0.1, 0.99))
    share = float(np.clip(autocorrelation[1] / decay, 0.0, 1.0))
    below = np.flatnonzero(autocorrelation[1:] < share / math.e)
    lag = 1 + int(below[0]) if below.size else autocorrelation.size
    return CorrelatedNoise(share, lag * interval_s)
