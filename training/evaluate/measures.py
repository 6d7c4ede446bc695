"""What is measured of one episode's motion: pure functions of arrays over its samples."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]


def settling_time(time_s: FloatArray, inside: BoolArray) -> float | None:
    """Return when a response was within its band for good [s]; None if it was outside at the end.

    Args:
        time_s: of the samples, (n,) [s].
        inside: whether it was within the band, (n,).
    """
    if not inside[-1]:
        return None
    outside = np.flatnonzero(~inside)
    return float(time_s[0] if outside.size == 0 else time_s[outside[-1] + 1])


def overshoot(values: FloatArray, target: float) -> float | None:
    """Return how far a response went beyond its target, over the whole change; None for no change.

    Args:
        values: (n,), the first one is where it starts.
        target: where it should end.
    """
    change = target - float(values[0])
    if change == 0.0:
        return None
    beyond = np.max((values - target) / change)
    return max(float(beyond), 0.0)


def rms(values: FloatArray) -> float | None:
    """Return the root mean square of values, of any shape; None for none."""
    return float(np.sqrt(np.mean(values**2))) if values.size else None


def saturated(asked_rpm: FloatArray, ceiling_rpm: float, quantum_rpm: float) -> BoolArray:
    """Return which commands ask some wheel for its ceiling or more, (n,).

    Args:
        asked_rpm: of each wheel, (n, 4).
        ceiling_rpm: beyond it a command is cut.
        quantum_rpm: commands are rounded to it: that near counts as at the ceiling.
    """
    at_ceiling: BoolArray = np.max(np.abs(asked_rpm), axis=-1) >= ceiling_rpm - quantum_rpm
    return at_ceiling
