"""Normal noise of many episodes, made when it is needed: most episodes end long before their time limit.

The noise of an episode follows from its seed by a hash (`mecanum_env.law.link`) and the transform of Box and
Muller (1958), so that it depends neither on the episodes beside it nor on when it is made.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.law.link import hashed
from mecanum_env.tankendo.numbers import Number, mathematics
from mecanum_env.units import FloatArray

_STEPS: Final = 16
"""Steps that are made at a time."""


class Noise:
    """Standard normal numbers of n episodes, `channels` of them in each step; 0 until one has begun."""

    def __init__(self, n: int, channels: int) -> None:
        self._seeds = np.zeros(n, np.uint64)
        self._made = np.zeros((n, _STEPS, channels), np.float32)
        self._block = np.full(n, -1)  # which steps are made
        self._math = mathematics(n)
        self._all = slice(None) if n == 1 else np.arange(n)
        self._silent = True  # until an episode has begun

    def restart(self, rows: npt.NDArray[np.intp], seeds: FloatArray) -> None:
        """Begin episodes in some rows (m,), whose noise follows from whole numbers `seeds` from 0 to 2^53."""
        self._seeds[rows], self._block[rows], self._silent = seeds, -1, False

    def at(self, step: Number) -> FloatArray:
        """Return the noise at a step of the episodes, shape (channels, n)."""
        block = step // _STEPS
        late = block != self._math.of(self._block)
        if self._math.any(late) and not self._silent:
            rows = np.flatnonzero(late)
            self._make(rows, self._math.array(block)[rows])
        return np.asarray(self._made[self._all, step - _STEPS * block].T, float)

    def first(self, rows: npt.NDArray[np.intp]) -> FloatArray:
        """Return the noise at the start of the episodes in some rows (m,), shape (channels, m)."""
        self._make(rows, np.zeros(len(rows), np.intp))
        return np.asarray(self._made[rows, 0].T, float)

    def _make(self, rows: npt.NDArray[np.intp], blocks: npt.NDArray[np.intp]) -> None:
        """Make the steps of some rows (m,) that are in their `blocks` (m,)."""
        _, steps, channels = self._made.shape
        made = _normal(self._seeds[rows], blocks, steps * channels)
        self._made[rows] = made.reshape(-1, steps, channels)
        self._block[rows] = blocks


def _normal(
    seeds: npt.NDArray[np.uint64], blocks: npt.NDArray[np.intp], count: int
) -> npt.NDArray[np.float32]:
    """Return numbers of blocks of an even `count`, shape (m, count), for seeds and blocks (m,)."""
    half = count // 2
    numbers = (blocks * half)[:, None] + np.arange(half)
    bits = hashed(seeds[:, None], numbers.astype(np.uint64))
    share = (bits >> np.uint64(32)).astype(np.float32) + np.float32(0.5)
    angle = (bits & np.uint64(0xFFFFFFFF)).astype(np.float32) * np.float32(2.0 * np.pi * 2.0**-32)
    size = np.sqrt(np.float32(-2.0) * np.log(share * np.float32(2.0**-32)))
    return np.concatenate([size * np.cos(angle), size * np.sin(angle)], axis=1)
