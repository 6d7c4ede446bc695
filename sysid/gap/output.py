"""The files of a study: written all or, if one fails, none."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import Final

import numpy as np

from mecanum_env.files import atomic_path, write_json
from mecanum_env.model import write_model
from mecanum_env.report import report_available
from mecanum_env.units import FloatArray
from sysid.gap.records import Experiment, GapReport
from sysid.gap.result import gap_json
from sysid.gap.table import NEXT_FILE
from sysid.logs.columns import TIME
from sysid.logs.writer import write_columns
from sysid.report import write_gap_report

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
