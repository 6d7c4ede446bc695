"""A link that jitters or loses commands, in a study of bench logs: found, or stated by the model.

A simulation draws other delays than the log has, so the search of effects cannot try it.

If the model says that its link does so, the delay of each change of the command is estimated, the changes are
moved to where they acted (`sysid.compare.links.AlignedLogs`), and the study compares what is left. The common
delay of the logs is kept, so that another one than the model's is found as an effect. `as_given` then writes
the report for the logs as they were.

If the model does not say so, `with_link_fault` looks for such a link after the search of effects. The delay
of each change is estimated under the model and beside the best set of effects (`sysid.compare.links.faults`).
A set that is not named counts as well, unless it leaves the logs unexplained: it may be too close to the
model's own error for a name, and yet all that there is, and an effect that the prediction lacks looks like
delays of single changes.
Where both say that the delays differ, or that commands are lost, by far more than stamps and the logs of the
fit explain, the changes are moved to where they acted, what is left is studied again, and the fault is named
beside it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import chi2

from mecanum_env.model import Model, cause_of, model_sha256
from sysid.compare.links import (
    JITTER,
    LOSS,
    AlignedLogs,
    LinkClock,
    LinkDelays,
    LinkFault,
    LinkState,
    known_state,
    link_delays,
    link_fault,
)
from sysid.compare.model_error import covariance_of, with_adopted, without_known_error
from sysid.compare.predicted import predict
from sysid.gap.result import Difference, FoundEffect, GapOptions, GapReport, Interval, Region, Since
from sysid.gap.search.known_effects import is_meant
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import Dataset

Analyse = Callable[[Dataset, Model, GapOptions], GapReport]
"""A study as `sysid.gap.workflow` makes it."""
_LEAST_REMOVED: Final = 0.5
"""Share of the squared error above noise that moving the changes must remove: friction near rest delays
small changes, too, and moving them removes a part of that. Set on drawn drives (bench seeds below 340), where
the one quiet log in which a jitter had else been named lost 19 %."""
_SURPLUS: Final = float(chi2.isf(2.0 * THRESHOLDS.false_alarm, 1))
"""Twice the logarithm of a likelihood ratio that a link which loses as much as before exceeds in a false
alarm (Wilks, Ann. Math. Stat. 9:60, 1938), one half of them since it may also have lost less."""
_NAMES: Final = {"jitter": JITTER, "loss": LOSS}


@dataclass(frozen=True, eq=False)
class _Found:
    """A fault and the logs without it."""

    fault: LinkFault
    logs: AlignedLogs
    fitted_on: Dataset | None
    is_enough: bool
    """Whether the fault leaves noise, or little beside what it explains."""


def as_given(report: GapReport, logs: AlignedLogs) -> GapReport:
    """Return the report on aligned logs as that on the logs and the model as they were given."""
    note = f"{logs.note} (model: {logs.said}); compared is what is left with the time of each change as found"
    return replace(
        report,
        model=logs.as_stated(report.model),
        base=logs.given,
        notes=(note, *report.notes),
        provenance={**report.provenance, "model_sha256": model_sha256(logs.given)},
    )


def with_link_fault(
    dataset: Dataset,
    model: Model,
    options: GapOptions,
    report: GapReport,
    best: Model,
    analyse: Analyse,
) -> GapReport:
    """Return the report with the link's fault, if the logs show one; else as it is.

    The report is that of a study of the logs under the `model` with these options, by the function `analyse`.
    `best` is the model with the best set of effects, named or not; the model itself if there is none.
    """
    if dataset.level != "bench" or not _is_asked(options):
        return report
    found = _found(dataset, model, options, report, best)
    if found is None:
        return report
    rest = analyse(found.logs.dataset, found.logs.model, replace(options, fitted_on=found.fitted_on))
    return _merged(found, options, report, rest)


def _is_asked(options: GapOptions) -> bool:
    both = tuple(_NAMES.values())
    asked = not options.only or any(is_meant(name, options.only) for name in both)
    return asked and not any(is_meant(name, options.exclude) for name in both)


def _found(
    dataset: Dataset, model: Model, options: GapOptions, report: GapReport, best: Model
) -> _Found | None:
    moved = _moved(dataset, model, options)
    if moved is None:
        return None
    fault, seen = moved.fault, moved.seen
    before_squares, after_squares = _squares(seen, model), moved.squares
    noise = (report.gap.noise_floor or 0.0) ** 2
    removed, left = before_squares - after_squares, max(0.0, after_squares - noise)
    if removed <= _LEAST_REMOVED * max(before_squares - noise, 0.0):
        return None
    if best is not model:
        best_squares = _squares(seen, best)
        if report.verdict in ("named", "ambiguous") and best_squares < after_squares:
            # A slow answer looks like a late one: effects that leave less need no fault beside them.
            return None
        if best_squares - after_squares <= _LEAST_REMOVED * best_squares:
            # Neither leaves far less than the other: then the changes must be late beside the effects, too.
            beside = moved.fault_of(best, options.seed)
            if beside is None or beside.kind != fault.kind:
                return None
    logs = AlignedLogs.of(dataset, model, moved.clock, moved.delays)
    fitted_on = options.fitted_on
    if fitted_on is not None:
        fitted_on = logs.beside(fitted_on, moved.before)
    return _Found(fault, logs, fitted_on, left <= THRESHOLDS.adequate_residual**2 * removed)


@dataclass(frozen=True, eq=False)
class _Moved:
    """A fault that the delays of single changes show, and what moving the changes leaves."""

    seen: Dataset
    """The logs in which the delays were found."""
    clock: LinkClock
    before: LinkDelays | None
    """Delays of the logs of the fit, if these are known."""
    known: LinkState
    fault: LinkFault
    delays: LinkDelays
    squares: float
    """Mean squared error with the changes where they acted."""

    @classmethod
    def of(
        cls, seen: Dataset, of_fit: Dataset | None, model: Model, clock: LinkClock, seed: int
    ) -> _Moved | None:
        """Return the fault that the delays in some logs show beyond those of the fit's; None without."""
        before = None if of_fit is None else link_delays(model, of_fit.runs, clock)
        known = known_state(before, float(np.median([run.median_interval_s for run in seen.runs])))
        found = link_delays(model, seen.runs, clock)
        fault = link_fault(found, known, THRESHOLDS.interval_level, np.random.default_rng(seed))
        if fault is None:
            return None
        delays = fault.delays(found)
        if fault.kind == "jitter":
            # Its mean belongs to it; beside a loss another delay is for the study to find.
            delays = replace(delays, mean_s=clock.delay_s)
        logs = AlignedLogs.of(seen, model, clock, delays)
        return cls(seen, clock, before, known, fault, delays, _squares(logs.dataset, logs.model))

    def fault_of(self, model: Model, seed: int) -> LinkFault | None:
        """Return the fault that the logs show under another model."""
        found = link_delays(model, self.seen.runs, self.clock)
        return link_fault(found, self.known, THRESHOLDS.interval_level, np.random.default_rng(seed))


def _moved(dataset: Dataset, model: Model, options: GapOptions) -> _Moved | None:
    """Return the fault that some logs show as they are, or less what the model errs by in the same commands.

    The model's own error may hide a fault. But it comes with the changes, so that it is taken off at the
    wrong time where these are late: what leaves less is taken.
    """
    clock, of_fit = LinkClock.of(model), options.fitted_on
    views: list[tuple[Dataset, Dataset | None]] = [(dataset, of_fit)]
    if of_fit is not None and of_fit.level == "bench":
        less = _less_own_error(model, dataset, of_fit)
        # In other commands the error stays; beside logs of the fit without theirs it would pass for a jitter.
        if all(run is not before for run, before in zip(less.runs, dataset.runs, strict=True)):
            views.append((less, _less_own_error(model, of_fit, of_fit)))
    found = [_Moved.of(seen, fit, model, clock, options.seed) for seen, fit in views]
    return min((one for one in found if one is not None), key=lambda one: one.squares, default=None)


def _less_own_error(model: Model, dataset: Dataset, of_fit: Dataset) -> Dataset:
    """Return the logs less what the model errs by in the same commands of the logs of its fit."""
    return replace(dataset, runs=without_known_error(model, dataset.runs, of_fit.runs))


def _squares(dataset: Dataset, model: Model) -> float:
    """Return the mean squared error of a model on the runs that decide."""
    runs = [run for run in dataset.runs if run.split != "test"] or list(dataset.runs)
    errors = [run.channels["speed_rpm"] - predict(model, run)["speed_rpm"] for run in runs]
    return float(np.nanmean(np.concatenate(errors) ** 2))


def _merged(found: _Found, options: GapOptions, report: GapReport, rest: GapReport) -> GapReport:
    """Return the report of the logs as they are, from that of the `rest` that the fault leaves."""
    fault, name = found.fault, _NAMES[found.fault.kind]
    note = _note(fault)
    if rest.verdict == "unexplained" and report.verdict != "no_gap" and not found.is_enough:
        return replace(report, notes=(*report.notes, note))
    size = "jitter_s" if fault.kind == "jitter" else "share"
    parameters = {size: Interval(*fault.size)}
    if fault.kind == "jitter":
        parameters = {"delay_s": Interval(*fault.delay_s)} | parameters
    since: Since = "unknown" if options.fitted_on is None or fault.surplus < _SURPLUS else "new"
    if options.fitted_on is not None and since != "new" and rest.verdict == "no_gap":
        return _without_name(found, report, rest)
    effect = FoundEffect(name, parameters, fault.frequency, since=since)
    cause, sets = cause_of(name), rest.candidates or ((),)
    causes = (cause, cause_of(_NAMES[fault.rival])) if fault.rival else (cause,)
    candidates = [(one, *(c for c in names if c != one)) for one in causes for names in sets]
    return replace(
        rest,
        verdict="ambiguous" if rest.verdict == "ambiguous" or fault.rival else "named",
        effects=(effect, *(one for one in rest.effects if one.cause != cause)),
        candidates=tuple(dict.fromkeys(candidates)),
        gap=_whole(report.gap, rest.gap),
        gap_beside_fit=_whole_beside(report.gap_beside_fit, rest.gap_beside_fit),
        channels={key: _whole(one, rest.channels[key]) for key, one in report.channels.items()},
        where=_places(report, rest),
        evidence=report.evidence,
        p_value=min(report.p_value, math.exp(-0.5 * fault.evidence)),
        model=_model(found, rest.model, effect),
        base=found.logs.given,
        notes=(note, *rest.notes),
        provenance=report.provenance,
    )


def _without_name(found: _Found, report: GapReport, rest: GapReport) -> GapReport:
    """Return the report of the logs as they are, beside a fault that the logs of the fit may have, too.

    It is told and not named: a study beside these logs asks what they do not show. The fault leaves the
    `rest`, which is no gap.
    """
    beside = report.gap_beside_fit
    return replace(
        rest,
        gap=replace(report.gap, after=report.gap.before),
        gap_beside_fit=None if beside is None else replace(beside, after=beside.before),
        channels={key: replace(one, after=one.before) for key, one in report.channels.items()},
        where=tuple(replace(place, rms_after=place.rms) for place in report.where),
        model=found.logs.given,
        base=found.logs.given,
        notes=(_note(found.fault), *rest.notes),
        provenance=report.provenance,
    )


def _model(found: _Found, rest: Model, effect: FoundEffect) -> Model:
    """Return the model of the `rest` with the fault, for the logs as they are."""
    fault = found.fault
    if fault.kind == "loss":
        improved = found.logs.through_link(rest, share=fault.size[0])
    else:
        improved = found.logs.through_link(rest, jitter_s=fault.size[0], delay_s=fault.delay_s[0])
    known = rest.uncertainty.get("effects") or {}
    stated = {**rest.uncertainty, "effects": {**known, effect.name: effect.intervals}}
    improved = replace(improved, uncertainty=stated)
    ends = {f"{effect.name}.{key}": (one.low, one.high) for key, one in effect.parameters.items()}
    names, covariance = covariance_of(ends, [], np.zeros((0, 0)), THRESHOLDS.interval_level)
    new = [effect.name] if effect.since == "new" else []
    return with_adopted(improved, names, covariance, [effect.name], new)


def _note(fault: LinkFault) -> str:
    size, low, high = fault.size
    what = (
        f"each change of the command acts at a time of its own, {fault.delay_s[0] * 1e3:.0f} ms late with a "
        f"spread of {size * 1e3:.0f} ms ({low * 1e3:.0f} .. {high * 1e3:.0f})"
        if fault.kind == "jitter"
        else f"{size:.1%} ({low:.1%} .. {high:.1%}) of the commands never arrive, and the one before goes on "
        f"for {fault.period_s * 1e3:.0f} ms"
    )
    older = ""
    if fault.surplus < _SURPLUS:
        older = "; the link may have lost as many while the logs of the fit were recorded, which show fewer"
    if fault.rival == "loss":
        what += ", or some of the commands never arrive and are repeated"
    elif fault.rival == "jitter":
        what += ", or each acts at a time of its own"
    return (
        f"{what} (2 log likelihood ratio {fault.evidence:.0f}); the error after is with the changes where "
        f"they acted, which says nothing about predicting single changes{older}"
    )


def _whole(before: Difference, after: Difference) -> Difference:
    return replace(before, after=after.after)


def _whole_beside(before: Difference | None, after: Difference | None) -> Difference | None:
    return None if before is None or after is None else _whole(before, after)


def _places(report: GapReport, rest: GapReport) -> tuple[Region, ...]:
    after = {(r.channel, r.dimension, r.region): r.rms_after for r in rest.where}
    return tuple(
        replace(r, rms_after=after.get((r.channel, r.dimension, r.region), r.rms_after)) for r in report.where
    )
