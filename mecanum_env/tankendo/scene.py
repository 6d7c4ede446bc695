"""Where robot and opponent are, now and a short while ago.

A scene has 11 numbers, in the field's frame: the robot's x, y [m], yaw [rad, unwrapped], vx, vy [m/s] and yaw
rate [rad/s]; the opponent's x, y [m], heading [rad, unwrapped], vx and vy [m/s].
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.numbers import Mathematics, Number, mathematics, wrapped
from mecanum_env.units import FloatArray

BoolArray = npt.NDArray[np.bool_]
RowArray = npt.NDArray[np.intp]
"""Indices of some episodes, shape (m,)."""


class Scenes:
    """The scenes of n episodes, one every `step_s`, up to the age `oldest_s` [s]; interpolated linearly."""

    def __init__(self, n: int, step_s: float, oldest_s: float) -> None:
        self._step_s, self._math = step_s, mathematics(n)
        self._apart: tuple[Number, Number] | None = None
        self._newest: Sequence[Number] | None = None
        self._past = np.zeros((int(np.ceil(oldest_s / step_s)) + 3, 11, n))
        # Where the numbers of the first row lie in memory: numpy fills an index of one axis fastest.
        self._first = (np.arange(self._past[..., 0].size) * n).reshape(-1, 11, 1)
        # Where the newest is; older ones follow, around the end. To shift them all would take longer.
        self._at = 0

    @property
    def now(self) -> FloatArray:
        """The newest scene, shape (11, n), as a view."""
        return np.asarray(self._past[self._at])

    def newest(self) -> Sequence[Number]:
        """Return the numbers of the newest scene, which many ask for in every step."""
        if self._newest is None:
            self._newest = self._math.of(self.now)
        return self._newest

    def restart(self, rows: RowArray, scenes: FloatArray) -> None:
        """Begin episodes in some rows (m,); the players have always been at rest in `scenes`, (11, m)."""
        self._past.reshape(-1)[self._first + rows] = scenes
        self._newest = None
        if self._apart is None or self._past.shape[2] == 1:
            self._apart = None
            return
        # What is known of the others stays, in arrays of its own, since the old ones may have been given out.
        x, y, yaw, _, _, _, other_x, other_y, *_ = scenes
        here = separation(self._math, other_x - x, other_y - y, yaw)
        self._apart = self._apart[0].copy(), self._apart[1].copy()
        for known, new in zip(self._apart, here, strict=True):
            known[rows] = new

    def push(self, numbers: Sequence[Number]) -> None:
        """Add the newest scene, one step after the last, by its 11 `numbers`."""
        self._at = (self._at or len(self._past)) - 1
        self._math.put(self.now, numbers)
        self._newest, self._apart = numbers, None

    def apart(self) -> tuple[Number, Number]:
        """Return distance [m] and bearing [rad] of the opponent from the robot now."""
        if self._apart is None:
            x, y, yaw, _, _, _, other_x, other_y, *_ = self.newest()
            self._apart = separation(self._math, other_x - x, other_y - y, yaw)
        return self._apart

    def separation(self) -> tuple[FloatArray, FloatArray]:
        """Return what `apart` does as arrays, shape (n,) each."""
        distance, bearing = self.apart()
        return self._math.array(distance), self._math.array(bearing)

    def ago(self, delay_s: float) -> FloatArray:
        """Return the scene `delay_s` before now, in all episodes, shape (11, n)."""
        return self._math.table(self.seen(delay_s))

    def seen(self, delay_s: float) -> list[Number]:
        """Return the numbers of the scene `delay_s` before now."""
        whole, share = divmod(delay_s / self._step_s, 1.0)
        place, kept = self._at + int(whole), len(self._past)
        newer = self._past[place % kept]
        if share == 0.0:
            return list(self._math.of(newer))
        return list(self._math.between(newer, self._past[(place + 1) % kept], share))

    def seen_by(self, delays_s: Number) -> list[Number]:
        """Return the numbers of the scenes before now, in each episode its own delay [s]."""
        if isinstance(delays_s, float):
            return self.seen(min(delays_s, self._step_s * (len(self._past) - 2)))
        return list(self.ago_of(np.arange(self._past.shape[2]), delays_s))

    def ago_of(self, rows: RowArray, delays_s: FloatArray) -> FloatArray:
        """Return scenes of some rows (m,), each with its own delay before now (m,) [s], shape (11, m).

        Delays are limited to what is kept.
        """
        age = np.clip(delays_s / self._step_s, 0.0, len(self._past) - 2.0)
        whole, kept = np.floor(age).astype(np.intp), len(self._past)
        place = self._at + whole
        newer, older = (self._past[one % kept, :, rows].T for one in (place, place + 1))
        return newer + (age - whole) * (older - newer)


def separation(math: Mathematics, dx: Number, dy: Number, yaw: Number) -> tuple[Number, Number]:
    """Return distance [m] and bearing [rad] of a point that is dx, dy [m] away, from a heading `yaw` [rad].

    The `math` is that of these numbers. The bearing is 0 straight ahead and positive to the left.
    """
    return math.sqrt(dx * dx + dy * dy), wrapped(math.arctan2(dy, dx) - yaw)
