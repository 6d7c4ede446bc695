"""What became of ambiguous cases once the experiments that their studies asked for were driven.

A tie of names that no log can tell apart is no failure of an experiment: such a case ends well where only the
hidden names and their twins are left, and one that begins there has nothing to settle.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from statistics import fmean, median
from typing import Any, Final, Literal

from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import wilson_interval
from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.outcome import Outcome, from_json, to_json
from sysid.studies.zoo.words import word_of

BUDGET_S: Final = 60.0
"""Driving that may be asked of a user, repeats counted [s]."""
_WANTED: Final = 0.8
"""Share of cases that the experiments are to settle within the budget."""

Names = tuple[str, ...]
"""A set of effects, as a study lists it."""
Result = Literal[
    "settled", "nothing to settle", "wrong", "lost", "not offered", "still tied", "over budget", "error"
]
"""What the experiments achieved: all that logs can tell is told; a tie of twins from the start; something
else than the hidden truth is named; the verdict has become `no_gap` or `unexplained`, which is not the truth;
no experiment was offered; none is offered any more, and others than twins are tied; the next one would have
exceeded the budget; a program refused the logs."""


@dataclass(frozen=True)
class Round:
    """One experiment as it was driven."""

    candidates: tuple[Names, ...]
    """Sets of effects that were tied before."""
    driving_s: float
    """Time of all its repeats [s]."""
    power: float
    """Probability with which it was promised to settle the case."""
    decides: bool
    """Whether the recordings were among the runs that decide; reading may set them aside for the test."""


@dataclass(frozen=True)
class Settled:
    """An ambiguous case after the experiments that its studies asked for."""

    first: tuple[Names, ...]
    """Sets of effects that were tied at first."""
    rounds: tuple[Round, ...]
    """Experiments in the order in which they were driven."""
    outcome: Outcome
    """Of the last study."""
    offered: bool
    """Whether the last study asked for another experiment."""
    why_not: str = ""
    """Why no further experiment was driven, where the last study could not decide."""

    @property
    def case(self) -> Case:
        """The case."""
        return self.outcome.case

    @property
    def verdict(self) -> str:
        """Of the last study."""
        return self.outcome.verdict

    @property
    def names(self) -> tuple[Names, ...]:
        """Sets of effects that the last study claims: one if it named a set, several if they are tied."""
        return tuple(tuple(sorted(names)) for names in self.outcome.claims)

    @property
    def driving_s(self) -> float:
        """Time that was driven, repeats counted [s]."""
        return sum(one.driving_s for one in self.rounds)

    @property
    def right(self) -> bool:
        """Whether the last verdict is the truth, or a tie of what no log can tell from it."""
        return word_of(self.outcome) in ("right", "quiet") or only_twins(self.case, self.outcome.claims)

    @property
    def result(self) -> Result:
        """What the experiments achieved."""
        if self.verdict == "ambiguous" and self.right and only_twins(self.case, self.first):
            return "nothing to settle"
        if self.right:
            return "settled"
        if self.verdict == "error":
            return "error"
        if self.verdict == "named":
            return "wrong"
        if self.verdict != "ambiguous":
            return "lost"
        if self.offered:
            return "over budget"
        return "still tied" if self.rounds else "not offered"


def only_twins(case: Case, candidates: Sequence[Collection[str]]) -> bool:
    """Return whether candidates are the hidden effects and sets that no log can tell from them, no other."""
    hidden = frozenset(effect.name for effect in case.hidden)
    as_good = {hidden}
    for count in range(1, len(hidden) + 1):
        for taken in combinations(sorted(hidden), count):
            for put in combinations(case.twins, count):
                as_good.add(hidden - set(taken) | set(put))
    sets = {frozenset(names) for names in candidates}
    # A twin that is claimed alone is claimed too boldly.
    return bool(hidden) and len(sets) > 1 and hidden in sets and sets <= as_good


def settled_json(settled: Settled) -> dict[str, Any]:
    """Return the object of a settled case's file."""
    return {**asdict(settled), "outcome": to_json(settled.outcome)}


def settled_from_json(entry: Mapping[str, Any]) -> Settled:
    """Return the settled case of an object that `settled_json` made."""
    rounds = tuple(Round(**{**one, "candidates": _sets(one["candidates"])}) for one in entry["rounds"])
    outcome = from_json(entry["outcome"])
    return Settled(_sets(entry["first"]), rounds, outcome, entry["offered"], entry["why_not"])


def _sets(entry: Sequence[Sequence[str]]) -> tuple[Names, ...]:
    return tuple(tuple(names) for names in entry)


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
    return "\n\n".join(parts)


_OTHERS: Final[tuple[Result, ...]] = ("wrong", "lost", "not offered", "still tied", "over budget", "error")


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


def _share(count: int, of: int) -> str:
    if not of:
        return "-"
    low, high = wilson_interval(count, of)
    return f"{100 * count / of:.0f} % ({100 * low:.0f} to {100 * high:.0f})"
