"""White values beside factors that nobody knows.

With X the columns of what each unknown factor changes, one sigma of it, white values have the covariance
I + X X'. With X = U S V', W = I - U (1 - 1 / sqrt(1 + S^2)) U' whitens them again: |W r|^2 is what remains of
r after the factors have explained what they can.
"""

from __future__ import annotations

import numpy as np

from mecanum_env.units import FloatArray


class Marginal:
    """The whitening W beside the unknown factors with some columns X, shape (N, k)."""

    def __init__(self, factors: FloatArray) -> None:
        directions, size, _ = np.linalg.svd(factors, full_matrices=False)
        self._directions = directions
        self.spread: FloatArray = np.sqrt(1.0 + size**2)
        """Standard deviations along the directions of the factors, (min(N, k),)."""

    def of(self, values: FloatArray) -> FloatArray:
        """Return W times `values` (N,) or columns (N, p)."""
        return self._scaled(values, 1.0 / self.spread - 1.0)

    def inverse(self, values: FloatArray) -> FloatArray:
        """Return W^-1 times `values` (N,) or columns (N, p)."""
        return self._scaled(values, self.spread - 1.0)

    def _scaled(self, values: FloatArray, factors: FloatArray) -> FloatArray:
        along = self._directions.T @ values
        scaled = factors * along if values.ndim == 1 else factors[:, None] * along
        return np.asarray(values + self._directions @ scaled)
