"""The speed at which a run starts, according to its first samples."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray

_CLEAR: Final = 4.0  # standard deviations above which a speed, or a change of one, is taken for real


def speed_at_start(first: FloatArray, sigma: float, rest: float = 0.0) -> float:
    """Return the speed before the first command, 0 at rest; it has the unit of the samples.

    Many logs begin with a step at the first row, so that a fast wheel at rest moves within a few samples.
    Therefore the very first of the `first` samples, (n,) in order, must show the motion, too. It also gives
    the speed while that still changes; else their mean does. `sigma` is the standard deviation of the noise
    of a sample, and a speed up to `rest` may be its bias.
    """
    if first.size == 0:
        return 0.0
    mean, error = float(np.mean(first)), sigma / math.sqrt(first.size)
    if abs(mean) <= max(rest, _CLEAR * error) or abs(first[0]) <= max(rest, _CLEAR * sigma):
        return 0.0
    changes = abs(first[-1] - first[0]) > max(rest, _CLEAR * math.sqrt(2.0) * sigma)
    return float(first[0]) if changes else mean
