"""Effects that the test runs refute: with them the model misses these by more, or by as much as before.

Test runs are whole command sequences that take no part in the search. A set of effects that explains the runs
which decide, and has the model miss the others by more than before, describes the former and is not what
happened. So the last word is theirs, and it can only be no.

The size of a threshold is an exception. The runs which decide show only that it lies between two commands,
and its estimate is the middle. If test runs refute that, the effect is stated at the end at which it does
least: there it does no more than these runs have shown, and what test runs refute then is the effect itself.

Test runs that never do what an effect acts on, such as commands within a dead band, say nothing of it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from sysid.compare.search_space import EffectSet
from sysid.gap.inquiry import Inquiry
from sysid.gap.result import Difference, GapReport, Verdict
from sysid.gap.search.chance import Floor
from sysid.gap.search.rules import Facts, may_be_noise
from sysid.gap.search.scores import interval_ends
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.wording import amount, set_name

_ROUNDING: Final = 1e-6
"""Relative change of an rms that is no more than rounding."""


def refuted(report: GapReport, floor: Floor) -> str:
    """Return in a sentence that test runs refute the effects of a report; else "".

    Where the commands of the fit were driven again, what the model missed in these is no objection. `floor`
    says what is known of the noise.
    """
    gap = report.gap_beside_fit or report.gap
    if not (report.unseen and report.effects):
        return ""
    if gap.after > THRESHOLDS.large_rms_rise * gap.before:
        what = "raises"
    elif _removes_nothing(gap) and floor.new_on_bench:
        what = "hardly lowers"
    else:
        return ""
    names = set_name([effect.name for effect in report.effects])
    return (
        f"{names}: explains the runs that decide, but {what} the error on the unseen test runs from "
        f"{amount(gap.before, gap.unit)} to {amount(gap.after, gap.unit)}, and is therefore not named"
    )


def not_in_test_runs(report: GapReport) -> str:
    """Return in a sentence that the test runs say nothing of the effects of a report; else ""."""
    if not (report.unseen and report.effects) or _changes(report.gap):
        return ""
    names = set_name([effect.name for effect in report.effects])
    return f"no test run does what shows {names}, so that none confirms it"


def _changes(gap: Difference) -> bool:
    """Return whether effects change the predictions of the test runs."""
    return abs(gap.before - gap.after) > _ROUNDING * gap.before


def _removes_nothing(gap: Difference) -> bool:
    """Return whether effects remove less of a difference on test runs than of that which decides they must.

    Whether a difference is removed that is about as large as the noise is left to chance, and none can be
    where the effects change no prediction.
    """
    noise = gap.noise_floor
    if noise is None or gap.before <= THRESHOLDS.large_rms_rise * noise or not _changes(gap):
        return False
    return gap.before**2 - gap.after**2 < THRESHOLDS.least_removed * (gap.before**2 - noise**2)


def verdict_of_refuted(facts: Facts) -> Verdict:
    """Return the verdict of a study of which the test runs refute the effects.

    There is no gap if nothing but these effects said that there is one: the whole residual, weighted and
    plain, is then what a right model leaves.
    """
    return "no_gap" if may_be_noise(facts) and not facts.is_plain else "unexplained"


def at_least_thresholds(found: Inquiry) -> Inquiry | None:
    """Return an inquiry with each threshold of the chosen set at the end of its interval where it does least.

    The runs which decide show no difference. None if the set has no threshold between commands.
    """
    chosen = found.decision.chosen
    if chosen is None or not any(chosen.fitted.candidate.stepwise):
        return None
    fitted = chosen.fitted
    candidate: EffectSet = fitted.candidate
    low, high = interval_ends(found.search.problem, fitted, found.decision.facts.inflation)
    least = np.clip(candidate.start(), low, high)
    place = np.where(candidate.stepwise, least, fitted.place)
    names = set_name([one.effect for one in candidate.coordinates if one.stepwise])
    note = (
        f"{names}: unseen test runs refute a threshold in the middle of its interval, and bear the one at "
        "which it does least, which is stated"
    )
    moved = replace(chosen, fitted=replace(fitted, place=place))
    return replace(found, decision=replace(found.decision, chosen=moved, notes=(*found.decision.notes, note)))
