"""Where the opponent's tip is at a time: on guard, drawn back, forward in a strike, back on guard."""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.units import FloatArray

GUARD_HEIGHT_M: Final = 0.58
"""Height of the tip on guard [m]; ours."""
_RATE_S = 0.01  # the tip's velocity is its mean over this time
_EARLIER_S = np.array([[0.0], [_RATE_S]])
_LONG_AGO = -1e6


class Sword:
    """The motion of n swords: times [s] and places [m], each of shape (n,) or (2, n).

    A sword rises from `raise_s` to `cut_s`, goes forward until `land_s`, and is back on guard at `free_s`. In
    a feint it only rises and sinks: `cut_s` equals `land_s`.
    """

    def __init__(self, n: int) -> None:
        self.raise_s, self.cut_s, self.land_s, self.free_s = (np.full(n, _LONG_AGO) for _ in range(4))
        self.raised_m, self.raised_height_m, self.end_height_m = (np.ones(n) for _ in range(3))
        self.is_feint = np.ones(n, bool)
        self.origin = np.zeros((2, n))
        """Where the opponent stood when the sword rose."""
        self.end = np.zeros((2, n))
        """Where the tip hits."""

    def clear(self, row: int) -> None:
        """Put the sword of one row on guard, without a past."""
        for times in (self.raise_s, self.cut_s, self.land_s, self.free_s):
            times[row] = _LONG_AGO
        self.is_feint[row] = True

    def idle(self, time_s: FloatArray) -> npt.NDArray[np.bool_]:
        """Return whether each sword is on guard at times (n,), shape (n,) of bool."""
        idle: npt.NDArray[np.bool_] = time_s >= self.free_s
        return idle

    def step_share(self, time_s: FloatArray) -> FloatArray:
        """Return how far, 0 to 1, the body is on its step forward at times (n,)."""
        forward = _smooth(_share(time_s, self.raise_s, self.land_s))
        back = _smooth(_share(time_s, self.land_s, self.free_s))
        return np.where(self.is_feint, 0.0, forward - back)

    def tip(
        self, time_s: FloatArray, x_m: FloatArray, y_m: FloatArray, heading_rad: FloatArray
    ) -> FloatArray:
        """Return the tip's place x, y, z [m] at times (..., n), shape (3, ..., n).

        The opponent's centre is at (x, y), (..., n), then and looks along its heading, (n,).
        """
        tip = np.empty((3, *x_m.shape))
        cos, sin = np.cos(heading_rad), np.sin(heading_rad)
        if np.all((time_s >= self.free_s) | (time_s <= self.raise_s)):
            # All on guard: what the formulae below would give, at a fraction of the time.
            tip[0], tip[1] = x_m + GUARD_TIP_M * cos, y_m + GUARD_TIP_M * sin
            tip[2] = GUARD_HEIGHT_M
            return tip
        rise = _smooth(_share(time_s, self.raise_s, self.cut_s))
        strike = _share(time_s, self.cut_s, self.land_s)
        strike = np.where(self.is_feint, 0.0, strike * strike)
        back = _smooth(_share(time_s, self.land_s, self.free_s))
        ahead = GUARD_TIP_M + rise * (self.raised_m - GUARD_TIP_M)
        for axis, at, direction in ((0, x_m, cos), (1, y_m, sin)):
            guard, drawn = at + GUARD_TIP_M * direction, at + ahead * direction
            forward = drawn + strike * (self.end[axis] - drawn)
            tip[axis] = forward + back * (guard - forward)
        drawn = GUARD_HEIGHT_M + rise * (self.raised_height_m - GUARD_HEIGHT_M)
        forward = drawn + strike * (self.end_height_m - drawn)
        tip[2] = forward + back * (GUARD_HEIGHT_M - forward)
        return tip

    def tip_and_velocity(
        self,
        time_s: FloatArray,
        scene: FloatArray,
    ) -> tuple[FloatArray, FloatArray]:
        """Return the tip's place [m] and velocity [m/s], shapes (3, n), at times (n,) in scenes (11, n)."""
        earlier = _EARLIER_S
        x, y = scene[6] - earlier * scene[9], scene[7] - earlier * scene[10]
        tip = self.tip(time_s - earlier, x, y, scene[8])
        return tip[:, 0], (tip[:, 0] - tip[:, 1]) / _RATE_S


def _share(time_s: FloatArray, start_s: FloatArray, end_s: FloatArray) -> FloatArray:
    """Return how much of the way from start to end has passed, 0 to 1; no time at all passes at once."""
    return np.minimum(np.maximum((time_s - start_s) / np.maximum(end_s - start_s, 1e-9), 0.0), 1.0)


def _smooth(share: FloatArray) -> FloatArray:
    return share * share * (3.0 - 2.0 * share)
