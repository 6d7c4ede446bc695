"""Writing one case of GapBench: logs as plain CSV, what the simulator says, and the truth apart from both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from mecanum_env.files import write_json
from mecanum_env.model import Model, write_model
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.predicted import predict
from sysid.logs import Dataset, Run
from sysid.logs.runs import TIME, UNITS
from sysid.logs.writer import write_columns, write_dataset

CHANNEL: Final = "speed_rpm"
KNOWN: Final = (
    "The machine is one wheel with its drive, off the floor or rolling; commands are wheel speeds.",
    "Commands are held from the row in which they first appear.",
    "nominal/ was recorded before the change, if any, and changed/ and test/ after it, on the same machine.",
    "simulator/ is what a model fitted to nominal/ says of every run; it may be used or not.",
    "Runs of one group are repeats of one command sequence; an empty cell is a missing sample.",
)


@dataclass(frozen=True)
class Material:
    """What a case is made of."""

    name: str
    """Of its folder; says nothing about the truth."""
    nominal: Dataset
    changed: Dataset
    test: tuple[Run, ...]
    """Measured hidden test runs."""
    command_period_s: float | None
    """Of the link; None where nobody knows."""
    truth: Mapping[str, Any]
    """kind, hidden, signal and what else is known of the change."""
    floor_rpm: float | None
    """Rms of the noise of repeats in the test runs; None without any."""
    source: str = "simulated"
    """Where the logs are from, with their licence."""


def write_case(material: Material, model: Model, bench: Path) -> None:
    """Write a case to cases/NAME and its truth to truth/NAME of a `bench` folder.

    `model`, fitted to the nominal logs, is its simulator.
    """
    folder, truth = bench / "cases" / material.name, bench / "truth" / material.name
    write_model(model, folder / "simulator" / "model.json")
    parts = {"nominal": material.nominal.runs, "changed": material.changed.runs, "test": material.test}
    squares: list[FloatArray] = []
    for part, runs in parts.items():
        for run in runs:
            said = simulated(model, run, known=part != "test")
            write_columns({TIME: run.time_s, CHANNEL: said}, folder / "simulator" / part / csv_name(run))
            if part == "test":
                squares.append(run.channels[CHANNEL] - said)
    write_dataset(_as_csv(material.nominal), folder / "nominal")
    write_dataset(_as_csv(material.changed), folder / "changed")
    for run in material.test:
        asked = {k: v for k, v in columns(run).items() if k != CHANNEL}
        write_columns(asked, folder / "test" / csv_name(run))
        write_columns({TIME: run.time_s, CHANNEL: run.channels[CHANNEL]}, truth / "test" / csv_name(run))
    write_json(folder / "case.json", _about(material))
    before = rms(np.concatenate(squares)) if squares else None
    test = {"channel": CHANNEL, "before": before, "floor": material.floor_rpm}
    about = {"format": "gapbench-truth/1", "case": material.name, "source": material.source}
    write_json(truth / "truth.json", {**about, **material.truth, "test": test})


def simulated(model: Model, run: Run, *, known: bool) -> FloatArray:
    """Return the speed [rpm] that a model predicts at a run's rows, shape (n,).

    Only of a `known` run the measured speed says how it starts; others start at rest.

    Raises:
        InputError: an effect that cannot be simulated.
        SimulationDivergedError: the state stopped being finite.
    """
    channels = {name: values for name, values in run.channels.items() if known or name != CHANNEL}
    return predict(model, replace(run, channels=channels))[CHANNEL]


def columns(run: Run) -> dict[str, FloatArray]:
    """Return the columns of a bench log, each of shape (n,), with stamps from 0."""
    return {TIME: run.time_s, **run.command.columns(), **run.channels}


def csv_name(run: Run) -> str:
    """Return the file name of a run as plain CSV."""
    return f"{run.file.split('.')[0]}.csv"


def _as_csv(dataset: Dataset) -> Dataset:
    """Return a dataset whose files are plain CSV, with stamps from 0."""
    return replace(dataset, runs=tuple(replace(r, file=csv_name(r), start_s=0.0) for r in dataset.runs))


def _about(material: Material) -> dict[str, Any]:
    """Return case.json: units, columns, runs and what may be known."""
    names = sorted({name for run in material.changed.runs for name in run.channels})
    units = {TIME: "s", "command_rpm": "rpm", **{name: UNITS[name] for name in names}}
    return {
        "format": "gapbench-case/1",
        "case": material.name,
        "level": "bench",
        "source": material.source,
        "columns": units,
        "command_period_s": material.command_period_s,
        "nominal": _listed(material.nominal.runs),
        "changed": _listed(material.changed.runs),
        "test": [{"file": csv_name(run)} for run in material.test],
        "known": list(KNOWN),
    }


def _listed(runs: Sequence[Run]) -> list[dict[str, str]]:
    return [{"file": csv_name(run), "group": run.group, "split": run.split} for run in runs]
