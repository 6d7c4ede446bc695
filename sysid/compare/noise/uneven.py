"""Noise that is larger after a change of command than while the command is held.

A command that reaches the drive a little earlier or later in each repeat moves the whole response to it:
repeats then differ after each change of command and agree while it is held. The variance of a sample is

    v(t) = settled^2 + transient^2 sum_c size_c^2 exp(-2 (t - t_c) / decay),

the sum over the changes of command c at t_c of size_c [rpm], found by maximum likelihood from the repeats.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.optimize import nnls

from mecanum_env.units import FloatArray
from sysid.compare.measured import Block, Observations, activity_rpm
from sysid.logs import Run

_DECAYS_S: Final = (0.05, 0.1, 0.2, 0.4, 0.8)
"""Times that are tried in which the differences between repeats decay [s]."""
_ROUNDS: Final = 8  # of iteratively reweighted least squares
_LEAST_SHARE: Final = 0.05
"""Least standard deviation of settled noise, relative to that over all samples. Assumed."""
_STANDING: Final = 0.02
"""Speed, relative to the largest one, below which a wheel stands: many encoders are silent then."""
_SURE: Final = 20.0
"""Rise of twice the log likelihood from which noise is called uneven. The two more parameters alone make it
rise by more than this in one of 20,000 logs."""


@dataclass(frozen=True)
class UnevenNoise:
    """How a channel's noise changes with the time since a change of command."""

    settled: float
    """Standard deviation while a command is held, relative to that over all samples."""
    transient: float
    """Standard deviation right after a change of command, in the channel's unit per rpm of the change."""
    decay_s: float
    """Time constant with which it decays, and correlation time of what is decaying [s]."""

    def settled_part(self, deviations: FloatArray, run: Run, time_s: FloatArray, sigma: float) -> FloatArray:
        """Return the deviations (repeats, n) of a run at some times [s], 0 where they are not settled.

        `sigma` is the standard deviation over all samples.
        """
        decaying = self.transient * activity_rpm(run, time_s, self.decay_s)
        return np.where(decaying < self.settled * sigma, deviations, 0.0)


def find_uneven(
    observations: Observations, blocks: Sequence[Block], sigma: float, least: float
) -> UnevenNoise | None:
    """Return how the noise of a channel's blocks changes after changes of command; None if it does not.

    `sigma` is the standard deviation over all samples, `least` that of a sensor's resolution. Samples at
    standstill do not count.
    """
    repeated = [block for block in blocks if block.degrees_of_freedom]
    if not repeated or sigma <= 0.0:
        return None
    runs = [observations.situations[block.situation].runs[0] for block in repeated]
    speeds = [np.abs(_samples(b, run)) for b, run in zip(repeated, runs, strict=True)]
    standing = _STANDING * max(float(np.max(speed)) for speed in speeds)
    used = [_freedom(b) * (speed > standing) > 0.0 for b, speed in zip(repeated, speeds, strict=True)]
    freedom = np.concatenate([_freedom(b)[rows] for b, rows in zip(repeated, used, strict=True)])
    if freedom.size == 0:
        return None
    squares = [np.nansum(b.deviations[:, rows] ** 2, axis=0) for b, rows in zip(repeated, used, strict=True)]
    mean = np.concatenate(squares) / freedom / sigma**2
    lowest = max(_LEAST_SHARE, least / sigma) ** 2
    constant = max(lowest, float(freedom @ mean) / float(freedom.sum()))
    best, found = _deviance(np.full(mean.size, constant), mean, freedom) - _SURE, None
    for decay_s in _DECAYS_S:
        timed = zip(repeated, runs, used, strict=True)
        active = np.concatenate([activity_rpm(r, b.sample_times_s[rows], decay_s) for b, r, rows in timed])
        columns = np.stack([np.ones(active.size), active**2], axis=1)
        variances = _variances(columns, mean, freedom, lowest)
        deviance = _deviance(columns @ variances, mean, freedom)
        if deviance < best:
            # The likelihood tells what is settled; the rest makes the variance of all samples what it is.
            rest = float(freedom @ (mean - variances[0])) / float(freedom @ active**2)
            transient = math.sqrt(max(rest, 0.0)) * sigma
            best, found = deviance, UnevenNoise(math.sqrt(variances[0]), transient, decay_s)
    return found


def _samples(block: Block, run: Run) -> FloatArray:
    """Return a run's measured values at the block's samples, shape (n,), 0 where there are none."""
    rows = block.rows.ravel()[: block.sample_times_s.size]
    return np.asarray(np.nan_to_num(run.channels[block.channel][rows]), float)


def _freedom(block: Block) -> FloatArray:
    """Return the degrees of freedom of the variance of each sample between the repeats, shape (n,)."""
    return np.asarray(np.maximum(np.isfinite(block.deviations).sum(axis=0) - 1.0, 0.0), float)


def _variances(columns: FloatArray, mean: FloatArray, freedom: FloatArray, lowest: float) -> FloatArray:
    """Return settled^2, at least `lowest`, and transient^2, by least squares with the expected weights."""
    variances = np.array([float(freedom @ mean) / float(freedom.sum()), 0.0])
    for _ in range(_ROUNDS):
        weight = np.sqrt(freedom) / np.maximum(columns @ variances, lowest)
        weighted = columns * weight[:, None]
        scale = np.maximum(np.linalg.norm(weighted, axis=0), 1e-300)
        variances = nnls(weighted / scale, mean * weight)[0] / scale
        variances[0] = max(variances[0], lowest)
    return np.asarray(variances)


def _deviance(variance: FloatArray, mean: FloatArray, freedom: FloatArray) -> float:
    """Return minus twice the log likelihood, up to a constant."""
    return float(freedom @ (np.log(variance) + mean / variance))
