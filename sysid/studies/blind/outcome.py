"""The outcome of a blind case: what the workflow reported, as plain numbers for a file."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

from mecanum_env.effects import CATALOGUE
from sysid.studies.blind.cases import Case

if TYPE_CHECKING:
    from sysid.gap.result import GapReport

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
        key in seen and _is_nearer(value, seen[key], _neutral(name, key, report))
        for key, value in true.items()
    )


def _neutral(name: str, parameter: str, report: GapReport) -> float:
    known = {p.name: p for p in CATALOGUE[name].parameters}
    return float(report.base.effects.get(name, {}).get(parameter, known[parameter].neutral_in(report.base)))


def _is_nearer(value: float, other: float, neutral: float) -> bool:
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
