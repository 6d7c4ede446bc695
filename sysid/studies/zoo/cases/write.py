"""The logs of a case as files: nominal ones for the fit, and those with something hidden.

They are as the contract of log folders has them: a CSV file per run, and a `dataset.toml`. The same seed
writes the same bytes.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from sysid.studies.zoo.cases.beginning import as_recorded
from sysid.studies.zoo.cases.bench import draw as bench_draw
from sysid.studies.zoo.cases.bench.plans import Commands
from sysid.studies.zoo.cases.case import Case, Driven
from sysid.studies.zoo.cases.layouts import STANDARD, Layout
from sysid.studies.zoo.cases.robot import draw as robot_draw
from sysid.studies.zoo.drives.drive import Drive
from sysid.studies.zoo.drives.simulate import simulate as simulate_drive
from sysid.studies.zoo.robots.draw import known
from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.simulate import simulate as simulate_robot

FloatArray = npt.NDArray[np.float64]
Columns = Mapping[str, FloatArray]
"""Name -> samples (n,), in the order of a log's columns."""

_BENCH_COLUMNS: Final = ("time_s", "command_rpm", "speed_rpm", "battery_v")
_BENCH_SPLITS: Final = ("fit", "fit", "validation", "fit", "test", "fit", "validation", "test")
"""Of the groups of a drive's nominal logs."""
_ROBOT_SPLITS: Final = ("fit", "fit", "fit", "fit", "validation", "test")
"""Of the sequences of a robot's nominal logs, in the order of the plan's manoeuvres."""


def write_bench_case(seed: int, folder: Path, driven: Driven = "other") -> Case:
    """Write a seed's nominal logs to `folder`/nominal and its case's to `folder`/logs; return the case.

    `driven` says which commands the case's logs drive.
    """
    case, nominal, changed = bench_draw.draw_bench_case(seed, driven)
    commands = as_recorded(seed, bench_draw.fit_commands(seed, nominal))
    _write_bench_study(
        folder / "nominal", nominal, commands, STANDARD, (seed, bench_draw.NOISE, 0), _BENCH_SPLITS
    )
    write_bench_logs(folder / "logs", changed, bench_draw.case_commands(case, nominal), case)
    return case


def write_bench_logs(folder: Path, drive: Drive, commands: Sequence[Commands], case: Case) -> None:
    """Write logs for a study to a `folder`: the `drive` follows `commands` in the layout of a `case`."""
    recorded, stream = as_recorded(case.seed, commands), (case.seed, bench_draw.NOISE, 1)
    _write_bench_study(folder, drive, recorded, bench_draw.layout_of(case), stream, ())


def write_robot_case(seed: int, folder: Path, driven: Driven = "other") -> Case:
    """Write the case of a seed to a folder and return it.

    `nominal` receives the logs that a model is fitted to, with their splits, `robot.json` what a ruler and a
    scale tell of the robot, and `logs` those with something hidden, which drive the commands that `driven`
    says.

    Raises:
        RuntimeError: nothing of the wanted kind shows on the seed's robot.
    """
    case, robot, changed = robot_draw.draw_robot_case(seed, driven)
    write_robot_nominal(seed, robot, folder)
    commands, repeats = robot_draw.study_commands(case, robot), robot_draw.layout_of(case).repeats
    write_robot_logs(folder / "logs", changed, commands, seed, repeats)
    return case


def write_robot_nominal(seed: int, robot: Robot, folder: Path) -> None:
    """Write what the model of a `robot` is fitted to into a `folder`: `nominal` and `robot.json`.

    `seed` draws commands, starts, noise and the errors of the ruler.
    """
    rows = as_recorded(seed, robot_draw.fit_commands(seed, robot))
    stream = [seed, robot_draw.RUNS, 0]
    _write_robot_study(folder / "nominal", robot, rows, robot_draw.FITTED.repeats, stream, _ROBOT_SPLITS)
    ruler = known(robot, np.random.default_rng([seed, robot_draw.RULER]))
    (folder / "robot.json").write_text(json.dumps(ruler, indent=1) + "\n", encoding="utf-8")


def write_robot_logs(
    folder: Path, robot: Robot, commands: Sequence[FloatArray], seed: int, repeats: int
) -> None:
    """Write logs for a study to a `folder`.

    The `robot` drives each sequence of `commands`, (m, 3), so many times (`repeats`); `seed` draws starts
    and noise.
    """
    recorded = as_recorded(seed, commands)
    _write_robot_study(folder, robot, recorded, repeats, [seed, robot_draw.RUNS, 1], ())


def _write_bench_study(
    folder: Path,
    drive: Drive,
    commands: Sequence[Commands],
    layout: Layout,
    stream: tuple[int, ...],
    splits: Sequence[str],
) -> None:
    """Drive a wheel on the bench through each sequence as often as a layout says, and write the logs."""
    groups = []
    for group, sequence in enumerate(commands):
        runs = {}
        for repeat in range(layout.repeats):
            log = simulate_drive(drive, sequence, np.random.default_rng((*stream, group, repeat)))
            columns = {name: getattr(log, name) for name in _BENCH_COLUMNS}
            runs[f"run_{group:02d}_{repeat}.csv"] = {n: v for n, v in columns.items() if v is not None}
        groups.append(runs)
    _write(folder, f"bench, free wheel, {layout.name}", groups, splits, {"battery_v": "{:.2f}"})


def _write_robot_study(
    folder: Path,
    robot: Robot,
    commands: Sequence[FloatArray],
    repeats: int,
    stream: list[int],
    splits: Sequence[str],
) -> None:
    """Drive a robot through each sequence so many times, and write the logs."""
    groups = []
    for number, rows in enumerate(commands):
        runs = {}
        for repeat in range(repeats):
            log = simulate_robot(robot, rows, np.random.default_rng([*stream, number, repeat]))
            v, theta, vc = log.commands.T
            columns = {"time_s": log.time_s, "command_v_rpm": v, "command_theta_deg": theta}
            runs[f"run_{number:02d}_{repeat + 1}.csv"] = columns | {"command_vc_rpm": vc} | log.channels
        groups.append(runs)
    _write(folder, "robot", groups, splits, {})


def _write(
    folder: Path,
    name: str,
    groups: Sequence[Mapping[str, Columns]],
    splits: Sequence[str],
    forms: Mapping[str, str],
) -> None:
    """Write a dataset of some name: the runs of each group by file name, and its `dataset.toml`.

    Without `splits` the reader assigns them. `forms` are those of columns that are not written to six digits.
    """
    folder.mkdir(parents=True, exist_ok=True)
    lines = ["[dataset]", f'name = "{name}"']
    for number, runs in enumerate(groups):
        for file, columns in runs.items():
            (folder / file).write_text(_csv(columns, forms), encoding="utf-8")
            lines += ["", "[[runs]]", f'file = "{file}"', f'group = "sequence_{number:02d}"']
            if splits:
                lines.append(f'split = "{splits[number]}"')
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def _csv(columns: Columns, forms: Mapping[str, str]) -> str:
    """Return a log as text: stamps to the microsecond, a missing sample (NaN) as an empty cell."""
    known_forms = {"time_s": "{:.6f}", **forms}
    written = [known_forms.get(name, "{:.6g}") for name in columns]
    rows = np.stack(list(columns.values()), axis=1).tolist()
    lines = [
        ",".join("" if math.isnan(v) else form.format(v) for v, form in zip(row, written, strict=True))
        for row in rows
    ]
    return "\n".join([",".join(columns), *lines]) + "\n"
