"""The outcomes of blind cases as plain numbers; their metrics, with targets, and the confusion table."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from importlib.metadata import version
from typing import Any

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.markdown import markdown_table
from mecanum_env.statistics import wilson_interval
from sysid.gap.result import GapReport
from sysid.studies.blind.cases import Case

Bounds = tuple[float, float, float]
"""Value, lower and upper end of the 90 % interval."""


@dataclass(frozen=True)
class Outcome:
    """One case and what the workflow found."""

    case: Case
    verdict: str
    """As in gap.json, or "error"."""
    named: tuple[str, ...] = ()
    candidates: tuple[tuple[str, ...], ...] = ()
    parameters: Mapping[str, Mapping[str, Bounds]] = field(default_factory=dict)
    """Effect -> parameter -> estimate, for the adopted effects."""
    before: float = math.nan
    after: float = math.nan
    floor: float = math.nan
    said_untestable: bool = False
    """Whether the report says that these logs cannot show the hidden effects, or not at their true sizes."""
    seconds: float = 0.0
    message: str = ""
    """The error message, where the workflow raised one."""

    @property
    def found(self) -> bool:
        """Whether the hidden effects were named, or are among the candidates of an ambiguous verdict."""
        hidden = set(self.case.hidden)
        if self.verdict == "named":
            return set(self.named) == hidden
        return self.verdict == "ambiguous" and any(set(names) == hidden for names in self.candidates)

    @property
    def closure(self) -> float:
        """(before - after) / (before - floor) on test runs; NaN where there was no gap."""
        if not self.before > self.floor:
            return math.nan
        return (self.before - self.after) / (self.before - self.floor)

    @property
    def label(self) -> str:
        """The column of the confusion table."""
        names = (
            [" + ".join(sorted(self.named))]
            if self.verdict == "named"
            else sorted(" + ".join(sorted(names)) for names in self.candidates)
            if self.verdict == "ambiguous"
            else []
        )
        return f"{self.verdict}: {' | '.join(names)}" if names else self.verdict

    def covered(self) -> tuple[bool, ...]:
        """Return, for each parameter of rightly adopted effects, whether its interval contains the truth."""
        if not self.found:
            return ()
        held = []
        for name, truths in self.case.truth.items():
            for parameter, truth in truths.items():
                bounds = self.parameters.get(name, {}).get(parameter)
                if bounds is not None:
                    held.append(bounds[1] <= truth <= bounds[2])
        return tuple(held)


def outcome_of(case: Case, report: GapReport, seconds: float) -> Outcome:
    """Return the outcome of a case from its report and the seconds that the study took."""
    floor = report.gap.noise_floor
    return Outcome(
        case=case,
        verdict=report.verdict,
        named=tuple(effect.name for effect in report.effects),
        candidates=report.candidates,
        parameters={
            effect.name: {key: (p.value, p.low, p.high) for key, p in effect.parameters.items()}
            for effect in report.effects
        },
        before=report.gap.before,
        after=report.gap.after,
        floor=math.nan if floor is None else floor,
        said_untestable=bool(case.hidden) and all(_out_of_sight(name, case, report) for name in case.hidden),
        seconds=seconds,
    )


def _out_of_sight(name: str, case: Case, report: GapReport) -> bool:
    """Return whether a report calls an effect untestable, or detectable only above its true size."""
    if any(entry.name == name for entry in report.untestable):
        return True
    seen = report.smallest_detectable.get(name, {})
    true = case.truth.get(name, {})
    return bool(true) and all(
        key in seen and _is_smaller(value, seen[key], _neutral(name, key, report))
        for key, value in true.items()
    )


def _neutral(name: str, parameter: str, report: GapReport) -> float:
    known = {p.name: p for p in CATALOGUE[name].parameters}
    return float(report.base.effects.get(name, {}).get(parameter, known[parameter].neutral_in(report.base)))


def _is_smaller(value: float, other: float, neutral: float) -> bool:
    """Return whether a value lies between neutral, which may be infinite, and another value."""
    return other < value < neutral or neutral < value < other


def to_json(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome as JSON objects; infinite and missing numbers become text."""
    made: dict[str, Any] = _plain(asdict(outcome))
    return made


def from_json(entry: Mapping[str, Any]) -> Outcome:
    """Return the outcome of an entry that `to_json` made."""
    case = dict(entry["case"])
    case["hidden"], case["twins"] = tuple(case["hidden"]), tuple(case["twins"])
    case["truth"] = {n: {k: float(v) for k, v in p.items()} for n, p in case["truth"].items()}
    numbers = {key: float(entry[key]) for key in ("before", "after", "floor", "seconds")}
    return Outcome(
        case=Case(**case),
        verdict=entry["verdict"],
        named=tuple(entry["named"]),
        candidates=tuple(tuple(names) for names in entry["candidates"]),
        parameters={
            name: {key: (float(b[0]), float(b[1]), float(b[2])) for key, b in values.items()}
            for name, values in entry["parameters"].items()
        },
        said_untestable=entry["said_untestable"],
        message=entry["message"],
        **numbers,
    )


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


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

    def named(outcome: Outcome) -> bool:
        return outcome.verdict in ("named", "ambiguous")

    inside = [held for o in of("single", "twin", "pair") for held in o.covered()]
    shares = [
        _share("clear singles found", (o.found for o in of("single", "twin", size="clear")), 0.95, 1.0),
        _share("pairs found", (o.found for o in of("pair")), 0.85, 1.0),
        _share("false alarms", (o.verdict != "no_gap" for o in of("none")), 0.0, 0.05),
        _share("names for what no effect is", map(named, of("outside")), 0.0, 0.02),
        _share("twins named alone", (o.verdict == "named" for o in of("twin")), 0.0, 0.0),
        _share("90 % intervals that hold the truth", inside, 0.85, 0.95),
        _median("median closure, bench", of("single", "twin", "pair", level="bench"), 0.95),
        _median("median closure, robot", of("single", "twin", "pair", level="robot"), 0.90),
    ]
    others = [
        _share("small singles found", (o.found for o in of("single", "twin", size="small"))),
        _share(
            "small singles with a wrong name",
            (named(o) and not o.found for o in of("single", "twin", size="small")),
        ),
        _share("gaps of outside effects seen", (o.verdict != "no_gap" for o in of("outside"))),
        _share("untestable: no gap", (o.verdict == "no_gap" for o in of("untestable"))),
        _share("untestable: said so", (o.said_untestable for o in of("untestable"))),
        _share("errors", (o.verdict == "error" for o in outcomes), 0.0, 0.0),
    ]
    return [*shares, *others]


def _share(name: str, hits: Iterable[bool], low: float | None = None, high: float | None = None) -> Metric:
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


def _confusion(outcomes: Sequence[Outcome]) -> list[tuple[tuple[str, str, str, str], list[str]]]:
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
