"""An estimated number with its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """An estimated number and how sure it is; infinite where the data say nothing about it."""

    name: str
    unit: str
    value: float
    standard_error: float
    """With the noise taken from the residuals."""
    cramer_rao: float
    """Smallest standard error of any unbiased estimator, with the noise as given in sigma_rpm."""
    low: float
    high: float
    """Ends of the interval at the level asked for, by Student's t."""
    bias: float = 0.0
    """Expected error of a parameter from curvature, to second order in the noise; not taken off the value.
    nan where it cannot be told; 0 for what the law means."""

    @property
    def relative_error(self) -> float:
        """Standard error over the value's size."""
        return self.standard_error / abs(self.value) if self.value != 0.0 else math.inf
