"""Residuals in units of what noise and the model's own error make likely.

The covariance of a block's residual is that of the noise plus that of the model's error,

    C(i, j) = delta(i, j) sigma^2 / weight(i) + SHARE^2 e(i) e(j) exp(-|t(i) - t(j)| / T),

with e(t) and T as `sysid.compare.model_error` has them. Where repeats differ for longer than a sample, that
share of sigma^2 falls with a time of its own instead; where a sensor's steps are coarse beside its noise,
the rounding that all repeats share is added twice, once independent and once for as long as a speed lasts.
With C = L L', the residual L^-1 (measured - predicted) of a right model is white with unit variance. The part
of the model's error that is the same after every change of command is not in C: it is a column of
`sysid.compare.nuisance`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.linalg import solve_triangular

from mecanum_env.units import FloatArray
from sysid.compare.model_error import ChannelError, ModelError, activity_rpm
from sysid.compare.noise import Noise
from sysid.compare.observations import WINDOW_S, Block, Observations
from sysid.compare.prediction import POSE

SHARE: Final = 0.5
"""Part of the model's error that differs from one change of command to the next."""
ROUNDED_S: Final = 0.3
"""How long a speed is rounded to the same side, about."""
_LEAST_WHITE: Final = 1e-3  # of lasting noise, so that the covariance can be factored
VELOCITY_OF: Final = {"x_m": "vx_m_s", "y_m": "vy_m_s", "yaw_rad": "yaw_rate_rad_s"}
"""A pose's error is that of the velocity that made it."""


class Whitener:
    """Whitens what belongs to the blocks of some observations.

    Args:
        observations: whose blocks are compared.
        noise: of each channel.
        error: of the model; None for none.
    """

    def __init__(self, observations: Observations, noise: Noise, error: ModelError | None) -> None:
        self.observations, self.noise, self.error = observations, noise, error
        self._factors = [self._factor(block) for block in observations.blocks]
        sizes = [block.value.size for block in observations.blocks]
        ends = np.cumsum([0, *sizes])
        self.slices = tuple(slice(int(a), int(b)) for a, b in pairwise(ends))
        """Where each block lies in a whitened vector."""
        self.size = int(ends[-1])

    def whiten(self, parts: Sequence[FloatArray]) -> FloatArray:
        """Return one vector (N,) of parts, one a block, each of the block's shape (m,) or (m, p)."""
        return np.concatenate(
            [
                part / factor.reshape((-1,) + (1,) * (part.ndim - 1))
                if factor.ndim == 1
                else solve_triangular(factor, part, lower=True, check_finite=False)
                for part, factor in zip(parts, self._factors, strict=True)
            ]
        )

    def unwhiten(self, vector: FloatArray) -> list[FloatArray]:
        """Return the parts, each of its block's shape (m,), of a whitened vector (N,)."""
        return [
            vector[place] * factor if factor.ndim == 1 else factor @ vector[place]
            for place, factor in zip(self.slices, self._factors, strict=True)
        ]

    def measured(self) -> list[FloatArray]:
        """Return the blocks' measured values."""
        return [block.value for block in self.observations.blocks]

    def _factor(self, block: Block) -> FloatArray:
        variance = self.noise.sigma[block.channel] ** 2 / block.weight
        lasting = self.noise.correlated.get(block.channel)
        error = error_of(self.error, block.channel)
        exact = error is None or (error.settled == 0.0 and error.transient == 0.0)
        shared = self.noise.rounding.get(block.channel, 0.0)
        if exact and lasting is None and not shared:
            return np.sqrt(variance)
        apart = np.abs(block.time_s[:, None] - block.time_s[None, :])
        covariance = np.zeros(apart.shape)
        if lasting is not None:
            common = lasting.share * self.noise.sigma[block.channel] ** 2 / block.repeats
            covariance += common * np.exp(-apart / lasting.time_s)
            variance = (1.0 - lasting.share) * variance + _LEAST_WHITE * common
        if shared:
            variance = variance + shared**2
            covariance += shared**2 * np.exp(-apart / ROUNDED_S)
        if error is not None and not exact:
            size = SHARE * error_size(error, self.observations, block)
            covariance += np.outer(size, size) * np.exp(-apart / error.correlation_s)
        covariance[np.diag_indices_from(covariance)] += variance
        return np.asarray(np.linalg.cholesky(covariance))


def error_of(error: ModelError | None, channel: str) -> ChannelError | None:
    """Return the model's error in a channel; of a pose, in the way made in a window.

    Args:
        error: as the model states it.
        channel: a column of a log.
    """
    if error is None:
        return None
    if channel in error.channels or channel not in POSE:
        return error.channels.get(channel)
    velocity = error.channels.get(VELOCITY_OF[channel])
    if velocity is None:
        return None
    return ChannelError(WINDOW_S * velocity.settled, WINDOW_S * velocity.transient, velocity.correlation_s)


def error_size(error: ChannelError, observations: Observations, block: Block) -> FloatArray:
    """Return the size e(t) of the model's error at a block's samples, shape (m,), in its channel's unit.

    Args:
        error: of the block's channel.
        observations: that the block is of.
        block: one channel of one situation.
    """
    run = observations.situations[block.situation].runs[0]
    return np.hypot(error.settled, error.transient * activity_rpm(run, block.time_s))
