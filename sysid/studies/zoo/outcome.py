"""What a study said of a case, as plain numbers that are saved, and the word for it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Final

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import effect_named
from sysid.gap.result import Difference, Evidence, FoundEffect, GapReport, Interval
from sysid.studies import score
from sysid.studies.zoo.cases.case import Case, Hidden

Bounds = tuple[float, float, float]
"""Value, lower and upper end of the 90 % interval."""
Errors = tuple[float, float, float]
"""Rms error before and after, and that of a perfect model."""
ERROR: Final = "error"
"""The verdict of a case whose fit or study raised an exception."""


@dataclass(frozen=True)
class Outcome:
    """One case and what the workflow found."""

    case: Case
    verdict: str
    """As in gap.json, or "error"."""
    named: tuple[str, ...] = ()
    """Effects that were added to the model as what changed since its fit."""
    candidates: tuple[tuple[str, ...], ...] = ()
    """Sets that explain the logs equally well, the adopted one first."""
    parameters: Mapping[str, Mapping[str, Bounds]] = field(default_factory=dict)
    """Effect -> parameter -> estimate, for the adopted effects."""
    before: float = math.nan
    """Rms error on test runs of the fitted model [rpm on the bench; standard deviations of the noise]."""
    after: float = math.nan
    """The same with the effects added."""
    floor: float = math.nan
    """The same for a perfect model: the noise of repeats; NaN without repeats."""
    beside_fit: Errors | None = None
    """The three errors without what the model errs by in the logs of its fit; None if that is not known."""
    p_value: float = math.nan
    """Probability of a difference at least this large if the fitted model were right."""
    misfit: float = math.nan
    """Squared error of the fitted model on the deciding runs, relative to its expectation; 1 is ideal."""
    best: tuple[str, ...] = ()
    """Set of effects with the best score, adopted or not."""
    best_misfit: float = math.nan
    """Squared error with that set, relative to the same expectation."""
    trusted: bool = True
    """Whether the study knew what a right model would leave."""
    said_untestable: bool = False
    """Whether the report says that these logs cannot show the hidden effects, or not at their true sizes."""
    notes: tuple[str, ...] = ()
    """Of the report."""
    fit_s: float = 0.0
    """Time of the fit of the nominal logs [s]."""
    study_s: float = 0.0
    """Time of the study [s]."""
    message: str = ""
    """The error message, where one was raised."""

    @property
    def hidden(self) -> frozenset[str]:
        """Names of the hidden effects."""
        return frozenset(hidden.name for hidden in self.case.hidden)

    @property
    def claims(self) -> tuple[frozenset[str], ...]:
        """Every set of effects that the verdict offers as the explanation; empty if it offers none."""
        return score.claims_of(self.verdict, self.named, self.candidates)

    @property
    def word(self) -> str:
        """Right, rightly ambiguous, abstained, wrong or another of `sysid.studies.score.WORDS`."""
        return score.word_of(self.case.kind, self.hidden, self.verdict, self.claims, self.said_untestable)

    @property
    def closure(self) -> float:
        """(before - after) / (before - floor) on test runs; NaN where there was no gap, or no known floor."""
        return score.closure(self.before, self.after, self.floor)

    @property
    def closure_beside_fit(self) -> float:
        """The closure without what the model errs by in the logs of its fit; NaN if that is not known."""
        return math.nan if self.beside_fit is None else score.closure(*self.beside_fit)

    @property
    def noise_ratio(self) -> float:
        """Mean squared error of the fitted model on test runs, in noise variances; NaN without repeats."""
        return (self.before / self.floor) ** 2 if self.floor > 0.0 else math.nan

    def covered(self) -> tuple[tuple[str, str, bool], ...]:
        """Return (effect, parameter, whether its interval holds the truth) where the hidden set was adopted.

        Parameters of which the case states no truth, or the report no value, are left out.
        """
        return score.intervals_held(
            {hidden.name: hidden.parameters for hidden in self.case.hidden},
            self.named,
            {name: {key: b[1:] for key, b in values.items()} for name, values in self.parameters.items()},
        )


def outcome_of(case: Case, report: GapReport, fit_s: float, study_s: float) -> Outcome:
    """Return the outcome of a case from its report and the times [s] that fit and study took."""
    (before, after, floor), beside = _errors(report.gap), report.gap_beside_fit
    base = next((entry for entry in report.evidence if not entry.effects), None)
    best = _best(report)
    return Outcome(
        case=case,
        verdict=report.verdict,
        named=tuple(effect.cause for effect in report.new_effects),
        candidates=report.candidates,
        parameters={
            effect.cause: {key: (p.value, p.low, p.high) for key, p in _measured(effect).items()}
            for effect in report.effects
        },
        before=before,
        after=after,
        floor=floor,
        beside_fit=None if beside is None else _errors(beside),
        p_value=report.p_value,
        misfit=math.nan if base is None else base.misfit,
        best=() if best is None else best.effects,
        best_misfit=math.nan if best is None else best.misfit,
        trusted=report.trusted,
        said_untestable=bool(case.hidden) and all(_out_of_sight(hidden, report) for hidden in case.hidden),
        notes=report.notes,
        fit_s=fit_s,
        study_s=study_s,
    )


def _errors(gap: Difference) -> Errors:
    return gap.before, gap.after, math.nan if gap.noise_floor is None else gap.noise_floor


def _measured(effect: FoundEffect) -> dict[str, Interval]:
    """Return what a report says of an effect's size: its parameters, and the droop of a torque.

    A torque in N m is left out where nobody knows the servo's stiffness, to which alone it is measured.
    """
    return effect.estimates


def _best(report: GapReport) -> Evidence | None:
    """Return the evidence for the set with the best score; the law fitted again is no set."""
    return next((e for e in report.evidence if e.effects and e.effects != ("wheel_law",)), None)


def _out_of_sight(hidden: Hidden, report: GapReport) -> bool:
    """Return whether a report calls an effect untestable, or detectable only above its true size."""
    name = effect_named(hidden.name, hidden.form or None)
    if any(entry.name == name for entry in report.untestable):
        return True
    seen = report.smallest_detectable.get(name, {})
    return bool(hidden.parameters) and all(
        key in seen and score.is_smaller(value, seen[key], _neutral(name, key, report))
        for key, value in hidden.parameters.items()
    )


def _neutral(name: str, parameter: str, report: GapReport) -> float:
    known = {p.name: p for p in CATALOGUE[name].parameters}
    return float(report.base.effects.get(name, {}).get(parameter, known[parameter].neutral_in(report.base)))


def to_json(outcome: Outcome) -> dict[str, Any]:
    """Return an outcome as JSON objects; infinite and missing numbers become text."""
    made: dict[str, Any] = _plain(asdict(outcome))
    return made


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value


_NUMBERS: Final = ("before", "after", "floor", "p_value", "misfit", "best_misfit", "fit_s", "study_s")
_NAMES: Final = ("named", "best", "notes")


def from_json(entry: Mapping[str, Any]) -> Outcome:
    """Return the outcome of an entry that `to_json` made."""
    known = {
        **entry,
        **{key: float(entry[key]) for key in _NUMBERS},
        **{key: tuple(entry[key]) for key in _NAMES},
    }
    known["case"] = case_from_json(entry["case"])
    if (beside := entry["beside_fit"]) is not None:
        known["beside_fit"] = tuple(map(float, beside))
    known["candidates"] = tuple(map(tuple, entry["candidates"]))
    known["parameters"] = {
        name: {key: (float(b[0]), float(b[1]), float(b[2])) for key, b in values.items()}
        for name, values in entry["parameters"].items()
    }
    return Outcome(**known)


def case_from_json(entry: Mapping[str, Any]) -> Case:
    """Return the case of an entry of an outcome's file."""
    hidden = tuple(
        Hidden(h["name"], h["form"], {k: float(v) for k, v in h["parameters"].items()}, float(h["signal"]))
        for h in entry["hidden"]
    )
    known = {**entry, "hidden": hidden, "twins": tuple(entry["twins"]), "signal": float(entry["signal"])}
    return Case(**known)
