"""What became of ambiguous cases once the experiments that their studies asked for were driven.

A tie of names that no log can tell apart is no failure of an experiment: such a case ends well where only the
hidden names and their twins are left, and one that begins there has nothing to settle.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any, Final, Literal

from sysid.studies.zoo.cases.case import Case
from sysid.studies.zoo.outcome import Outcome, from_json, to_json

BUDGET_S: Final = 60.0
"""Driving that may be asked of a user, repeats counted [s]."""

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
    reach: float
    """Largest wheel command over the largest one of the logs before: beyond 1 nobody has tried the drive."""
    kept: float
    """Share of the asked changes of command that the log of the first repeat has: a slow link sends fewer."""


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
        return self.outcome.word in ("right", "quiet") or only_twins(self.case, self.outcome.claims)

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
    """Return the settled case of an entry that `settled_json` made."""
    rounds = tuple(Round(**{**one, "candidates": _sets(one["candidates"])}) for one in entry["rounds"])
    outcome = from_json(entry["outcome"])
    return Settled(_sets(entry["first"]), rounds, outcome, entry["offered"], entry["why_not"])


def _sets(entry: Sequence[Sequence[str]]) -> tuple[Names, ...]:
    return tuple(tuple(names) for names in entry)
