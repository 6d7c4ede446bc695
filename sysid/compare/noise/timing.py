"""Noise of repeats whose changes of command act a little earlier or later each time.

A drive looks for a command at the times of its own clock, and a link takes its time. With a delay d of its
own for each change of command, normal with standard deviation s, the response after the change differs by
-d y', where y' is the slope of the measured speed. The covariance of two samples of the same hold is then

    delta(i, j) sigma^2 + s^2 y'(i) y'(j),

with sigma and s found by maximum likelihood from the repeats. Unlike noise that is only larger after a change
(`sysid.compare.noise.uneven`), all samples of one response move together: a few that do are no evidence of an
effect that comes late, however many samples a response has.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.optimize import minimize

from mecanum_env.units import FloatArray

_SURE: Final = 20.0
"""Fall of twice the negative log likelihood from which delays are said to differ, as that of uneven noise."""
_START_S: Final = 0.005
"""Standard deviation of the delays from which the search begins [s]."""
_LEAST_SHARE: Final = 0.05
"""Least standard deviation of a settled sample, relative to that over all samples. Assumed."""


@dataclass(frozen=True)
class TimingNoise:
    """How much of a channel's noise is that changes of command act at other times in each repeat."""

    settled: float
    """Standard deviation where the speed does not change, relative to that over all samples."""
    delay_s: float
    """Standard deviation of the delay of a change of command [s]."""


@dataclass(frozen=True, eq=False)
class Response:
    """What one repeat differs by from the others while one command is held."""

    deviation: FloatArray
    """Shape (m,), with the variance of a single sample."""
    slope: FloatArray
    """Change of the deviation by a delay of 1 s, (m,)."""
    share: float
    """Share of the repeat in the degrees of freedom: (n - 1) / n of n repeats."""


def slope_of(value: FloatArray, time_s: FloatArray) -> FloatArray:
    """Return the slope of measured values (m,) at their times, per second, shape (m,)."""
    return np.asarray(np.gradient(value, time_s)) if value.size > 1 else np.zeros(value.size)


def find_timing(responses: Sequence[Response], sigma: float) -> TimingNoise | None:
    """Return how much of the noise is timing; None if repeats do not show it.

    Args:
        responses: what repeats differ by, for each hold of each repeat.
        sigma: standard deviation of a sample over all of them.
    """
    sizes = np.array([response.deviation.size for response in responses], float)
    shares = np.array([response.share for response in responses])
    lengths = np.array([float(r.slope @ r.slope) for r in responses])
    along = np.array([float(r.slope @ r.deviation) for r in responses]) ** 2 / np.maximum(lengths, 1e-300)
    squares = np.array([float(r.deviation @ r.deviation) for r in responses])
    lowest = max(_LEAST_SHARE * sigma, 1e-9)

    def deviance(settled: float, delay_s: float) -> float:
        """Return minus twice the log likelihood, up to a constant."""
        white = max(settled, lowest) ** 2
        moved = white + delay_s**2 * lengths
        logs = (sizes - 1.0) * math.log(white) + np.log(moved)
        return float(shares @ (logs + (squares - along) / white + along / moved))

    found = minimize(
        lambda place: deviance(*np.exp(place)),
        np.log([0.5 * sigma, _START_S]),
        method="Nelder-Mead",
        options={"xatol": 1e-3, "fatol": 1e-3},
    )
    settled, delay_s = (float(value) for value in np.exp(found.x))
    if float(found.fun) > deviance(sigma, 0.0) - _SURE:
        return None
    return TimingNoise(max(settled, lowest) / sigma, delay_s)


def is_settled(slope: FloatArray, timing: TimingNoise, sigma: float) -> npt.NDArray[np.bool_]:
    """Return at which samples delays change less than the settled noise, for slopes (m,) and `sigma`."""
    return np.asarray(timing.delay_s * np.abs(slope) < timing.settled * sigma)
