"""Cases of GapBench from the zoo: drives drawn at random, with their logs and what is hidden."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import effect_named, paper_model
from mecanum_env.units import FloatArray
from sysid.logs import Run, read_dataset
from sysid.logs.runs import BenchCommand
from sysid.studies.gapbench.case_folder import CHANNEL, Material
from sysid.studies.gapbench.names import plain_number
from sysid.studies.zoo.cases.bench.draw import NOISE, draw_bench_case, study_commands
from sysid.studies.zoo.cases.case import Case, Hidden
from sysid.studies.zoo.cases.layouts import LAYOUTS
from sysid.studies.zoo.cases.write import write_bench_case
from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.simulate import Log, simulate

_TEST_SEQUENCES: Final = 2
"""Hidden test runs of a case, with commands of their own."""
_TEST_S: Final = 10.0
"""Longest hidden test run [s]."""


def simulated_case(seed: int, name: str) -> Material:
    """Return what the zoo's bench case of a seed gives for a case of a name; always the same.

    Raises:
        RuntimeError: no drive of the zoo can have what the seed asks for.
    """
    with TemporaryDirectory() as made:
        case = write_bench_case(seed, Path(made))
        nominal, changed = (read_dataset(Path(made) / part) for part in ("nominal", "logs"))
    _, before, after = draw_bench_case(seed)
    runs, squares = [], []
    for index, commands in enumerate(_test_commands(case, before)):
        logs = [simulate(after, commands, np.random.default_rng((seed, NOISE, 2, index, i))) for i in (0, 1)]
        runs.append(_as_run(f"test_{index:02d}.csv", logs[0]))
        squares.append(_apart(logs[0], logs[1]))
    return Material(
        name=name,
        nominal=replace(nominal, name="before the change"),
        changed=replace(changed, name="after the change"),
        test=tuple(runs),
        command_period_s=before.link.period_s,
        truth=_truth(case),
        floor_rpm=float(np.sqrt(np.nanmean(np.concatenate(squares)) / 2.0)),
    )


def _test_commands(case: Case, nominal: Drive) -> list[FloatArray]:
    """Return command sequences of the case's plan that none of its logs has."""
    layout = next(layout for layout in LAYOUTS if layout.name == case.layout)
    more = replace(layout, sequences=layout.sequences + _TEST_SEQUENCES, seconds=min(layout.seconds, _TEST_S))
    return study_commands(case.seed, case.plan, more, nominal, nominal=False)[-_TEST_SEQUENCES:]


def _as_run(file: str, log: Log) -> Run:
    channels = {CHANNEL: log.speed_rpm}
    if log.battery_v is not None:
        channels["battery_v"] = log.battery_v
    return Run(file, file, "test", log.time_s, BenchCommand(log.command_rpm), channels)


def _apart(one: Log, other: Log) -> FloatArray:
    """Return the squared differences of two repeats at the stamps of the first, shape (n,)."""
    known = np.isfinite(other.speed_rpm)
    squared: FloatArray = (
        one.speed_rpm - np.interp(one.time_s, other.time_s[known], other.speed_rpm[known])
    ) ** 2
    return squared


def _truth(case: Case) -> dict[str, Any]:
    """Return the truth of a case as JSON objects."""
    return {
        "level": case.level,
        "kind": case.kind,
        "hidden": [_hidden(one) for one in case.hidden],
        "outsider": case.outsider,
        "twins": list(case.twins),
        "signal": plain_number(case.signal),
        "family": case.family,
        "plan": case.plan,
        "layout": case.layout,
        "seed": case.seed,
    }


def _hidden(hidden: Hidden) -> dict[str, Any]:
    effect = effect_named(hidden.name, hidden.form or None)
    known = {p.name: p for p in CATALOGUE[effect].parameters}
    model = paper_model()
    return {
        "name": hidden.name,
        "form": hidden.form,
        "effect": effect,
        "parameters": {key: plain_number(value) for key, value in hidden.parameters.items()},
        "neutral": {
            key: plain_number(known[key].neutral_in(model)) if key in known else 0.0
            for key in hidden.parameters
        },
        "signal": plain_number(hidden.signal),
    }
