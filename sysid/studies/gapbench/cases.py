"""What a method sees of a case, read from its folder, and the answer that it gives."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from mecanum_env.errors import InputError
from mecanum_env.model import Model, read_model
from mecanum_env.tables import read_table
from mecanum_env.units import FloatArray
from sysid.logs import Dataset, Run, read_dataset
from sysid.logs.runs import TIME, BenchCommand
from sysid.logs.writer import write_columns
from sysid.studies.gapbench.case_folder import CHANNEL, simulated
from sysid.studies.score import FORMAT

Verdict = Literal["no_gap", "unexplained", "named", "ambiguous", "error"]
Bounds = tuple[float, float, float]
"""Value, lower and upper end of the 90 % interval."""


@dataclass(frozen=True)
class BenchCase:
    """One case of the benchmark, without its truth."""

    name: str
    about: Mapping[str, Any]
    """case.json."""
    nominal: Dataset
    changed: Dataset
    test: tuple[Run, ...]
    """Commands of the hidden test runs; the speed is not among their channels."""
    model: Model
    """The simulator, fitted to the nominal logs."""


@dataclass(frozen=True)
class Answer:
    """What a method says of a case."""

    verdict: Verdict
    effects: Mapping[str, Mapping[str, Bounds]] = field(default_factory=dict)
    """Name -> parameter -> estimate, of what was added to the simulator; parameters may be missing."""
    candidates: tuple[tuple[str, ...], ...] = ()
    """For "ambiguous": sets of names that explain the logs equally well."""
    untestable: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Effect -> parameter -> smallest size that the logs would show; without parameters: none would."""
    predictions: tuple[FloatArray, ...] = ()
    """Speeds [rpm] at the rows of each hidden test run, each of shape (n,); empty: no prediction."""
    message: str = ""
    """The error, where one ended the method."""


def read_case(folder: Path) -> BenchCase:
    """Return the case in a folder that `make` wrote.

    Raises:
        InputError: a file that is missing or cannot be used.
    """
    try:
        about = json.loads((folder / "case.json").read_text(encoding="utf-8"))
    except (OSError, json.JSONDecodeError) as error:
        raise InputError(f"{folder}: no case of GapBench ({error}); make a benchmark first") from error
    return BenchCase(
        name=folder.name,
        about=about,
        nominal=read_dataset(folder / "nominal"),
        changed=read_dataset(folder / "changed"),
        test=tuple(_test_run(folder / "test" / entry["file"]) for entry in about["test"]),
        model=read_model(folder / "simulator" / "model.json"),
    )


def predicted(model: Model, case: BenchCase) -> tuple[FloatArray, ...]:
    """Return what a model says of the hidden test runs of a case, as an answer's `predictions`.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    return tuple(simulated(model, run, known=False) for run in case.test)


def answer_json(answer: Answer, seconds: float) -> dict[str, Any]:
    """Return an answer that took some time, as in answers.json."""
    effects = [
        {
            "name": name,
            "parameters": {
                key: {"value": b[0], "low": b[1], "high": b[2]}
                for key, b in bounds.items()
                if all(map(math.isfinite, b))
            },
        }
        for name, bounds in answer.effects.items()
    ]
    known: dict[str, Any] = {"verdict": answer.verdict, "seconds": seconds}
    optional = {
        "effects": effects,
        "candidates": [list(names) for names in answer.candidates],
        "untestable": {
            name: {key: value for key, value in sizes.items() if math.isfinite(value)}
            for name, sizes in answer.untestable.items()
        },
        "message": answer.message,
    }
    return known | {key: value for key, value in optional.items() if value}


def write_predictions(answer: Answer, case: BenchCase, folder: Path) -> None:
    """Write an answer's predictions of a case's hidden test runs to a folder; nothing if there are none."""
    for run, speed_rpm in zip(case.test, answer.predictions, strict=bool(answer.predictions)):
        write_columns({TIME: run.time_s, CHANNEL: speed_rpm}, folder / run.file)


def answers_json(method: str, cases: Mapping[str, Any]) -> dict[str, Any]:
    """Return answers.json of a method: `cases` has what `answer_json` gives for each."""
    return {"format": FORMAT, "method": method, "cases": dict(cases)}


def _test_run(path: Path) -> Run:
    """Return a hidden test run: what was commanded, and the battery if that is logged."""
    table = read_table(path)
    columns = {name: table.column(name) for name in table.names}
    channels = {k: v for k, v in columns.items() if k == "battery_v"}
    return Run(path.name, path.name, "test", columns[TIME], BenchCommand(columns["command_rpm"]), channels)
