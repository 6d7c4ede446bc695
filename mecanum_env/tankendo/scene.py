"""Where robot and opponent are, now and a short while ago.

A scene has 11 numbers, in the field's frame: the robot's x, y [m], yaw [rad, unwrapped], vx, vy [m/s] and yaw
rate [rad/s]; the opponent's x, y [m], heading [rad, unwrapped], vx and vy [m/s].
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
RowArray = npt.NDArray[np.intp]
"""Indices of some episodes, shape (m,)."""


class Scenes:
    """The scenes of n episodes, one every `step_s`, up to the age `oldest_s` [s]; interpolated linearly."""

    def __init__(self, n: int, step_s: float, oldest_s: float) -> None:
        self._step_s = step_s
        self._separation: tuple[FloatArray, FloatArray] | None = None
        self._past = np.zeros((int(np.ceil(oldest_s / step_s)) + 3, 11, n))

    @property
    def now(self) -> FloatArray:
        """The newest scene, shape (11, n), as a view."""
        return np.asarray(self._past[0])

    def restart(self, rows: RowArray, scenes: FloatArray) -> None:
        """Begin episodes in some rows (m,); the players have always been at rest in `scenes`, (11, m)."""
        self._past[:, :, rows] = scenes
        self._separation = None

    def push(self) -> FloatArray:
        """Shift all scenes by one step; return the newest, a copy of the last that is to be overwritten."""
        self._past[1:] = self._past[:-1].copy()
        self._separation = None
        return self.now

    def separation(self) -> tuple[FloatArray, FloatArray]:
        """Return distance [m] and bearing [rad] of the opponent from the robot now, shape (n,) each."""
        if self._separation is None:
            self._separation = separation(self.now)
        return self._separation

    def ago(self, delay_s: float) -> FloatArray:
        """Return the scene `delay_s` before now, in all episodes, shape (11, n)."""
        whole, share = divmod(delay_s / self._step_s, 1.0)
        newer, older = self._past[int(whole)], self._past[int(whole) + 1]
        return np.asarray(newer + share * (older - newer))

    def ago_of(self, rows: RowArray, delays_s: FloatArray) -> FloatArray:
        """Return scenes of some rows (m,), each with its own delay before now (m,) [s], shape (11, m).

        Delays are limited to what is kept.
        """
        age = np.clip(delays_s / self._step_s, 0.0, len(self._past) - 2.0)
        whole = np.floor(age).astype(np.intp)
        newer, older = self._past[whole, :, rows].T, self._past[whole + 1, :, rows].T
        return newer + (age - whole) * (older - newer)


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Return angles within [-pi, pi)."""
    return np.asarray((angle_rad + np.pi) % (2.0 * np.pi) - np.pi)


def separation(scene: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distance [m] and bearing [rad] of the opponent from the robot, (n,), in a scene (11, n).

    The bearing is 0 straight ahead and positive to the left.
    """
    dx, dy = scene[6] - scene[0], scene[7] - scene[1]
    return np.sqrt(dx * dx + dy * dy), wrapped(np.arctan2(dy, dx) - scene[2])
