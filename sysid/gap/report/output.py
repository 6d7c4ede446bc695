"""What a study puts out: ten lines for the terminal, and its files, written all or, if one fails, none."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.files import atomic_path, plain_json, write_json
from mecanum_env.model import write_model
from mecanum_env.model.custom_file import custom_to_json
from mecanum_env.units import FloatArray
from sysid.gap.report.page import write_gap_report
from sysid.gap.result import CustomProposal, Difference, Experiment, FoundEffect, GapReport
from sysid.gap.spending import STUDIES
from sysid.gap.wording import (
    NEXT_FILE,
    WHEEL_LAW,
    Concentration,
    amount,
    closed_share,
    closure,
    compared_runs,
    concentrations,
    count,
    effect_name,
    interval_text,
    next_step,
    number,
    place_name,
    proposal_text,
    set_name,
    unit_of,
    verdict_sentence,
)
from sysid.logs.runs import TIME
from sysid.logs.writer import write_columns

FORMAT: Final = "mecanum-gap/1"
_RESULT, _MODEL, _PAGE = "gap.json", "model.json", "report.html"
FILES: Final = (_RESULT, _MODEL, _PAGE, NEXT_FILE)
"""Every file that a study may write."""
_MOST_CHANNELS, _MOST_NAMES, _MOST_LINES = 4, 4, 10


def gap_table(report: GapReport) -> str:
    """Return what a study found in at most ten lines, the verdict first."""
    several = len(report.candidates) > 1
    channels = [f"{name} {_change(channel)}" for name, channel in report.channels.items()]
    hidden = [effect.name for effect in report.untestable]
    hidden_names = _shortened(hidden, _MOST_NAMES)
    rows = [
        ("gap", _gap(report)),
        ("channels", _shortened(channels, _MOST_CHANNELS) if len(channels) > 1 else ""),
        ("where most", "; ".join(_place(found) for found in concentrations(report, most=2))),
        ("missing", "; ".join(_effect(found) for found in report.effects)),
        ("tied", " | ".join(map(set_name, report.candidates[:_MOST_NAMES])) if several else ""),
        ("tried", _tried(report)),
        ("proposed", _proposed(report)),
        ("untestable", f"{count(len(hidden), 'effect')}: {hidden_names}" if hidden else ""),
        ("noticed", _noticed(report)),
        ("next", next_step(report)),
    ]
    lines = [f"{name:<11}{text}" for name, text in rows if text]
    return "\n".join([f"{report.dataset}: {verdict_sentence(report)}", *lines[: _MOST_LINES - 1]])


def _gap(report: GapReport) -> str:
    plain = f"{_change(report.gap)} on {compared_runs(report)}{_closed(report, report.gap)}"
    return "; ".join(filter(None, (plain, _beside_fit(report))))


def _beside_fit(report: GapReport) -> str:
    beside = report.gap_beside_fit
    if beside is None:
        return ""
    return f"beside the logs of the fit {_change(beside)}{_closed(report, beside)}"


def _closed(report: GapReport, gap: Difference) -> str:
    closed = closed_share(gap) if report.changed else "-"
    return f"; {closed} of what is above noise is gone" if closed != "-" else ""


def _change(gap: Difference) -> str:
    floor = "" if gap.noise_floor is None else f" (noise {number(gap.noise_floor)})"
    return f"{number(gap.before)} -> {amount(gap.after, gap.unit)}{floor}"


def _place(found: Concentration) -> str:
    share = f"{found.region.share:.0%} of the error in {found.sample_share:.0%} of the samples"
    return f"{place_name(found.region)}: {share}"


def _effect(found: FoundEffect) -> str:
    texts = {name: interval_text(p, unit_of(found.name, name)) for name, p in found.estimates.items()}
    values = ", ".join(f"{name} {value} ({interval})" for name, (value, interval) in texts.items())
    said = {"new": "; new", "already when fitted": "; was there already when the model was fitted"}
    end = said.get(found.since, "")
    return f"{effect_name(found.name)} {values}, in {found.selection_frequency:.0%} of resamples{end}"


def _tried(report: GapReport) -> str:
    """Return how many sets were judged, and how many do, or which comes closest if none is named."""
    sets = f"{count(len(report.evidence), 'set')} of effects"
    if report.verdict != "unexplained":
        return f"{sets}; explain the data: {sum(one.adequate for one in report.evidence)}"
    closest = next((one for one in report.evidence if one.effects and one.effects != (WHEEL_LAW,)), None)
    before = next((one.test_rms for one in report.evidence if not one.effects), math.nan)
    if closest is None or not closest.score < 0.0:
        return sets
    change = f"{number(before)} -> {amount(closest.test_rms, report.gap.unit)}"
    told = f", {change} on test runs" if math.isfinite(before) else ""
    return f"{sets}; closest: {set_name(closest.effects)}{told}, which is not enough"


def _proposed(report: GapReport) -> str:
    custom = report.custom
    if custom is None:
        return ""
    end = "added to the model" if custom.adopted else "--adopt adds it to the model"
    return f"{proposal_text(custom)}; leaves {amount(custom.after, report.gap.unit)}; {end}"


def _noticed(report: GapReport) -> str:
    kinds = sorted({finding.kind for finding in report.findings})
    counts = [count(len(report.notes), "note") if report.notes else "", ", ".join(kinds)]
    return "; ".join(filter(None, counts))


def _shortened(items: Sequence[str], most: int) -> str:
    more = [f"and {len(items) - most} more"] if len(items) > most else []
    return ", ".join([*items[:most], *more])


def gap_json(report: GapReport) -> dict[str, Any]:
    """Return the object of `gap.json`; a number that is not finite or not known is null."""
    custom, beside = report.custom, report.gap_beside_fit
    value: dict[str, Any] = plain_json(
        {
            "format": FORMAT,
            "verdict": report.verdict,
            "sentence": verdict_sentence(report),
            "dataset": report.dataset,
            "level": report.level,
            "effects": [_effect_json(found) for found in report.effects],
            "candidates": report.candidates,
            "gap": _with_closure(report.gap),
            "gap_beside_fit": None if beside is None else _with_closure(beside),
            "held_out": report.held_out,
            "p_value": report.p_value,
            "false_alarm": report.false_alarm,
            STUDIES: report.studies,
            "channels": report.channels,
            "where": report.where,
            "untestable": report.untestable,
            "smallest_detectable": report.smallest_detectable,
            "next_experiment": _experiment_json(report.next_experiment),
            "evidence": report.evidence,
            "custom": [] if custom is None else custom_to_json((custom.effect,)),
            "custom_evidence": None if custom is None else _custom_evidence(custom),
            "notes": report.notes,
            "findings": [finding.to_json() for finding in report.findings],
            "provenance": report.provenance,
        }
    )
    return value


def _with_closure(gap: Difference) -> dict[str, Any]:
    return {**vars(gap), "closed": closure(gap)}


def _custom_evidence(custom: CustomProposal) -> dict[str, Any]:
    """Return what speaks for a proposed custom effect; itself it is in the form of a model file."""
    return {name: value for name, value in vars(custom).items() if name != "effect"}


def _effect_json(found: FoundEffect) -> dict[str, Any]:
    """Return a found effect under its cause, with its form where the cause has several."""
    value: dict[str, Any] = {"name": found.cause}
    if found.form:
        value |= {"form": found.form, "forms_tied": found.forms_tied}
    droop = {} if found.droop_rpm is None else {"droop_rpm": found.droop_rpm}
    seen = {"selection_frequency": found.selection_frequency, "since": found.since}
    return value | {"parameters": found.parameters} | droop | seen


def _experiment_json(experiment: Experiment | None) -> dict[str, Any] | None:
    """Return an experiment with its commands as columns of a log; only the page draws the predictions."""
    if experiment is None:
        return None
    return {
        "why": experiment.why,
        "candidates": experiment.candidates,
        "time_s": experiment.time_s,
        **experiment.columns,
        "duration_s": experiment.duration_s,
        "power": experiment.power,
    }


def write_study(report: GapReport, folder: Path) -> tuple[Path, ...]:
    """Write a study into a folder, created if it does not exist, and return the paths of its files.

    `gap.json`, `model.json`, `report.html` and, if there is one, the commands of
    the next experiment as `next_experiment.csv`. A file of an earlier study that this one does not write is
    removed.

    Raises:
        InputError: the folder cannot be written; nothing is changed then.
    """
    experiment = report.next_experiment
    names = [name for name in FILES if name != NEXT_FILE or experiment is not None]
    with ExitStack() as stack:
        # Every file is renamed to its place when the stack closes, none of them if anything here raises.
        paths = {name: stack.enter_context(atomic_path(folder / name)) for name in names}
        write_json(paths[_RESULT], gap_json(report))
        write_model(report.model, paths[_MODEL])
        write_gap_report(report, paths[_PAGE])
        if experiment is not None:
            write_columns(_experiment_columns(experiment), paths[NEXT_FILE])
    for name in set(FILES) - set(names):
        (folder / name).unlink(missing_ok=True)
    return tuple(folder / name for name in names)


def _experiment_columns(experiment: Experiment) -> dict[str, FloatArray]:
    """Return the commands of an experiment as columns of a log, with a last row at its end."""
    columns = {TIME: experiment.time_s, **experiment.columns}
    if experiment.duration_s <= float(experiment.time_s[-1]):
        return columns
    end = {name: values[-1] for name, values in experiment.columns.items()} | {TIME: experiment.duration_s}
    return {name: np.append(values, end[name]) for name, values in columns.items()}
