"""Limits of a drive that may be what another effect does to it, and no second change.

A motor at full voltage or at its largest current has so much torque and no more. A load on the wheel takes
its share of it: the drive then gives way at a lower speed, or accelerates less, although nobody lowered a
limit. The formulas of friction and inertia know nothing of the drive's limits, so that a study finds such a
limit beside them. It is reported, and so is the load alone. Where two limits explain nearly all, the load may
be missing beside them: it is looked for if both are lower than they were, since one load lowers both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final

from mecanum_env.model import Model, cause_of
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.thresholds import THRESHOLDS

_LIMITS: Final[Mapping[str, str]] = {"speed_saturation": "limit_rpm", "acceleration_limit": "limit_rpm_s"}
"""Cause that limits a drive -> its parameter."""
_LOADS: Final = ("coulomb_friction", "viscous_friction", "stiction", "load_inertia")
_MOST: Final = 0.5
"""Least share of what both explain that the load must explain alone. Assumed: a limit that matters more than
the load is hardly its consequence."""


def without_consequences(
    base: Model, cost: float, as_good: Sequence[ScoredSet], judged: Sequence[ScoredSet]
) -> tuple[tuple[ScoredSet, ...], tuple[str, ...]]:
    """Return the sets `as_good` and, behind them, those of their loads alone; and a note for each.

    Args:
        base: model without the sets.
        cost: that it leaves.
        as_good: sets that explain the logs.
        judged: all sets that were fitted.
    """
    fitted, found, notes = {one.names: one for one in judged}, list(as_good), []
    for one in as_good:
        limits = [name for name in one.names if _is_lower(base, one, name)]
        whole = _with_load(one, judged) if 1 < len(limits) == len(one.names) else one
        rest = fitted.get(tuple(name for name in whole.names if name not in limits))
        if not limits or rest is None or rest in found:
            continue
        loads = [name for name in rest.names if cause_of(name) in _LOADS]
        if loads and cost - rest.fitted.cost >= _MOST * (cost - whole.fitted.cost):
            found.append(rest)
            notes.append(
                f"{' + '.join(limits)} may be a consequence of {' + '.join(loads)}: what a load takes from a "
                "drive's voltage or torque, its limits lack"
            )
    return tuple(found), tuple(dict.fromkeys(notes))


def _with_load(limits: ScoredSet, judged: Sequence[ScoredSet]) -> ScoredSet:
    """Return the best set of these limits and a load that explains more than a tied one; else the limits."""
    larger = [
        one
        for one in judged
        if len(one.names) == len(limits.names) + 1
        and set(limits.names) < set(one.names)
        and {cause_of(name) for name in one.names} & set(_LOADS)
    ]
    best = min(larger, key=lambda one: one.score, default=limits)
    return best if best.score < limits.score - THRESHOLDS.tie_sigmas**2 else limits


def _is_lower(base: Model, one: ScoredSet, name: str) -> bool:
    """Return whether a set has this effect, and it is a limit below that of the base model, if any."""
    parameter = _LIMITS.get(cause_of(name))
    if parameter is None:
        return False
    after = one.fitted.candidate.model(base, one.fitted.place).effects[name].get(parameter, math.inf)
    before = [v.get(parameter, math.inf) for n, v in base.effects.items() if cause_of(n) == cause_of(name)]
    return bool(after < min(before, default=math.inf))
