"""The tables of a run: words by what was hidden and where, false alarms, coverage of intervals."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from mecanum_env.statistics import wilson_interval
from sysid.studies import score
from sysid.studies.score import FOUND, NAMED_KINDS, SIZES, VISIBLE, WORDS, size_of
from sysid.studies.zoo.outcome import Outcome

Keys = Callable[[Outcome], Iterable[str]]
"""The rows of a table in which an outcome counts."""


@dataclass(frozen=True)
class Share:
    """A share of cases with its 95 % Wilson interval; all NaN without a case."""

    hits: int
    count: int
    value: float
    low: float
    high: float

    def text(self) -> str:
        """Return the share, its interval and its counts in words."""
        if not self.count:
            return "-"
        ends = f"{100 * self.low:.0f} to {100 * self.high:.0f}"
        return f"{100 * self.value:.1f} % ({ends}), {self.hits} of {self.count}"


def share(hits: Iterable[bool]) -> Share:
    """Return the share of `hits` that are true."""
    got = [bool(hit) for hit in hits]
    value = sum(got) / len(got) if got else math.nan
    return Share(sum(got), len(got), value, *wilson_interval(sum(got), len(got)))


@dataclass(frozen=True)
class Table:
    """A table with its title and what its columns mean."""

    title: str
    note: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def signal_of(outcome: Outcome) -> float:
    """Return the signal of a case's change; of several effects, the smallest that one has alone, if known."""
    return score.signal_of(outcome.case.signal, [hidden.signal for hidden in outcome.case.hidden])


def is_visible(outcome: Outcome) -> bool:
    """Return whether a case's change is clear or gross."""
    return size_of(signal_of(outcome)) in VISIBLE


def is_found(outcome: Outcome) -> bool:
    """Return whether a case is right or rightly ambiguous."""
    return outcome.word in FOUND


def of_kind(outcomes: Iterable[Outcome], *kinds: str, level: str | None = None) -> list[Outcome]:
    """Return the outcomes of cases of some kinds, of one level or of both."""
    return [o for o in outcomes if o.case.kind in kinds and level in (None, o.case.level)]


def word_table(title: str, note: str, outcomes: Sequence[Outcome], label: str, keys: Keys) -> Table:
    """Return how many cases have each word, one row per key, in alphabetical order.

    Args:
        title: of the table.
        note: what the rows are.
        outcomes: of which `keys` gives the rows.
        label: head of the first column.
        keys: rows in which an outcome counts.
    """
    groups: dict[str, list[Outcome]] = {}
    for outcome in outcomes:
        for key in keys(outcome):
            groups.setdefault(key, []).append(outcome)
    used = [word for word in WORDS if any(outcome.word == word for outcome in outcomes)]
    rows = []
    for key, group in sorted(groups.items()):
        words = Counter(o.word for o in group)
        visible = share(is_found(o) for o in of_kind(group, *NAMED_KINDS) if is_visible(o))
        rows.append((key, str(len(group)), *(str(words[word] or "") for word in used), visible.text()))
    head = (label, "cases", *used, "found where clear or gross")
    return Table(title, note, head, tuple(rows))


def word_tables(outcomes: Sequence[Outcome]) -> tuple[Table, ...]:
    """Return how many outcomes have each word, by kind, size, name and form, family, layout and plan."""
    singles = of_kind(outcomes, "single", "twin")
    hidden = of_kind(outcomes, *NAMED_KINDS)

    def level(keys: Keys) -> Keys:
        return lambda outcome: (f"{outcome.case.level}: {key}" for key in keys(outcome))

    return (
        word_table("By kind", "", outcomes, "kind", level(lambda o: (o.case.kind,))),
        word_table(
            "By size",
            "Singles, twins, pairs and triples.",
            hidden,
            "size",
            level(lambda o: (f"{list(SIZES).index(size_of(signal_of(o))) + 1} {size_of(signal_of(o))}",)),
        ),
        word_table(
            "By name and form",
            "Singles and twins.",
            singles,
            "name, form",
            level(lambda o: (f"{h.name}, {h.form}" for h in o.case.hidden)),
        ),
        word_table(
            "By name in pairs and triples",
            "A case counts once for each of its names.",
            of_kind(outcomes, "pair", "triple"),
            "name",
            level(lambda o: sorted(o.hidden)),
        ),
        word_table(
            "Changes without a name",
            "",
            of_kind(outcomes, "near_outsider", "far_outsider"),
            "what was changed",
            level(lambda o: (f"{o.case.kind.removesuffix('_outsider')}: {o.case.outsider}",)),
        ),
        *(
            word_table(f"By {label}", "All kinds.", outcomes, label, level(keys))
            for label, keys in _PLACES.items()
        ),
    )


_PLACES: Final[Mapping[str, Keys]] = {
    "family": lambda o: (o.case.family,),
    "layout": lambda o: (o.case.layout,),
    "plan": lambda o: (o.case.plan,),
}


def false_alarm_table(outcomes: Sequence[Outcome]) -> Table:
    """Return the false alarms of the quiet cases by command plan, layout and family."""
    quiet = of_kind(outcomes, "quiet")
    rows = []
    for label, keys in _PLACES.items():
        found: dict[str, list[Outcome]] = {}
        for outcome in quiet:
            for key in keys(outcome):
                found.setdefault(f"{outcome.case.level}: {key}", []).append(outcome)
        for key, group in sorted(found.items()):
            alarms = [o for o in group if o.word == "false alarm"]
            said = Counter(_said(o) for o in alarms)
            words = "; ".join(f"{text} ({count})" for text, count in said.most_common())
            rows.append((label, key, share(o in alarms for o in group).text(), words))
    note = "Quiet cases; in the last column what was said instead of no gap."
    return Table("False alarms", note, ("by", "", "false alarms", "said"), tuple(rows))


def _said(outcome: Outcome) -> str:
    sets = sorted(" + ".join(sorted(claim)) for claim in outcome.claims)
    return f"{outcome.verdict}: {' | '.join(sets)}" if sets else outcome.verdict


def coverage_table(outcomes: Sequence[Outcome]) -> Table:
    """Return how many 90 % intervals hold the truth, by name and parameter."""
    held: dict[tuple[str, str], list[bool]] = {}
    for outcome in outcomes:
        for effect, parameter, inside in outcome.covered():
            held.setdefault((effect, parameter), []).append(inside)
    rows = tuple((effect, key, share(inside).text()) for (effect, key), inside in sorted(held.items()))
    note = "90 % intervals of the adopted effects that hold the truth, where just the hidden set was adopted."
    return Table("Coverage of intervals", note, ("name", "parameter", "intervals with the truth"), rows)
