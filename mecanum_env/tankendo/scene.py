"""Where robot and opponent are, now and a short while ago."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
RowArray = npt.NDArray[np.intp]
"""Indices of some episodes, (m,)."""

COLUMNS: Final = (
    "x",
    "y",
    "yaw",
    "vx",
    "vy",
    "yaw_rate",
    "opp_x",
    "opp_y",
    "opp_heading",
    "opp_vx",
    "opp_vy",
)
"""Rows of a scene, in the field's frame: robot pose [m, m, rad unwrapped], its velocity [m/s, m/s, rad/s];
the opponent's place [m], heading [rad unwrapped], and velocity [m/s]."""
ROBOT, OPPONENT = slice(0, 6), slice(6, 11)


class Scenes:
    """The last scenes of n episodes, one a step; linear in between.

    Args:
        n: number of episodes.
        step_s: time between two scenes.
        oldest_s: how far back scenes can be asked for.
    """

    def __init__(self, n: int, step_s: float, oldest_s: float) -> None:
        self._step_s = step_s
        self._separation: tuple[FloatArray, FloatArray] | None = None
        self._past = np.zeros((int(np.ceil(oldest_s / step_s)) + 3, len(COLUMNS), n))

    @property
    def now(self) -> FloatArray:
        """The newest scene, shape (11, n), rows as `COLUMNS`; a view."""
        now: FloatArray = self._past[0]
        return now

    def restart(self, row: int, scene: Sequence[float]) -> None:
        """Let an episode begin, having been at rest before.

        Args:
            row: which episode.
            scene: its 11 numbers.
        """
        self._past[:, :, row] = scene
        self._separation = None

    def push(self) -> FloatArray:
        """Move every scene one step into the past; return the newest, a copy of the last, to be written."""
        self._past[1:] = self._past[:-1].copy()
        self._separation = None
        return self.now

    def separation(self) -> tuple[FloatArray, FloatArray]:
        """Return distance [m] and bearing [rad] of the opponent from the robot now, shapes (n,)."""
        if self._separation is None:
            self._separation = separation(self.now)
        return self._separation

    def ago(self, delay_s: float) -> FloatArray:
        """Return the scene of `delay_s` before now, the same for all episodes, shape (11, n)."""
        whole, share = divmod(delay_s / self._step_s, 1.0)
        newer, older = self._past[int(whole)], self._past[int(whole) + 1]
        scene: FloatArray = newer + share * (older - newer)
        return scene

    def ago_of(self, rows: RowArray, delays_s: FloatArray) -> FloatArray:
        """Return scenes of some episodes, each as long ago as it likes, shape (11, m).

        Args:
            rows: indices (m,) of the episodes.
            delays_s: how long before now, (m,); beyond what is kept: the oldest.
        """
        age = np.clip(delays_s / self._step_s, 0.0, len(self._past) - 2.0)
        whole = np.floor(age).astype(np.intp)
        newer, older = self._past[whole, :, rows].T, self._past[whole + 1, :, rows].T
        return newer + (age - whole) * (older - newer)


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Return angles within [-pi, pi)."""
    within: FloatArray = (angle_rad + np.pi) % (2.0 * np.pi) - np.pi
    return within


def separation(scene: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distance [m] and bearing [rad] of the opponent from the robot, shapes (n,).

    Args:
        scene: (11, n); the bearing is 0 straight ahead, positive to the left.
    """
    dx, dy = scene[6] - scene[0], scene[7] - scene[1]
    return np.sqrt(dx * dx + dy * dy), wrapped(np.arctan2(dy, dx) - scene[2])
