"""Which coefficients the inputs cannot tell apart, in words that a user can act on."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from sysid.fit.statistics.linearised import Linearised
from sysid.fit.statistics.quantity import Quantity

_CORRELATION = 0.9
_MEMBER = 0.25
"""Share of the largest weight from which a coefficient is named in a weak combination."""
_REMEDY = "commands that change more often and in both directions tell them apart better"


def weak_combinations(
    at: Linearised,
    parameters: Sequence[Quantity],
    functionals: Sequence[Quantity],
    second_order_does: bool,
) -> tuple[str, ...]:
    """Return warnings, none when every coefficient is well determined.

    They name unknown coefficients, pairs that trade off, the least known combination, and what of the wheel's
    behaviour is sure all the same. `second_order_does` says that C and F are not needed: a law without them
    predicts as well.
    """
    warnings = _held(at) + _unknown(at, parameters, second_order_does)
    vague = {q.name for q in parameters if math.isfinite(q.high) and q.high - q.low > abs(q.value)}
    pairs = _pairs(at, parameters, vague)
    warnings += pairs
    if not (warnings or vague):
        return ()
    if vague:
        shown = ", ".join(
            f"{q.name} = {q.value:.3g} +- {q.high - q.value:.2g}" for q in parameters if q.name in vague
        )
        warnings.append(f"95 % interval wider than the value: {shown}; {_REMEDY}")
    if at.rank == len(at.singular) and not second_order_does:
        warnings.append(
            f"least known combination: {_combination(at)} "
            f"(condition number {at.singular[0] / at.singular[-1]:.3g})"
        )
    sure = [q for q in functionals if 0.0 < q.relative_error < 0.05]
    if sure:
        shown = ", ".join(f"{q.name} = {q.value:.4g} +- {q.high - q.value:.1g}" for q in sure)
        warnings.append(f"well determined all the same: {shown}")
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


def _unknown(at: Linearised, parameters: Sequence[Quantity], second_order_does: bool) -> list[str]:
    if second_order_does:
        return [
            "a second-order law explains these data as well as the third-order one, so A-F have no interval "
            f"of their own: any third pole does if a zero cancels it; {_REMEDY}"
        ]
    names = [q.name for q in parameters if not math.isfinite(q.standard_error)]
    if not names:
        return []
    if at.rank == len(at.singular):
        return [f"too few samples for an interval of {', '.join(names)}; record longer runs"]
    return [f"these inputs say nothing about {', '.join(names)} on their own; {_REMEDY}"]


def _pairs(at: Linearised, parameters: Sequence[Quantity], vague: set[str]) -> list[str]:
    """Name pairs of coefficients so correlated that one makes up for the other, one of them vague."""
    factor = at.factor
    size = np.linalg.norm(factor, axis=1)
    found = []
    for i, j in itertools.combinations(range(len(parameters)), 2):
        names = {parameters[i].name, parameters[j].name}
        if at.unknown[i] or at.unknown[j] or not (names & vague) or size[i] * size[j] == 0.0:
            continue
        correlation = float(factor[i] @ factor[j] / (size[i] * size[j]))
        if abs(correlation) > _CORRELATION:
            wide = " and ".join(sorted(names & vague))
            found.append(
                (
                    -abs(correlation),
                    f"{parameters[i].name} and {parameters[j].name} can hardly be told apart: correlation "
                    f"{correlation:.4f}, 95 % interval wider than the value for {wide}",
                )
            )
    return [text for _, text in sorted(found)]


def _combination(at: Linearised) -> str:
    """Write the direction of largest variance as a sum of named parameters."""
    direction = at.factor[:, -1]
    relative = direction / np.max(np.abs(direction))
    leading = np.argmax(np.abs(relative))
    relative = relative / relative[leading]
    terms = [
        f"{weight:+.2f} {name}"
        for weight, name in zip(relative, at.names, strict=True)
        if abs(weight) > _MEMBER
    ]
    return " ".join(terms).removeprefix("+")
