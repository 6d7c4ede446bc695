"""Robots on any number of omni wheels: their runs wheel by wheel, and the body's motion that the wheels give.

A wheel is studied as a bench log of its own. The body is studied in the same way, one direction at a time:
its commanded and its measured velocity, written as the speed of a wheel's rim [rpm].
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.kinematics import TWIST
from mecanum_env.omni import OmniWheel, speeds_to_twist
from mecanum_env.tables import Table, read_table
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.reader import read_dataset, read_run, run_files
from sysid.logs.runs import BenchCommand, Dataset, Run
from sysid.logs.settings import ColumnRule, Settings, read_settings
from sysid.logs.splits import assign_splits, group_names

DIRECTIONS: Final = ("forward", "left", "turn")
"""What the body's bench logs are called, in the order of `TWIST`."""


@dataclass(frozen=True, eq=False)
class BodyRun:
    """One run of a robot: velocities of the body, columns vx, vy [m/s] and yaw rate [rad/s], each (n, 3)."""

    wheels: tuple[Run, ...]
    """The run of each wheel; the first one's stamps are those of the body."""
    commanded: FloatArray
    """What the commanded wheel speeds give."""
    turned: FloatArray
    """What the measured wheel speeds give if no wheel slips."""
    measured: FloatArray
    """What was measured of the body itself; NaN where nothing was."""


def read_wheel_logs(folders: Sequence[Path], wheels: Sequence[OmniWheel]) -> tuple[Dataset, ...]:
    """Return the bench logs of each wheel of a robot.

    Args:
        folders: one folder of runs with columns command_NAME_rpm and speed_NAME_rpm for every wheel, or one
            folder of bench logs for each wheel, in their order, whose runs have the same file names.
        wheels: the robot's wheels.

    Raises:
        InputError: another number of folders, a run that one folder lacks, or what `read_dataset` refuses.
    """
    if len(folders) == 1:
        return tuple(_one_wheel(folders[0], wheel) for wheel in wheels)
    if len(folders) != len(wheels):
        raise InputError(
            f"{len(folders)} folders for {len(wheels)} wheels; give one folder with the columns of all "
            "wheels, "
            f"or a folder of bench logs for each, in the order {', '.join(wheel.name for wheel in wheels)}"
        )
    datasets = tuple(map(read_dataset, folders))
    for folder, dataset in zip(folders, datasets, strict=True):
        if dataset.level != "bench":
            raise InputError(f"{folder}: a robot log, must be the bench log of one wheel")
        if [run.file for run in dataset.runs] != [run.file for run in datasets[0].runs]:
            raise InputError(f"{folder}: must have runs of the same file names as {folders[0]}")
    return datasets


def body_runs(
    datasets: Sequence[Dataset], wheels: Sequence[OmniWheel], measured: Mapping[str, Mapping[str, FloatArray]]
) -> tuple[BodyRun, ...]:
    """Return the body's motion in every run.

    Args:
        datasets: bench logs of the wheels, as `read_wheel_logs` returns them.
        wheels: the robot's wheels, in the same order.
        measured: columns of `TWIST` by name, each (n,), of each run by its file name; may lack any.
    """
    found = []
    for runs in zip(*(dataset.runs for dataset in datasets), strict=True):
        time = runs[0].time_s
        commands = np.column_stack([_held(run, time) for run in runs])
        speeds = np.column_stack([np.interp(time, *_samples(run)) for run in runs])
        columns = measured.get(runs[0].file, {})
        nothing = np.full(time.size, np.nan)
        found.append(
            BodyRun(
                runs,
                speeds_to_twist(commands, wheels),
                speeds_to_twist(speeds, wheels),
                np.column_stack([columns.get(name, nothing) for name in TWIST]),
            )
        )
    return tuple(found)


def read_measured(folder: Path) -> dict[str, dict[str, FloatArray]]:
    """Return the columns of `TWIST` that the runs of a folder have, by file and name."""
    settings = read_settings(folder)
    rules = {name: ColumnRule(name) for name in TWIST} | dict(settings.columns)
    found: dict[str, dict[str, FloatArray]] = {}
    for file in run_files(folder):
        table = read_table(file, settings.ignore_columns)
        found[file.name] = {
            name: rules[name].scale * table.column(rules[name].source) + rules[name].offset
            for name in TWIST
            if rules[name].source in table.names
        }
    return found


def direction_dataset(
    runs: Sequence[BodyRun], direction: int, wheels: Sequence[OmniWheel], name: str
) -> Dataset | None:
    """Return one direction of the body as a bench log, or None where it was never commanded.

    Commanded and measured velocity are the rim speed of a wheel [rpm]: over the mean radius of the `wheels`,
    a yaw rate times their mean distance. Where the body was not measured, what the wheels turned stands for
    it.

    Args:
        runs: the robot's runs.
        direction: 0 forward, 1 left, 2 turning.
        wheels: the robot's wheels.
        name: name of the dataset.
    """
    radius = float(np.mean([wheel.radius_m for wheel in wheels]))
    arm = float(np.mean([wheel.distance_m for wheel in wheels])) if direction == 2 else 1.0
    scale = arm / (radius * RAD_S_PER_RPM)
    made = []
    for run in runs:
        command = np.round(scale * run.commanded[:, direction], 3) + 0.0
        measured = run.measured[:, direction]
        speed = scale * (measured if np.isfinite(measured).any() else run.turned[:, direction])
        made.append(replace(run.wheels[0], command=BenchCommand(command), channels={"speed_rpm": speed}))
    if not any(np.any(run.command.wheels_rpm != 0.0) for run in made):
        return None
    return Dataset(name, tuple(made), ())


def _one_wheel(folder: Path, wheel: OmniWheel) -> Dataset:
    """Return the bench log of one wheel out of a folder with the columns of all."""
    settings = read_settings(folder)
    runs = []
    for file in run_files(folder):
        table = read_table(file, settings.ignore_columns)
        runs.append(read_run(table, _only(table, settings, wheel))[0])
    stated = [settings.runs[run.file] for run in runs if run.file in settings.runs]
    groups, _ = group_names(runs, {one.file: one.group for one in stated if one.group is not None})
    runs = [replace(run, group=group) for run, group in zip(runs, groups, strict=True)]
    splits, _ = assign_splits(runs, {one.file: one.split for one in stated if one.split is not None})
    runs = [replace(run, split=split) for run, split in zip(runs, splits, strict=True)]
    return Dataset(f"{settings.name or folder.resolve().name}, wheel {wheel.name}", tuple(runs), ())


def _only(table: Table, settings: Settings, wheel: OmniWheel) -> Settings:
    """Return settings under which a table is the bench log of one of its wheels."""
    rules = {f"{kind}_rpm": ColumnRule(f"{kind}_{wheel.name}_rpm") for kind in ("command", "speed")}
    for rule in rules.values():
        if rule.source not in table.names:
            raise InputError(
                f"{table.header}: column {rule.source} is missing, for wheel {wheel.name} of the robot; "
                f"the file has {', '.join(table.names)}"
            )
    rules |= {name: settings.columns[name] for name in ("time_s", "battery_v") if name in settings.columns}
    used = {rule.source for rule in rules.values()} | {"time_s", "battery_v"}
    return Settings(settings.path, None, tuple(name for name in table.names if name not in used), rules)


def _held(run: Run, time_s: FloatArray) -> FloatArray:
    """Return the wheel's command [rpm] that is held at each time, shape (n,)."""
    rows = np.searchsorted(run.time_s, time_s, side="right") - 1
    return np.asarray(run.command.wheels_rpm[rows, 0])


def _samples(run: Run) -> tuple[FloatArray, FloatArray]:
    use = run.finite("speed_rpm")
    return run.time_s[use], run.channel("speed_rpm")[use]


def body_table(runs: Sequence[BodyRun]) -> str:
    """Return a table of how the body moved in `runs`: commanded, from the wheels and, where it was, measured.

    For each direction: the gain of the wheels' motion over the commanded one, and of the measured motion over
    the wheels' (least squares), with the rms of what the gain leaves.
    """
    parts = [
        np.concatenate([getattr(run, name) for run in runs]) for name in ("commanded", "turned", "measured")
    ]
    lines = [f"{len(runs)} runs, {sum(run.wheels[0].duration_s for run in runs):.0f} s"]
    for direction, (name, unit) in enumerate(zip(DIRECTIONS, ("m/s", "m/s", "rad/s"), strict=True)):
        commanded, turned, measured = (part[:, direction] for part in parts)
        line = f"{name}: commanded up to {np.max(np.abs(commanded)):.3g} {unit}"
        line += f"; from the wheels {_gain(commanded, turned, unit)} of it"
        if np.isfinite(measured).any():
            line += f"; measured {_gain(turned, measured, unit)} of what the wheels turned"
        lines.append(line)
    if not any(np.isfinite(run.measured).any() for run in runs):
        lines.append(f"no measured motion of the body ({', '.join(TWIST)}): slip cannot be seen")
    return "\n".join(lines)


def _gain(one: FloatArray, other: FloatArray, unit: str) -> str:
    use = np.isfinite(one) & np.isfinite(other)
    power = float(one[use] @ one[use])
    if power < 1e-12 * one.size:
        return f"(never commanded) rms {np.sqrt(np.mean(other[use] ** 2)):.2g} {unit}"
    gain = float(one[use] @ other[use]) / power
    rest = float(np.sqrt(np.mean((other[use] - gain * one[use]) ** 2)))
    return f"{gain:.4f} (rms {rest:.2g} {unit})"
