"""Weights of samples whose noise grows with the speed, beside what the law itself cannot explain.

Least squares weights a sample by the variance of its error, which is that of the noise and of the model
together. A wheel at rest is often recorded without any noise at all. Where no law comes near the noise of the
moving wheel, weights by the noise alone would fit little else than the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from sysid.fit.drive_choice import Search, pooled, runs_by_split
from sysid.fit.metrics import residual
from sysid.logs import Dataset
from sysid.logs.tails import Tails, weighted_down

_BESIDE: Final = 3.0
"""Typical error of the law, in the typical noise, above which it counts in the weights. Assumed."""
_TO_SIGMA: Final = 1.4826
"""Standard deviation of normal values over the median of their sizes."""
_CHANNEL: Final = "speed_rpm"


def weighted_beside_error(
    plain: Dataset, weighted: Dataset, tails: Mapping[str, Tails], search: Search
) -> Dataset:
    """Return bench logs weighted by their noise and by the error of a law that is fitted without weights.

    The `weighted` ones, by the noise alone, are returned as they are if their noise does not grow with the
    speed, or if the law's typical error is of its order. `plain` are the logs without weights, and `tails` is
    what their noise is like.
    """
    noise = tails.get(_CHANNEL)
    if noise is None or noise.growth == 0.0:
        return weighted
    runs = pooled(runs_by_split(plain, search.path, {_CHANNEL: 1.0})["fit"])
    # The gain is free: a drive that loses speed has no error for that.
    found = search.run(runs, unit_gain=False)
    off = np.concatenate([residual(run, found) for run in runs])
    speeds = np.concatenate([np.abs(run.speed_rpm) for run in runs])
    error = _TO_SIGMA * float(np.median(np.abs(off)))
    typical = float(np.median(noise.at(speeds)))
    if error <= _BESIDE * typical:
        return weighted
    return weighted_down(plain, math.sqrt(error**2 - typical**2))[0]
