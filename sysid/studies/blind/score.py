"""The metrics of a run of blind tests with their targets, and the confusion table, as text and Markdown."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np

from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import wilson_interval
from sysid.studies.blind.outcome import Outcome


@dataclass(frozen=True)
class Metric:
    """A share of cases, or a median, beside its target."""

    name: str
    value: float
    """NaN without a case that counts."""
    low: float
    high: float
    """Ends of the 95 % Wilson interval of a share; NaN for a median."""
    count: int
    target: str
    reached: bool | None
    """None without a target or a case that counts."""

    def text(self) -> tuple[str, str, str, str]:
        """Return name, value with interval, number of cases and target with verdict."""
        verdict = {None: "-", True: "reached", False: "MISSED"}[self.reached]
        if math.isnan(self.value):
            said = "-"
        elif math.isnan(self.low):
            said = f"{self.value:.3f}"
        else:
            said = f"{100 * self.value:.1f} % ({100 * self.low:.1f} to {100 * self.high:.1f})"
        return self.name, said, str(self.count), f"{self.target}: {verdict}"


def metrics(outcomes: Sequence[Outcome]) -> list[Metric]:
    """Return all metrics of the outcomes of a run, those with a target first."""

    def of(*kinds: str, size: str | None = None, level: str | None = None) -> list[Outcome]:
        return [
            o
            for o in outcomes
            if o.case.kind in kinds
            and (size is None or o.case.size == size)
            and (level is None or o.case.level == level)
        ]

    def found(outcome: Outcome) -> bool:
        return outcome.found

    def named(outcome: Outcome) -> bool:
        return outcome.verdict in ("named", "ambiguous")

    inside = [held for o in of("single", "twin", "pair") for held in o.covered()]
    shares = [
        _share("clear singles found", map(found, of("single", "twin", size="clear")), 0.95, 1.0),
        _share("pairs found", map(found, of("pair")), 0.85, 1.0),
        _share("false alarms", (o.verdict != "no_gap" for o in of("none")), 0.0, 0.05),
        _share("names for what no effect is", map(named, of("outside")), 0.0, 0.02),
        _share("twins named alone", (o.verdict == "named" for o in of("twin")), 0.0, 0.0),
        _share("90 % intervals that hold the truth", inside, 0.85, 0.95),
        _median("median closure, bench", of("single", "twin", "pair", level="bench"), 0.95),
        _median("median closure, robot", of("single", "twin", "pair", level="robot"), 0.90),
    ]
    others = [
        _share("small singles found", map(found, of("single", "twin", size="small")), None, None),
        _share(
            "small singles with a wrong name",
            (named(o) and not o.found for o in of("single", "twin", size="small")),
            None,
            None,
        ),
        _share("gaps of outside effects seen", (o.verdict != "no_gap" for o in of("outside")), None, None),
        _share("untestable: no gap", (o.verdict == "no_gap" for o in of("untestable")), None, None),
        _share(
            "untestable: said so",
            (o.said_untestable for o in of("untestable")),
            None,
            None,
        ),
        _share("errors", (o.verdict == "error" for o in outcomes), 0.0, 0.0),
    ]
    return [*shares, *others]


def _share(name: str, hits: Iterable[bool], low: float | None, high: float | None) -> Metric:
    got = [bool(hit) for hit in hits]
    count = len(got)
    value = sum(got) / count if count else math.nan
    bounds = wilson_interval(sum(got), count)
    if low is None or high is None:
        return Metric(name, value, *bounds, count, "no target", None)
    target = (
        f"{100 * low:g} to {100 * high:g} %"
        if low > 0.0 and high < 1.0
        else f">= {100 * low:g} %"
        if low > 0.0
        else f"<= {100 * high:g} %"
    )
    return Metric(name, value, *bounds, count, target, low <= value <= high if count else None)


def _median(name: str, outcomes: Sequence[Outcome], least: float) -> Metric:
    closures = [o.closure for o in outcomes if math.isfinite(o.closure)]
    value = float(np.median(closures)) if closures else math.nan
    reached = value >= least if closures else None
    return Metric(name, value, math.nan, math.nan, len(closures), f">= {least:g}", reached)


_HEAD = ("metric", "value (95 % interval)", "cases", "target")


def summary_text(outcomes: Sequence[Outcome]) -> str:
    """Return the confusion table and the metrics of outcomes as text."""
    rows = [_HEAD, *(metric.text() for metric in metrics(outcomes))]
    widths = [max(len(row[i]) for row in rows) for i in range(len(_HEAD))]
    lines = ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)) for row in rows]
    confused = [
        f"{level:5} {kind:10} {size:5} {hidden:44} {' ; '.join(said)}"
        for (level, kind, size, hidden), said in _confusion(outcomes)
    ]
    return "\n".join([*confused, "", *lines, "", _time(outcomes)])


def summary_markdown(outcomes: Sequence[Outcome], command: str, date: str) -> str:
    """Return the confusion table and the metrics of a command of a date as a page of the documentation."""
    parts = [
        "# Results of the blind tests",
        f"Written by `{command}` on {date} with version {version('mecanum-tankendo')}; do not edit.",
        markdown_table(_HEAD, [metric.text() for metric in metrics(outcomes)]),
        "In brackets 95 % Wilson intervals. Found: named as it is, or among the candidates of an `ambiguous` "
        "verdict. Closure: (before - after)/(before - noise floor) on test runs, 0 where nothing was named.",
        _time(outcomes),
        "## What was hidden, and what was said",
        markdown_table(
            ("level", "kind", "size", "hidden", "said (times)"),
            [(*key, "; ".join(said)) for key, said in _confusion(outcomes)],
        ),
    ]
    return "\n\n".join(parts) + "\n"


def _confusion(
    outcomes: Sequence[Outcome],
) -> list[tuple[tuple[str, str, str, str], list[str]]]:
    """Return (level, kind, size, hidden) with each verdict and its count, in the order of the cases."""
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
