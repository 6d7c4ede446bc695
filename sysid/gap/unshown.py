"""Effects of a set that it does not need by themselves: their size may as well be none.

A set is chosen as a whole, by what it explains. Beside an effect whose formula is not exact another one may
describe what that leaves, with a size that the logs hardly tell. Where the interval of a size holds the value
at which nothing changes, the set without that effect is a candidate, too. A set that leaves noise has exact
formulas, for whose error the intervals allow: there they are no objection.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from sysid.gap.result import Difference, FoundEffect, GapReport
from sysid.gap.wording import interval_text, unit_of

_NOISE: Final = 2.0
"""Error on test runs up to which a set leaves noise, in noise floors. Assumed."""


def with_unshown(report: GapReport) -> GapReport:
    """Return a report without a claim of an effect whose size may be none: the others alone are a candidate.

    A set needs something to explain a gap: if all of its effects are such, it stays as it is.
    """
    if report.verdict not in ("named", "ambiguous") or _leaves_noise(report.gap):
        return report
    best = report.candidates[0]
    claimed = [effect for effect in report.effects if effect.cause in best]
    told = {effect.cause: why for effect in claimed if (why := _may_be_none(effect, report.base))}
    rest = tuple(cause for cause in best if cause not in told)
    if not told or not rest:
        return report
    why = "; ".join(told.values())
    note = f"{why}: this includes no effect at all, so that the others alone are a candidate"
    candidates = tuple(dict.fromkeys((*report.candidates, rest)))
    return replace(report, verdict="ambiguous", candidates=candidates, notes=(*report.notes, note))


def _leaves_noise(gap: Difference) -> bool:
    return gap.noise_floor is not None and gap.after <= _NOISE * gap.noise_floor


def _may_be_none(effect: FoundEffect, base: Model) -> str:
    """Return in words that the intervals of an effect's sizes hold those of no effect at all; else ""."""
    known, values = CATALOGUE[effect.name], dict[str, float]()
    for parameter in known.parameters:
        if parameter.neutral is not None and parameter.name in effect.parameters:
            size, none = effect.parameters[parameter.name], parameter.neutral_in(base)
            values[parameter.name] = none if size.low <= none <= size.high else size.value
    if not values or not known.is_neutral(values, base):
        return ""
    told = {key: one for key, one in effect.estimates.items() if key in values or key == "droop_rpm"}
    ends = (
        f"{key} {interval_text(one, '')[1]} {unit_of(effect.name, key)}".strip() for key, one in told.items()
    )
    return f"{effect.name} ({', '.join(ends)})"
