"""Whitening of residuals by the covariance of the noise and of the model's own error.

The covariance of a block's residual is

    C(i, j) = delta(i, j) sigma^2 / weight(i) + _SHARE^2 e(i) e(j) exp(-|t(i) - t(j)| / T),

with e(t) and the correlation time T of `sysid.compare.model_error.size`. If the noise is correlated, that
share of sigma^2 decays with its own correlation time. If it is uneven (`sysid.compare.noise.uneven`), sigma
is that of settled noise, and what decays after a change of command adds a term like the last one; where
changes act at other times in each repeat (`sysid.compare.noise.timing`), what follows the slope of the speed
does so. The variance of the rounding error that all repeats share counts twice: white, as while the speed
changes, and correlated over `_ROUNDING_S`. Noise that lasts (`sysid.compare.noise.lasting`) is the same as
long as a command is held. With C = L L', the residual L^-1 (measured - predicted) of a right model is white
with unit variance. The part of the model's error that is the same after every change of command is not in C:
it is a column of `sysid.compare.model_error.nuisance`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.linalg.lapack import dtrtrs

from mecanum_env.kinematics import POSE
from mecanum_env.units import FloatArray
from sysid.compare.measured import WINDOW_S, Block, Observations, activity_rpm
from sysid.compare.model_error.size import DECAY_S, ChannelError, ModelError
from sysid.compare.noise import Noise, holds_of, slope_of

_SHARE: Final = 0.5
"""Share of the model's error that differs from one change of command to the next."""
_ROUNDING_S: Final = 0.3
"""Correlation time of the rounding error [s]: about how long a speed stays near the same value."""
_LEAST_WHITE: Final = 1e-3  # share of correlated noise that is made white, so that C is positive definite
VELOCITY_OF: Final = {"x_m": "vx_m_s", "y_m": "vy_m_s", "yaw_rad": "yaw_rate_rad_s"}
"""The error of a displacement is that of the velocity."""


class Whitener:
    """Whitens residuals, or differences of predictions; the model's own error is None if it is not known."""

    def __init__(self, observations: Observations, noise: Noise, error: ModelError | None) -> None:
        self.observations, self.noise, self.error = observations, noise, error
        self._factors = [self._factor(block) for block in observations.blocks]
        sizes = [block.value.size for block in observations.blocks]
        ends = np.cumsum([0, *sizes])
        self.slices = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        """The entries of each block in a whitened vector."""
        self.size = int(ends[-1])

    def whiten(self, parts: Sequence[FloatArray]) -> FloatArray:
        """Return the whitened vector (N,), or columns (N, p), of `parts`: (m,) or (m, p) for each block."""
        return np.concatenate(
            [
                part / factor.reshape((-1,) + (1,) * (part.ndim - 1))
                if factor.ndim == 1
                # LAPACK itself, on the transpose as it wants columns: scipy's wrapper takes as long again.
                else dtrtrs(factor.T, part, lower=0, trans=1)[0]
                for part, factor in zip(parts, self._factors, strict=True)
            ]
        )

    def unwhiten(self, vector: FloatArray) -> list[FloatArray]:
        """Return the parts of each block, (m,) or (m, p), from a whitened `vector` (N,) or columns (N, p)."""
        return [
            vector[rows] * factor.reshape((-1,) + (1,) * (vector.ndim - 1))
            if factor.ndim == 1
            else factor @ vector[rows]
            for rows, factor in zip(self.slices, self._factors, strict=True)
        ]

    def expected_squares(self) -> list[FloatArray]:
        """Return the mean square of what each block's residual (m,) of a right model is, in its unit.

        The model's own error counts in full, with what is the same after every change of command.
        """
        return [
            (factor**2 if factor.ndim == 1 else np.sum(factor**2, axis=1))
            + (1.0 - _SHARE**2) * self._own_error(block) ** 2
            for block, factor in zip(self.observations.blocks, self._factors, strict=True)
        ]

    def measured(self) -> list[FloatArray]:
        """Return the blocks' measured values."""
        return [block.value for block in self.observations.blocks]

    def _factor(self, block: Block) -> FloatArray:
        """Return L, or its diagonal if C is diagonal."""
        run = self.observations.situations[block.situation].runs[0]
        settled = self.noise.settled(block.channel)
        variance = settled**2 / block.weight
        uneven = self.noise.uneven.get(block.channel)
        correlated = self.noise.correlated.get(block.channel)
        timing = self.noise.timing.get(block.channel)
        error = error_of(self.error, block.channel)
        exact = error is None or (error.settled == 0.0 and error.transient == 0.0)
        rounding = self.noise.rounding.get(block.channel, 0.0)
        lasting = self.noise.lasting.get(block.channel, 0.0)
        even = correlated is None and uneven is None and timing is None
        if exact and even and not rounding and not lasting:
            return np.sqrt(variance)
        lag_s = np.abs(block.time_s[:, None] - block.time_s[None, :])
        covariance = np.zeros(lag_s.shape)
        if correlated is not None:
            common = correlated.share * settled**2 / block.independent_repeats
            covariance += common * np.exp(-lag_s / correlated.time_s)
            variance = (1.0 - correlated.share) * variance + _LEAST_WHITE * common
        if uneven is not None:
            decaying = self.noise.transient(block.channel, run, block.time_s)
            covariance += (
                np.outer(decaying, decaying) * np.exp(-lag_s / uneven.decay_s) / block.independent_repeats
            )
        if timing is not None:
            moved = timing.delay_s * slope_of(block.value, block.time_s)
            holds = holds_of(self.observations, block)
            together = holds[:, None] == holds[None, :]
            covariance += np.outer(moved, moved) * together / block.independent_repeats
        if rounding:
            variance = variance + rounding**2
            covariance += rounding**2 * np.exp(-lag_s / _ROUNDING_S)
        if lasting:
            holds = holds_of(self.observations, block)
            covariance += lasting**2 * (holds[:, None] == holds[None, :])
        if error is not None and not exact:
            size = _SHARE * self._own_error(block)
            covariance += np.outer(size, size) * np.exp(-lag_s / error.correlation_s)
        covariance[np.diag_indices_from(covariance)] += variance
        return np.asarray(np.linalg.cholesky(covariance))

    def _own_error(self, block: Block) -> FloatArray:
        """Return e(t), the standard deviation of the model's own error at a block's values, (m,)."""
        error = error_of(self.error, block.channel)
        if error is None:
            return np.zeros(block.value.size)
        run = self.observations.situations[block.situation].runs[0]
        return np.hypot(error.settled, error.transient * activity_rpm(run, block.time_s, DECAY_S))


def error_of(error: ModelError | None, channel: str) -> ChannelError | None:
    """Return the model's error in a channel, for a pose that of its displacements; None if unknown."""
    if error is None:
        return None
    if channel in error.channels or channel not in POSE:
        return error.channels.get(channel)
    velocity = error.channels.get(VELOCITY_OF[channel])
    if velocity is None:
        return None
    return ChannelError(WINDOW_S * velocity.settled, WINDOW_S * velocity.transient, velocity.correlation_s)
