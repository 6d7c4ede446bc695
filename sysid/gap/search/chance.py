"""What chance alone does: thresholds by simulation from the model itself.

Were a fitted set the whole truth, its marginal residual would be white, but for the rollers' roughness.
Drawing such residuals and growing the set by every effect of the library, as the search does, gives the
distribution of the best growth that chance makes, whatever the effects' number and likeness. Only the
responses' inner products are needed: the scores U = C' r of unit columns C are normal with covariance
C' (I + R R') C, R the columns of `ResidualProblem.roller_scatter`.

What these logs could show: the smallest size of each effect that the study would see.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE
from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.gap.result import Untestable
from sysid.gap.search.responses import Response

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


_NOTHING: Final = 0.1
"""A response shorter than this (in sigmas, over all samples) is none."""


def smallest_detectable(library: Sequence[Response], threshold: float) -> dict[str, dict[str, float]]:
    """Return effect -> parameter -> value that would be seen with 90 % probability.

    A parameter of which no value would is left out.

    Args:
        library: responses of the effects on these logs.
        threshold: gain of square sum that counts as seen.
    """
    needed = detectable_square(threshold)
    found: dict[str, dict[str, float]] = {}
    for name in dict.fromkeys(response.chosen.names[0] for response in library):
        own = [r for r in library if r.chosen.names[0] == name and not r.chosen.integral]
        for parameter in dict.fromkeys(r.chosen.coordinates[0].parameter for r in own):
            value = _smallest([r for r in own if r.chosen.coordinates[0].parameter == parameter], needed)
            if value is not None:
                found.setdefault(name, {})[parameter] = value
    return found


def untestable(
    considered: Sequence[str],
    library: Sequence[Response],
    detectable: Mapping[str, Mapping[str, float]],
    level: Literal["bench", "robot"],
) -> tuple[Untestable, ...]:
    """Return the effects that these logs could not show, with the reason.

    Args:
        considered: names of the effects that were tried.
        library: their responses.
        detectable: as `smallest_detectable` gives it.
        level: of the logs.
    """
    found = []
    for name, effect in CATALOGUE.items():
        if name in considered and name not in detectable:
            lengths = [float(np.linalg.norm(r.change)) for r in library if r.chosen.names[0] == name]
            seen = max(lengths, default=0.0) > _NOTHING
            reason = (
                "even the largest size of the search would change these logs by less than chance does"
                if seen
                else "no command in these logs brings it out: nothing measured depends on it"
            )
            found.append(Untestable(name, reason, {}))
        elif effect.simulated and level == "bench" and "bench" in effect.absent_from:
            found.append(Untestable(name, f"a bench log has no {effect.acts_on}: it takes a robot log", {}))
    return tuple(found)


def _smallest(own: Sequence[Response], needed: float) -> float | None:
    """Return the value of a parameter whose response is just long enough."""
    if own[0].linear:
        response = max(own, key=lambda r: float(np.linalg.norm(r.change)))
        length = float(np.linalg.norm(response.change))
        if length <= _NOTHING:
            return None
        first, place = response.chosen.coordinates[0], float(response.place[0])
        neutral = first.unit(first.neutral)
        at = neutral + (place - neutral) * np.sqrt(needed) / length
        return first.value(float(at)) if -1e-9 <= at <= 1.0 + 1e-9 else None
    # Sizes that were simulated, the nearest to neutral first; in between the length is taken to be straight.
    best: dict[float, float] = {}
    for response in own:
        length = float(np.linalg.norm(response.change))
        best[response.size] = max(best.get(response.size, 0.0), length)
    sizes = np.array([0.0, *sorted(best)])
    lengths = np.array([0.0, *(best[size] for size in sorted(best))])
    longest = np.maximum.accumulate(lengths)
    target = float(np.sqrt(needed))
    if longest[-1] < target:
        return None
    index = int(np.argmax(longest >= target))
    part = (target - longest[index - 1]) / max(longest[index] - longest[index - 1], 1e-12)
    size = sizes[index - 1] + part * (sizes[index] - sizes[index - 1])
    first = own[0].chosen.coordinates[0]
    neutral = first.unit(first.neutral) if np.isfinite(first.neutral) else 1.0
    direction = np.sign(float(own[0].place[0]) - neutral)
    return first.value(float(np.clip(neutral + direction * size, 0.0, 1.0)))
