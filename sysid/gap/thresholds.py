"""What chance alone does: thresholds by simulation from the model itself.

Were a fitted set the whole truth, its marginal residual would be white, but for the rollers' roughness.
Drawing such residuals and growing the set by every effect of the library, as the search does, gives the
distribution of the best growth that chance makes, whatever the effects' number and likeness. Only the
responses' inner products are needed: the scores U = C' r of unit columns C are normal with covariance
C' (I + R R') C, R the columns of `Problem.rough`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm

from mecanum_env.units import FloatArray
from sysid.gap.fitted import Fitted
from sysid.gap.library import Response

DRAWS: Final = 2000
FALSE_ALARM: Final = 0.01
"""Probability with which chance alone is taken for an effect."""
POWER: Final = 0.9
"""With which a smallest detectable size is seen."""
NEVER: Final = 3.0
"""Standard deviations by which a tied candidate may look worse than it is before it is dropped."""


@dataclass(frozen=True)
class Chance:
    """The best growth that chance makes."""

    gains: FloatArray
    """Sorted gains of square sum, one a draw."""

    def threshold(self, level: float = FALSE_ALARM) -> float:
        """Return the gain that chance exceeds with probability `level`."""
        return float(np.quantile(self.gains, 1.0 - level))

    def p_value(self, gain: float) -> float:
        """Return how likely chance makes at least a `gain` of square sum."""
        above = self.gains.size - int(np.searchsorted(self.gains, gain, side="left"))
        return (above + 1.0) / (self.gains.size + 1.0)


def chance(
    fitted: Fitted[Any],
    library: Sequence[Response],
    rng: np.random.Generator,
    rough: FloatArray,
    draws: int = DRAWS,
) -> Chance:
    """Simulate the best growth of a set by one effect, were the set the truth.

    Args:
        fitted: the set.
        library: responses of the effects that were considered.
        rng: of the draws.
        rough: what rollers that meet the floor otherwise would change (N, k), each by one sigma.
        draws: how many.
    """
    orthogonal = np.linalg.qr(fitted.jacobian)[0]
    units, owners = [], []
    for response in library:
        column = response.change - orthogonal @ (orthogonal.T @ response.change)
        length = float(np.linalg.norm(column))
        if length > 1e-6 and response.chosen.names[0] not in fitted.names:
            units.append(column / length)
            owners.append(response)
    if not units:
        return Chance(np.zeros(draws))
    columns = np.stack(units, axis=1)
    scores = rng.standard_normal((draws, len(units))) @ _root(columns.T @ columns).T
    scores += rng.standard_normal((draws, rough.shape[1])) @ (rough.T @ columns)
    gains = np.zeros(draws)
    for name in dict.fromkeys(owner.chosen.names[0] for owner in owners):
        joint = [i for i, o in enumerate(owners) if o.chosen.names[0] == name and o.linear]
        if joint:
            gram = columns[:, joint].T @ columns[:, joint]
            together = scores[:, joint]
            gains = np.maximum(gains, np.einsum("di,ij,dj->d", together, np.linalg.pinv(gram), together))
        others = [i for i, o in enumerate(owners) if o.chosen.names[0] == name and not o.linear]
        if others:
            # A threshold acts one way only.
            gains = np.maximum(gains, np.max(np.minimum(scores[:, others], 0.0) ** 2, axis=1))
    return Chance(np.sort(gains))


def misfit_p_value(cost: float, size: int, noise_freedom: float) -> float:
    """Return how likely a right model leaves at least this square sum.

    Args:
        cost: marginal square sum.
        size: values compared, N.
        noise_freedom: degrees of freedom that the noise is known with; infinite if it is known.
    """
    return float(f_distribution.sf(cost / size, size, min(noise_freedom, 1e7)))


def largest_misfit(size: int, noise_freedom: float, level: float = FALSE_ALARM) -> float:
    """Return the square sum over `size` that a right model exceeds with probability `level`.

    Args:
        size: values compared, N.
        noise_freedom: degrees of freedom that the noise is known with.
        level: of chance.
    """
    return float(f_distribution.isf(level, size, min(noise_freedom, 1e7)))


def detectable_square(threshold: float) -> float:
    """Return the squared length of a response that passes a threshold with probability `POWER`."""
    return float((np.sqrt(threshold) + norm.ppf(POWER)) ** 2)


def _root(covariance: FloatArray) -> FloatArray:
    values, vectors = np.linalg.eigh(covariance)
    root: FloatArray = vectors * np.sqrt(np.maximum(values, 0.0))
    return root
