"""The link from the latch of commands to the drive: its delay, which may jitter, and commands that are lost.

What is random comes from a hash of the link's seed and the number of the latch, so that runs repeat, parts
of a run agree, and all wheels on one link see the same. The hash is splitmix64 (Steele, Lea and Flood 2014,
"Fast splittable pseudorandom number generators").
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

SPREAD: Final = math.sqrt(3.0)
"""Largest deviation of a delay in multiples of the jitter: it is uniform with unit variance."""
MOST_SEEDS: Final = 2**53
"""Seeds are whole numbers up to this, which double precision holds exactly."""
_JITTER, _LOSS = 0, 1  # streams of random numbers
_STEP, _FIRST, _SECOND = (
    np.uint64(factor) for factor in (0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB)
)
# Made once: for the few numbers of one episode, numpy makes a scalar as slowly as it computes.
_ONE, _SHIFTS = np.uint64(1), tuple(np.uint64(shift) for shift in (30, 27, 31))


@dataclass(frozen=True)
class Link:
    """How commands come to a drive; latch j is at j periods."""

    period_s: float
    """Period of the latches [s]."""
    delay_s: float
    """Mean time from a latch to its effect [s]."""
    jitter_s: float
    """Standard deviation of that time from one change of the command to the next [s]; 0: always the same."""
    loss: float
    """Probability that a latched command is lost."""
    seed: int

    def kept(self, first: int, count: int) -> npt.NDArray[np.intp]:
        """Return which command each latch has: i for that of latch `first` + i - 1, 0 for the one before.

        The shape is (count + 1,): the command before `first`, and those of `count` latches. A lost command
        leaves the one before it.
        """
        numbers = np.arange(count + 1)
        if self.loss > 0.0:
            numbers[1:][is_lost(self.loss, self.seed, first + numbers[:-1])] = 0
        return np.maximum.accumulate(numbers)

    def arrivals(self, first: int, sent_rpm: FloatArray, before_s: npt.ArrayLike) -> FloatArray:
        """Return when the commands of latches arrive [s], of the shape (..., J + 1) of the commands.

        Each change of the command has its own delay, but none arrives before it is sent or before an earlier
        one. A repetition arrives with the change that it repeats.

        Args:
            first: number j of the second of the commands.
            sent_rpm: commands [rpm] of the latch before `first`, of `first` and of those after it.
            before_s: when the first of these arrived [s], shape (...).
        """
        numbers = first + np.arange(sent_rpm.shape[-1] - 1)
        own = numbers * self.period_s + own_delay(self.delay_s, self.jitter_s, self.seed, numbers)
        arrivals = np.zeros(sent_rpm.shape)
        arrivals[..., 0] = before_s
        arrivals[..., 1:] = np.where(sent_rpm[..., 1:] != sent_rpm[..., :-1], own, 0.0)
        return np.maximum.accumulate(arrivals, axis=-1)


def own_delay(
    delay_s: npt.ArrayLike, jitter_s: npt.ArrayLike, seed: npt.ArrayLike, latches: npt.ArrayLike
) -> FloatArray:
    """Return the delay [s] of a change of the command at latches; all shapes broadcast.

    It is `delay_s` with a deviation of standard deviation `jitter_s` [s], drawn by a hash of the `seed`.
    """
    deviation = SPREAD * (2.0 * _uniform(seed, latches, _JITTER) - 1.0)
    delay, jitter = np.asarray(delay_s, float), np.asarray(jitter_s, float)
    return np.asarray(np.maximum(delay + jitter * deviation, 0.0))


def is_lost(loss: npt.ArrayLike, seed: npt.ArrayLike, latches: npt.ArrayLike) -> npt.NDArray[np.bool_]:
    """Return whether the commands of latches are lost, with a probability `loss`; all shapes broadcast.

    Chance is a hash of the `seed` and the latch's number.
    """
    return np.asarray(_uniform(seed, latches, _LOSS) < np.asarray(loss, float))


def _uniform(seed: npt.ArrayLike, latches: npt.ArrayLike, stream: int) -> FloatArray:
    """Return a random number from 0 to below 1 for each of the latches, independent in each stream."""
    seeds, numbers = (np.atleast_1d(np.asarray(one)).astype(np.uint64) for one in (seed, latches))
    mixed = hashed(seeds, np.uint64(2) * numbers + np.uint64(stream)) >> np.uint64(11)
    shape = np.broadcast_shapes(np.shape(seed), np.shape(latches))
    return (mixed.astype(float) * 2.0**-53).reshape(shape)


def hashed(seeds: npt.NDArray[np.uint64], numbers: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Return 64 bits that look random for each of the seeds and numbers, whose shapes, none (), broadcast."""
    return _mixed(_mixed(seeds + _STEP) + (numbers + _ONE) * _STEP)


def _mixed(bits: npt.NDArray[np.uint64]) -> npt.NDArray[np.uint64]:
    """Return the hash of 64 bits, of any shape but ()."""
    first, second, third = _SHIFTS
    mixed = bits ^ (bits >> first)
    mixed *= _FIRST
    mixed ^= mixed >> second
    mixed *= _SECOND
    mixed ^= mixed >> third
    return mixed
