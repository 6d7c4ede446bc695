"""Effects that the test runs refute: with them the model misses these by more.

Test runs are whole command sequences that take no part in the search. A set of effects that explains the runs
which decide, and has the model miss the others by more than before, describes the former and is not what
happened. So the last word is theirs, and it can only be no.
"""

from __future__ import annotations

from sysid.gap.result import GapReport, Verdict
from sysid.gap.search.rules import Facts, may_be_noise
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.wording import amount, set_name


def refuted(report: GapReport) -> str:
    """Return in a sentence that test runs refute the effects of a report; else "".

    Where the commands of the fit were driven again, what the model missed in these is no objection.
    """
    gap = report.gap_beside_fit or report.gap
    rises = gap.after > THRESHOLDS.large_rms_rise * gap.before
    if not (report.unseen and report.effects and rises):
        return ""
    names = set_name([effect.name for effect in report.effects])
    return (
        f"{names}: explains the runs that decide, but raises the error on the unseen test runs from "
        f"{amount(gap.before, gap.unit)} to {amount(gap.after, gap.unit)}, and is therefore not named"
    )


def verdict_of_refuted(facts: Facts) -> Verdict:
    """Return the verdict of a study of which the test runs refute the effects.

    There is no gap if nothing but these effects said that there is one: the whole residual, weighted and
    plain, is then what a right model leaves.
    """
    return "no_gap" if may_be_noise(facts) and not facts.is_plain else "unexplained"
