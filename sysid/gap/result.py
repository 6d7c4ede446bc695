"""What a study writes as `gap.json`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any, Final

import numpy as np

from sysid.gap.records import Experiment, GapReport
from sysid.gap.verdict import closure, verdict_sentence

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
        "findings": report.findings,
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
