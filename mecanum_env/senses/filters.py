"""Kalman filters of many coordinates: each a position and its velocity, driven by white acceleration.

With the time h since the last reading and the standard deviation a of the acceleration (constant over a
second, in m/s^2 per root hertz),

    x' = x + h v,   v' = v,   Q = a^2 [[h^3 / 3, h^2 / 2], [h^2 / 2, h]]

(Y. Bar-Shalom, X. R. Li and T. Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001,
section 6.2). Readings that the quiet model cannot explain switch to the agile one for a short while, which
follows a strike at once and is calm on guard.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
_GATE = 9.0
"""Mean squared normalised innovation of a reading above which the target manoeuvres; one in a thousand of
quiet readings exceeds it."""
_AGILE_S = 0.2
"""How long the agile model is kept after such a reading [s]."""


class MotionFilter:
    """Positions and velocities of `size` coordinates of n targets.

    `quiet` and `agile` are the standard deviations of the acceleration in the two models.
    """

    def __init__(self, size: int, n: int, quiet: float, agile: float) -> None:
        self._quiet, self._agile = quiet, agile
        self.time_s = np.zeros(n)
        """Time of the state, shape (n,) [s]."""
        self.position, self.velocity = np.zeros((2, size, n))
        self._xx, self._xv, self._vv = np.zeros((3, size, n))
        self._agile_until_s = np.full(n, -np.inf)

    def restart(self, row: int, position: FloatArray, spread: float, speed: float) -> None:
        """Begin anew in a row at rest at a position (size,); `spread` and `speed` are standard deviations."""
        self.time_s[row], self._agile_until_s[row] = 0.0, -np.inf
        self.position[:, row], self.velocity[:, row] = position, 0.0
        self._xx[:, row], self._xv[:, row], self._vv[:, row] = spread**2, 0.0, speed**2

    def at(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions and velocities at times (n,), shape (size, n) each; the state stays as it is."""
        return self.position + (time_s - self.time_s) * self.velocity, self.velocity

    def update(
        self,
        time_s: FloatArray,
        position: FloatArray,
        noise: float,
        rows: BoolArray,
        velocity: FloatArray | None = None,
        velocity_noise: float = 1.0,
    ) -> None:
        """Take in readings at times (n,) of the targets in `rows`, (n,) of bool; NaN: no reading.

        `position` and, where the sensor measures it, `velocity` have the shape (size, n); the noises are
        their standard deviations.
        """
        step = np.where(rows, np.maximum(time_s - self.time_s, 0.0), 0.0)
        self.position = self.position + step * self.velocity
        xx = self._xx + step * (2.0 * self._xv + step * self._vv)
        xv = self._xv + step * self._vv
        agile = time_s <= self._agile_until_s
        q = np.where(agile, self._agile, self._quiet) ** 2
        innovation = position - self.position
        seen = np.isfinite(innovation) & rows
        variance = xx + q * step**3 / 3.0 + noise**2
        score = np.sum(np.where(seen, innovation**2 / variance, 0.0), axis=0)
        leaves = score > _GATE * np.maximum(seen.sum(axis=0), 1)
        self._agile_until_s = np.where(leaves & rows, time_s + _AGILE_S, self._agile_until_s)
        q = np.where(leaves, self._agile**2, q)
        self._xx, self._xv = xx + q * step**3 / 3.0, xv + q * step**2 / 2.0
        self._vv = self._vv + q * step
        self.time_s = np.where(rows, np.maximum(time_s, self.time_s), self.time_s)
        self._correct(np.where(seen, innovation, 0.0), seen, noise, of_velocity=False)
        if velocity is not None:
            innovation = velocity - self.velocity
            seen = np.isfinite(innovation) & rows
            self._correct(np.where(seen, innovation, 0.0), seen, velocity_noise, of_velocity=True)

    def _correct(self, innovation: FloatArray, seen: BoolArray, noise: float, *, of_velocity: bool) -> None:
        own = self._vv if of_velocity else self._xx
        share = np.where(seen, 1.0 / (own + noise**2), 0.0)
        gain_x = (self._xv if of_velocity else self._xx) * share
        gain_v = (self._vv if of_velocity else self._xv) * share
        self.position = self.position + gain_x * innovation
        self.velocity = self.velocity + gain_v * innovation
        row_x, row_v = (self._xv, self._vv) if of_velocity else (self._xx, self._xv)
        self._xx, self._xv, self._vv = (
            self._xx - gain_x * row_x,
            self._xv - gain_x * row_v,
            self._vv - gain_v * row_v,
        )
