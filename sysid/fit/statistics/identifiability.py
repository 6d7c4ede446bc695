"""Estimated quantities, and warnings about coefficients that the data cannot tell apart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.fit.statistics.linearised import Linearised

_CORRELATION: Final = 0.9
"""Magnitude of the correlation above which two coefficients are reported as a pair."""
_MEMBER: Final = 0.25
"""Share of the largest weight above which a coefficient is named in the least known combination."""
_REMEDY: Final = "commands that change more often and in both directions tell them apart better"


@dataclass(frozen=True)
class Quantity:
    """An estimated number and its uncertainty, which is infinite if the data do not determine the number."""

    name: str
    unit: str
    value: float
    standard_error: float
    """Standard error with the noise estimated from the residuals."""
    cramer_rao: float
    """Smallest standard error of any unbiased estimator, with the noise as stated in sigma_rpm."""
    low: float
    high: float
    """Ends of the interval at the requested level, by Student's t."""
    bias: float = 0.0
    """Expected error of a parameter due to curvature, to second order in the noise; not subtracted from the
    value. NaN if it cannot be computed; 0 for metrics."""

    @property
    def relative_error(self) -> float:
        """Standard error over the magnitude of the value."""
        return self.standard_error / abs(self.value) if self.value != 0.0 else math.inf


def weak_combinations(
    at: Linearised, parameters: Sequence[Quantity], metrics: Sequence[Quantity], second_order_suffices: bool
) -> tuple[str, ...]:
    """Return warnings, none if every coefficient is well determined.

    They name unknown coefficients, pairs that trade off, the least known combination, and those `metrics` of
    the law that are well determined nevertheless.

    Args:
        at: the fit linearised at the estimate.
        parameters: the estimated coefficients.
        metrics: what the law means for the wheel.
        second_order_suffices: a law without C and F predicts as well.
    """
    warnings = _held(at) + _unknown(at, parameters, second_order_suffices)
    vague = {q.name for q in parameters if math.isfinite(q.high) and q.high - q.low > abs(q.value)}
    warnings += _pairs(at, parameters, vague)
    if not (warnings or vague):
        return ()
    if vague:
        shown = ", ".join(
            f"{q.name} = {q.value:.3g} +- {q.high - q.value:.2g}" for q in parameters if q.name in vague
        )
        warnings.append(f"95 % interval wider than the value: {shown}; {_REMEDY}")
    if at.rank == len(at.singular) and not second_order_suffices:
        warnings.append(
            f"least known combination: {_combination(at)} "
            f"(condition number {at.singular[0] / at.singular[-1]:.3g})"
        )
    sure = [q for q in metrics if 0.0 < q.relative_error < 0.05]
    if sure:
        shown = ", ".join(f"{q.name} = {q.value:.4g} +- {q.high - q.value:.1g}" for q in sure)
        warnings.append(f"well determined nevertheless: {shown}")
    return tuple(warnings)


def _held(at: Linearised) -> list[str]:
    held = [name for name, row in zip(at.names, at.spread, strict=True) if name in "BCF" and not row.any()]
    if not held:
        return []
    order = 3 - len(set(held) & {"B", "C"})
    return [
        f"{', '.join(held)} held at 0: a law of order {order} explains these data as well, and a further "
        f"pole would follow the noise; {_REMEDY}"
    ]


def _unknown(at: Linearised, parameters: Sequence[Quantity], second_order_suffices: bool) -> list[str]:
    if second_order_suffices:
        return [
            "a second-order law explains these data as well as the third-order one, so A-F have no interval "
            f"of their own: any third pole that a zero cancels fits as well; {_REMEDY}"
        ]
    names = [q.name for q in parameters if not math.isfinite(q.standard_error)]
    if not names:
        return []
    if at.rank == len(at.singular):
        return [f"too few samples for an interval of {', '.join(names)}; record longer runs"]
    return [f"these inputs say nothing about {', '.join(names)} on their own; {_REMEDY}"]


def _pairs(at: Linearised, parameters: Sequence[Quantity], vague: set[str]) -> list[str]:
    """Name highly correlated pairs of coefficients, of which at least one is vague."""
    factor = at.factor
    size = np.linalg.norm(factor, axis=1)
    found = []
    for i, j in itertools.combinations(range(len(parameters)), 2):
        one, other = parameters[i].name, parameters[j].name
        wide = " and ".join(sorted({one, other} & vague))
        if at.unknown[i] or at.unknown[j] or not wide or size[i] * size[j] == 0.0:
            continue
        correlation = float(factor[i] @ factor[j] / (size[i] * size[j]))
        if abs(correlation) > _CORRELATION:
            text = (
                f"{one} and {other} can hardly be told apart: correlation {correlation:.4f}, "
                f"95 % interval wider than the value for {wide}"
            )
            found.append((-abs(correlation), text))
    return [text for _, text in sorted(found)]


def _combination(at: Linearised) -> str:
    """Write the direction of largest variance as a sum of named parameters."""
    direction = at.factor[:, -1]
    relative = direction / np.max(np.abs(direction))
    relative = relative / relative[np.argmax(np.abs(relative))]
    terms = [
        f"{weight:+.2f} {name}"
        for weight, name in zip(relative, at.names, strict=True)
        if abs(weight) > _MEMBER
    ]
    return " ".join(terms).removeprefix("+")
