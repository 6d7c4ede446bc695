"""The files of a study, with the form of `gap.json`: written all or, if one fails, none."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.files import atomic_path, write_json
from mecanum_env.model import write_model
from mecanum_env.report import report_available
from mecanum_env.units import FloatArray
from sysid.gap.report.page import write_gap_report
from sysid.gap.report.table import NEXT_FILE
from sysid.gap.report.wording import (
    closure,
    verdict_sentence,
)
from sysid.gap.result import Experiment, GapReport
from sysid.logs.runs import TIME
from sysid.logs.writer import write_columns

FORMAT: Final = "mecanum-gap/1"


def gap_json(report: GapReport) -> dict[str, Any]:
    """Return the object of `gap.json`; what is not finite or not known is null.

    Args:
        report: of the study.
    """
    value: dict[str, Any] = {
        "format": FORMAT,
        "verdict": report.verdict,
        "sentence": verdict_sentence(report),
        "dataset": report.dataset,
        "level": report.level,
        "effects": report.effects,
        "candidates": report.candidates,
        "gap": {**_record(report.gap), "closed": closure(report.gap)},
        "p_value": report.p_value,
        "channels": report.channels,
        "where": report.where,
        "untestable": report.untestable,
        "smallest_detectable": report.smallest_detectable,
        "next_experiment": _experiment(report.next_experiment),
        "evidence": report.evidence,
        "empirical": report.empirical,
        "notes": report.notes,
        "findings": [finding.to_json() for finding in report.findings],
        "provenance": report.provenance,
    }
    plain: dict[str, Any] = _plain(value)
    return plain


def _record(record: Any) -> dict[str, Any]:
    return {field.name: getattr(record, field.name) for field in fields(record)}


def _experiment(experiment: Experiment | None) -> dict[str, Any] | None:
    """Return the commands as columns of a log; predictions are drawn on the page only."""
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


def _plain(value: Any) -> Any:
    """Return a value as JSON has it: lists, plain numbers, null for what is not finite."""
    if is_dataclass(value):
        return _plain(_record(value))
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


_RESULT, _MODEL, _PAGE = "gap.json", "model.json", "report.html"
FILES: Final = (_RESULT, _MODEL, _PAGE, NEXT_FILE)


def write_study(report: GapReport, folder: Path) -> tuple[Path, ...]:
    """Write a study into a folder and return the paths of its files.

    `gap.json`, `model.json`, `report.html` (with the `report` extra) and, where there is one, the commands of
    the next experiment as `next_experiment.csv`. What an earlier study left there and this one does not have
    is removed.

    Args:
        report: of the study.
        folder: made where it does not exist.

    Raises:
        InputError: the folder cannot be written; nothing is changed then.
    """
    experiment = report.next_experiment
    has = {_PAGE: report_available(), NEXT_FILE: experiment is not None}
    names = [name for name in FILES if has.get(name, True)]
    with ExitStack() as stack:
        # Each is renamed to its place when the stack closes, none if anything here raises.
        paths = {name: stack.enter_context(atomic_path(folder / name)) for name in names}
        write_json(paths[_RESULT], gap_json(report))
        write_model(report.model, paths[_MODEL])
        if _PAGE in paths:
            write_gap_report(report, paths[_PAGE])
        if experiment is not None:
            write_columns(experiment_columns(experiment), paths[NEXT_FILE])
    for name in set(FILES) - set(names):
        (folder / name).unlink(missing_ok=True)
    return tuple(folder / name for name in names)


def experiment_columns(experiment: Experiment) -> dict[str, FloatArray]:
    """Return the commands as columns of a log, the last row at the end of the experiment.

    Args:
        experiment: as designed.
    """
    columns = {TIME: experiment.time_s, **experiment.columns}
    if experiment.duration_s <= float(experiment.time_s[-1]):
        return columns
    end = {name: values[-1] for name, values in experiment.columns.items()} | {TIME: experiment.duration_s}
    return {name: np.append(values, end[name]) for name, values in columns.items()}
