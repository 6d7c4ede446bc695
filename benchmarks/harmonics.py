"""How much a measured speed swings with the wheel's angle, for each whole number of periods per turn."""

from __future__ import annotations

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import uniform_filter1d

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.least_squares.phases import FREQUENCIES
from sysid.logs import Dataset

_SLOW_S = 1.0
"""Time over which a moving mean takes off what is slower than a ripple [s]."""
_LEAST_RPM = 10.0
"""Speed [rpm] below which a wheel does not turn through enough angle to tell one ripple from another."""
_LARGEST_RPM = 4.0
"""Largest distance from the moving mean [rpm]: beyond it the command has just changed."""


def harmonics_rpm(dataset: Dataset, channel: str = "speed_rpm") -> FloatArray:
    """Return the amplitude [rpm] of 1, 2, 3 ... periods per turn in the measured speeds of all runs, (24,).

    The angle is the integral of the measured speed, and the phase of each run its own. No model is used.
    """
    power, samples = np.zeros(len(FREQUENCIES)), 0
    for run in dataset.runs:
        time_s, speed = run.time_s, np.asarray(run.channels[channel])
        angle = cumulative_trapezoid(speed, time_s, initial=0.0) * RAD_S_PER_RPM
        slow = uniform_filter1d(speed, max(1, round(_SLOW_S / run.median_interval_s)))
        fast = speed - slow
        used = (np.abs(slow) > _LEAST_RPM) & (np.abs(fast) < _LARGEST_RPM)
        waves = np.exp(1j * np.outer(FREQUENCIES, angle[used]))
        power += np.abs(waves @ fast[used]) ** 2
        samples += int(np.sum(used))
    return np.asarray(2.0 * np.sqrt(power * len(dataset.runs)) / samples)
