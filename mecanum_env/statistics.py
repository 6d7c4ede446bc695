"""Statistics that several programs report: root mean square, and the interval of a share."""

from __future__ import annotations

import math

import numpy as np

from mecanum_env.units import FloatArray


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
