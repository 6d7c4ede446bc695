"""Units: commands and logs are in rpm of the wheel, MuJoCo works in rad/s."""

import math
from typing import Final

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

RAD_S_PER_RPM: Final = 2.0 * math.pi / 60.0
"""One revolution per minute in rad/s."""

_STAMPS: Final = ((1e6, "nanoseconds", 1e-9), (500.0, "microseconds", 1e-6), (0.0, "milliseconds", 1e-3))
"""Usual intervals of a log of 2 Hz to 1 kHz in finer units than seconds: the least, the unit, its seconds."""


def unit_of_stamps(interval: float) -> tuple[str, float]:
    """Return the unit that the stamps of a drive's log have, and its seconds, by the usual interval in it."""
    return next((unit, scale) for least, unit, scale in _STAMPS if interval >= least)
