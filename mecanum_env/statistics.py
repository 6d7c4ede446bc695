"""Statistics that several programs need: root mean square, the interval of a share, two constants."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray

VERY_STRONG: Final = 10.0
"""Difference of BIC that is "very strong" evidence (Kass and Raftery, J. Am. Stat. Assoc. 90:773, 1995).

That is twice the logarithm of the ratio of the likelihoods, less the price of the parameters.
"""
MEDIAN_OF_NORMAL: Final = 0.6745
"""Median of the sizes of normal values, in their standard deviations."""


def rms(values: FloatArray) -> float:
    """Return the root mean square of the finite values of an array of any shape; NaN if there are none."""
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else math.nan


def wilson_interval(successes: int, trials: int, confidence: float = 0.95) -> tuple[float, float]:
    """Return the ends of Wilson's interval of the share of successes in trials; (NaN, NaN) for no trials.

    E. B. Wilson, "Probable inference, the law of succession, and statistical inference", J. Am. Stat. Assoc.
    22:209, 1927. Unlike the share plus or minus two standard errors it holds near 0 and 1.

    `confidence` is the probability that such an interval contains the true share.
    """
    if trials == 0:
        return math.nan, math.nan
    # Imported here, since it takes half a second and most programs never need it.
    from scipy.stats import binomtest

    interval = binomtest(successes, trials).proportion_ci(confidence, method="wilson")
    # Rounding must not put an end on the wrong side of the share.
    share = successes / trials
    return min(float(interval.low), share), max(float(interval.high), share)
