"""The confusion table and the figures, for the terminal and for the documentation."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from importlib.metadata import version

import numpy as np

from sysid.blind.outcome import Outcome
from sysid.blind.score import Figure, figures

_HEAD = ("figure", "value (95 % interval)", "cases", "target")


def summary_text(outcomes: Sequence[Outcome]) -> str:
    """Return the confusion table and the figures of outcomes as text."""
    rows = [_HEAD, *(figure.text() for figure in figures(outcomes))]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    confused = [
        f"{level:5} {kind:10} {size:5} {hidden:44} {' ; '.join(said)}"
        for (level, kind, size, hidden), said in _confusion(outcomes)
    ]
    return "\n".join([*confused, "", *lines, "", _time(outcomes)])


def summary_markdown(outcomes: Sequence[Outcome], command: str, date: str) -> str:
    """Return the same as a page of the documentation.

    Args:
        outcomes: of the cases.
        command: that ran them.
        date: of the run.
    """
    parts = [
        "# Results of the blind tests",
        f"Written by `{command}` on {date} with version {version('mecanum-tankendo')}; do not edit.",
        _table([_HEAD, *(figure.text() for figure in figures(outcomes))]),
        "In brackets 95 % Wilson intervals. Found: named as it is, or among the candidates of an `ambiguous` "
        "verdict. Closure: (before - after)/(before - noise floor) on test runs, 0 where nothing was named.",
        _time(outcomes),
        "## What was hidden, and what was said",
        _table(
            [
                ("level", "kind", "size", "hidden", "said (times)"),
                *((*key, "; ".join(said)) for key, said in _confusion(outcomes)),
            ]
        ),
    ]
    return "\n\n".join(parts) + "\n"


def missed(outcomes: Sequence[Outcome]) -> list[Figure]:
    """Return the figures of outcomes whose target was missed."""
    return [figure for figure in figures(outcomes) if figure.reached is False]


def _confusion(
    outcomes: Sequence[Outcome],
) -> list[tuple[tuple[str, str, str, str], list[str]]]:
    """Return (level, kind, size, hidden) with what was said and how often, in the order of the cases."""
    said: dict[tuple[str, str, str, str], Counter[str]] = {}
    for o in outcomes:
        hidden = " + ".join(o.case.hidden) or "nothing"
        key = (o.case.level, o.case.kind, o.case.size, hidden)
        said.setdefault(key, Counter())[o.label] += 1
    return [(key, [f"{label} ({n})" for label, n in counts.most_common()]) for key, counts in said.items()]


def _time(outcomes: Sequence[Outcome]) -> str:
    parts = []
    for level in ("bench", "robot"):
        seconds = [o.seconds for o in outcomes if o.case.level == level]
        if seconds:
            parts.append(
                f"{len(seconds)} {level} cases, {np.median(seconds):.1f} s each in the median, "
                f"{max(seconds):.1f} s at most"
            )
    return "; ".join(parts) + "."


def _table(rows: Sequence[Sequence[str]]) -> str:
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return "\n".join([lines[0], "|" + "---|" * len(rows[0]), *lines[1:]])
