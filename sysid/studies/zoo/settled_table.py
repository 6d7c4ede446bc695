"""How often the experiments of ambiguous studies settled their cases, as tables of a page.

No result depends on this file.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from statistics import fmean, median
from typing import Final

from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import wilson_interval
from sysid.studies.zoo.settled import BUDGET_S, Result, Round, Settled

_WANTED: Final = 0.8
"""Share of cases that the experiments are to settle within the budget."""
_FAR: Final = 1.2
"""Reach from which an experiment leaves the range of the logs."""
_MOST: Final = 0.9
"""Share of kept changes below which another experiment was driven than the one that was asked for."""
_OTHERS: Final[tuple[Result, ...]] = ("wrong", "lost", "not offered", "still tied", "over budget", "error")
"""Results beside those that are counted on their own."""


def settle_table(results: Sequence[Settled]) -> str:
    """Return as Markdown how often the experiments settled a case, what they promised, and what else came."""
    groups = {"all": list(results)}
    for one in sorted(results, key=lambda one: (one.case.level, one.case.kind)):
        groups.setdefault(one.case.level, []).append(one)
        groups.setdefault(f"{one.case.level}, {one.case.kind}", []).append(one)
    head = ("cases", "ambiguous", "to settle", "settled", *_OTHERS, "driving [s]")
    parts = [
        _headline(results),
        markdown_table(head, [_row(name, group) for name, group in groups.items()]),
        "To settle: cases with a tied set that logs can tell from the truth. In brackets 95 % Wilson "
        "intervals. Driving: median over the cases that were driven, repeats counted.",
        "What the first experiment of each case promised, and what came of it:",
        markdown_table(("promised", "cases", "mean promise", "settled"), _promises(results)),
    ]
    rounds = [one for settled in results for one in settled.rounds]
    if rounds:
        parts.append(markdown_table((f"of {len(rounds)} experiments", "count"), _odd(rounds)))
    return "\n\n".join(parts)


def _to_settle(results: Sequence[Settled]) -> list[Settled]:
    return [one for one in results if one.result != "nothing to settle"]


def _headline(results: Sequence[Settled]) -> str:
    open_cases = _to_settle(results)
    count = sum(one.result == "settled" for one in open_cases)
    low, high = wilson_interval(count, len(open_cases))
    said = "reached" if low >= _WANTED else "missed" if high < _WANTED else "too few cases to tell"
    return (
        f"The next experiment, driven three times and again up to {BUDGET_S:g} s of driving, settles "
        f"{_share(count, len(open_cases))} of the ambiguous cases; wanted are {100 * _WANTED:g} %: {said}."
    )


def _row(name: str, group: Sequence[Settled]) -> tuple[str, ...]:
    open_cases = _to_settle(group)
    results = Counter(one.result for one in open_cases)
    driven = [one.driving_s for one in group if one.rounds]
    return (
        name,
        f"{len(group)}",
        f"{len(open_cases)}",
        _share(results["settled"], len(open_cases)),
        *(f"{results[other]}" for other in _OTHERS),
        f"{median(driven):.0f}" if driven else "-",
    )


def _promises(results: Sequence[Settled]) -> list[tuple[str, ...]]:
    """Return per band of promised power how many cases were driven, mean promise and share settled."""
    driven = [one for one in _to_settle(results) if one.rounds]
    rows: list[tuple[str, ...]] = []
    for low, high in ((0.0, 0.5), (0.5, 0.9), (0.9, math.inf)):
        band = [one for one in driven if low <= one.rounds[0].power < high]
        promise = f"{100 * fmean(one.rounds[0].power for one in band):.0f} %" if band else "-"
        name = f"{100 * low:g} to {100 * high:g} %" if high < math.inf else f"{100 * low:g} % and more"
        settled = sum(one.result == "settled" for one in band)
        rows.append((name, f"{len(band)}", promise, _share(settled, len(band))))
    return rows


def _odd(rounds: Sequence[Round]) -> list[tuple[str, str]]:
    """Return what may keep an experiment from settling anything, and of how many that is true."""
    counts = {
        "promise less than an even chance": sum(one.power < 0.5 for one in rounds),
        f"command more than {_FAR:g} times the largest speed of the logs": sum(
            one.reach > _FAR for one in rounds
        ),
        f"change commands faster than the link sends them (less than {100 * _MOST:g} % of the changes)": sum(
            one.kept < _MOST for one in rounds
        ),
        "decide nothing: reading the folder sets the recordings aside for the test": sum(
            not one.decides for one in rounds
        ),
    }
    return [(what, f"{count}") for what, count in counts.items()]


def _share(count: int, of: int) -> str:
    if not of:
        return "-"
    low, high = wilson_interval(count, of)
    return f"{100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
