"""Reading a folder of log files into a `Dataset`, strictly; the contract is section 1 of FORMATS.md."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.kinematics import BODY_COMMAND, WHEEL_COMMAND
from mecanum_env.samples import MARK, SAMPLES
from mecanum_env.tables import Table, check_stamps, has_table_suffix, read_table, table_stem
from mecanum_env.units import FloatArray
from sysid.logs.checks import dataset_findings, run_findings
from sysid.logs.common_times import with_common_times
from sysid.logs.findings import Finding
from sysid.logs.quantities import refuse_other_unit, refuse_other_wheel, refuse_position, require_speeds
from sysid.logs.runs import (
    BENCH_COMMAND,
    COMMANDS,
    KNOWN,
    ROBOT_MOTION,
    SPEEDS,
    TIME,
    UNITS,
    BenchCommand,
    BodyCommand,
    Command,
    Dataset,
    Run,
    WheelCommand,
)
from sysid.logs.settings import FILE_NAME, Settings, read_settings
from sysid.logs.splits import assign_splits, group_names


def read_dataset(path: str | os.PathLike[str]) -> Dataset:
    """Read all runs of a folder, or one run, with the `dataset.toml` beside them where there is one.

    Every file of the folder that ends in .csv, .csv.gz or .parquet is a run, whether `dataset.toml` lists it
    or not; other files, and names that start with a dot, are ignored. `path` may also be that `dataset.toml`.

    Raises:
        InputError: the input cannot be used; the message names the file, the line (the header is line 1), the
            value and what would be right.
    """
    path = Path(path)
    if path.name == FILE_NAME:
        path = path.parent
    folder = path if os.path.isdir(path) else path.parent
    files = run_files(path)
    settings = read_settings(folder)
    if os.path.isdir(path):
        _check_listed(settings, folder, files)
    tables = [read_table(file, settings.ignore_columns) for file in files]
    _check_sources(settings, tables)
    read = [read_run(table, settings) for table in tables]
    runs, findings = [run for run, _ in read], [finding for _, noticed in read for finding in noticed]
    for run in runs[1:]:
        if run.level != runs[0].level:
            raise InputError(
                f"{folder}: {runs[0].file} is a {runs[0].level} log and {run.file} a {run.level} log; "
                "put them in two folders"
            )
    require_speeds(runs)
    if settings.runs and os.path.isdir(path):
        findings += [Finding(run.file, "unlisted", 1.0) for run in runs if run.file not in settings.runs]
    entries = [entry for entry in settings.runs.values() if any(run.file == entry.file for run in runs)]
    names, noticed = group_names(runs, {e.file: e.group for e in entries if e.group is not None})
    runs = [replace(run, group=name) for run, name in zip(runs, names, strict=True)]
    findings += noticed
    splits, noticed = assign_splits(runs, {e.file: e.split for e in entries if e.split is not None})
    runs = [replace(run, split=split) for run, split in zip(runs, splits, strict=True)]
    findings += noticed
    findings += [finding for run in runs for finding in run_findings(run)] + dataset_findings(runs)
    name = settings.name or (folder.resolve().name if os.path.isdir(path) else table_stem(path))
    (dataset,) = with_common_times(Dataset(name, tuple(runs), tuple(findings), _digest(files, settings)))
    return dataset


def run_files(path: Path) -> list[Path]:
    """Return the files of the runs in the folder `path`, or that one file.

    Raises:
        InputError: there is none, or one run is there twice.
    """
    if os.path.isfile(path):
        if not has_table_suffix(path):
            raise InputError(f"{path}: not a log; a run ends in .csv, .csv.gz or .parquet")
        return [path]
    if not os.path.isdir(path):
        present = [p.name for p in path.parent.iterdir()] if os.path.isdir(path.parent) else []
        packaged = f"{MARK}{path.as_posix()}"
        hint = f" (did you mean {packaged}?)" if packaged in SAMPLES else did_you_mean(path.name, present)
        raise InputError(f"{path}: no such file or folder{hint}; give a folder of runs in CSV")
    files = _logs_in(path)
    if not files:
        inside = sorted(p for p in path.iterdir() if p.is_dir() and _logs_in(p))
        if inside:
            raise InputError(
                f"{path}: no logs here, but in its subfolders {', '.join(p.name for p in inside)}; "
                f"each is a dataset of its own: choose one, such as {inside[0]}"
            )
        raise InputError(f"{path}: no logs here; a run is a file that ends in .csv, .csv.gz or .parquet")
    stems: dict[str, Path] = {}
    for file in files:
        twin = stems.setdefault(table_stem(file), file)
        if twin is not file:
            raise InputError(f"{path}: {twin.name} and {file.name} are one run twice; remove one")
    return files


def _logs_in(folder: Path) -> list[Path]:
    files = (file for file in folder.iterdir() if file.is_file() and not file.name.startswith("."))
    return sorted(filter(has_table_suffix, files), key=lambda file: file.name)


def _check_listed(settings: Settings, folder: Path, files: Sequence[Path]) -> None:
    present = [file.name for file in files]
    for name in settings.runs:
        if name not in present:
            raise InputError(
                f"{settings.path}: run {name!r} is listed, but {folder} has no such log"
                f"{did_you_mean(name, present)}; correct the name or remove the entry"
            )


def _check_sources(settings: Settings, tables: Sequence[Table]) -> None:
    """Refuse a column that `dataset.toml` names although no file has it."""
    present = dict.fromkeys(name for table in tables for name in table.names)
    named = {rule.source: f"{ours} is to come from it" for ours, rule in settings.columns.items()}
    named |= dict.fromkeys(settings.ignore_columns, "it is to be ignored")
    for source, why in named.items():
        if source not in present:
            raise InputError(
                f"{settings.path}: no file has a column {source!r}, though {why}"
                f"{did_you_mean(source, present)}; the files have {', '.join(present)}"
            )


def read_run(table: Table, settings: Settings) -> tuple[Run, list[Finding]]:
    """Return the run of one table under the `settings` of its folder, and what was noticed in its commands.

    Raises:
        InputError: as for `read_dataset`.
    """
    data = _our_columns(table, settings)
    if TIME not in data:
        raise InputError(f"{table.header}: column time_s is missing; the file has {', '.join(table.names)}")
    time = data.pop(TIME)
    check_stamps(table, time)
    if len(time) < 2:
        raise InputError(f"{table.where(0)}: the only row; a run needs at least 2")
    _check_columns(table, data)
    command, findings = _hold_commands(table, data, time)
    channels = {name: _frozen(data[name]) for name in UNITS if name in data}
    if not any(np.isfinite(values).any() for name, values in channels.items() if name != "battery_v"):
        raise InputError(
            f"{table.path}: no measured sample in any of {', '.join(channels)}; nothing to compare"
        )
    time_s = _frozen(time - time[0])
    return Run(table.path.name, "", "fit", time_s, command, channels, float(time[0])), findings


def _our_columns(table: Table, settings: Settings) -> dict[str, FloatArray]:
    """Return the columns under this project's names and in its units."""
    sources = {rule.source for rule in settings.columns.values()}
    data = {}
    for name in table.names:
        if name in settings.ignore_columns or name in sources:
            continue
        if name not in KNOWN:
            refuse_position(table.header, name)
            refuse_other_unit(table.header, name)
            refuse_other_wheel(table.header, name)
            raise InputError(
                f"{table.header}: unknown column {name!r}{did_you_mean(name, KNOWN)}; known: "
                f"{', '.join(KNOWN)}. Map it to one of these under [columns] in {FILE_NAME}, or "
                "list it in ignore_columns under [dataset]"
            )
        data[name] = table.column(name)
    for ours, rule in settings.columns.items():
        if rule.source not in table.names:
            continue
        if ours in SPEEDS:
            refuse_position(table.header, rule.source)
        if ours in data:
            raise InputError(
                f"{table.header}: {ours} is a column of the file, and {FILE_NAME} also makes it from "
                f"{rule.source!r}; keep one"
            )
        data[ours] = rule.scale * table.column(rule.source) + rule.offset
    return data


def _check_columns(table: Table, data: dict[str, FloatArray]) -> None:
    where = table.header
    commands = [name for name in COMMANDS if name in data]
    bench = [name for name in (*BENCH_COMMAND, "speed_rpm") if name in data]
    robot = [n for n in (*BODY_COMMAND, *WHEEL_COMMAND, *ROBOT_MOTION) if n in data]
    if bench and robot:
        both = f"{bench[0]} belongs to a bench log and {robot[0]} to a robot log"
        raise InputError(f"{where}: {both}; keep the columns of one")
    if not commands:
        wanted = "command_rpm" if bench else f"{', '.join(BODY_COMMAND)} (or {WHEEL_COMMAND[0]} ...)"
        raise InputError(f"{where}: no command column; a {'bench' if bench else 'robot'} log needs {wanted}")
    sets = [s for s in (BODY_COMMAND, WHEEL_COMMAND) if any(name in data for name in s)]
    if len(sets) > 1:
        raise InputError(
            f"{where}: both command sets ({', '.join(commands)}); keep V, theta, VC or the four wheels"
        )
    lacking = [name for name in (sets[0] if sets else (*BENCH_COMMAND, "speed_rpm")) if name not in data]
    if lacking:
        columns = ", ".join(lacking)
        raise InputError(f"{where}: column {columns} is missing; the file has {', '.join(table.names)}")
    if not bench and not any(name in data for name in ROBOT_MOTION):
        raise InputError(f"{where}: no measured column; a robot log needs one of {', '.join(ROBOT_MOTION)}")


def _hold_commands(
    table: Table, data: dict[str, FloatArray], time: FloatArray
) -> tuple[Command, list[Finding]]:
    """Apply a zero-order hold to each command over its missing cells; 0 before the first value."""
    held, findings = {}, []
    for name in (name for name in COMMANDS if name in data):
        given = np.isfinite(data[name])
        if not given.any():
            raise InputError(
                f"{table.path}: {name} has no value in any row; write it at least where it changes"
            )
        last = np.maximum.accumulate(np.where(given, np.arange(len(given)), -1))
        held[name] = _frozen(np.where(last < 0, 0.0, data[name][np.maximum(last, 0)]))
        first = int(np.argmax(given))
        if first:
            findings.append(Finding(table.path.name, "late_command", float(time[first] - time[0]), name))
    if BENCH_COMMAND[0] in held:
        return BenchCommand(held[BENCH_COMMAND[0]]), findings
    if BODY_COMMAND[0] in held:
        return BodyCommand(*(held[name] for name in BODY_COMMAND)), findings
    return WheelCommand(_frozen(np.column_stack([held[name] for name in WHEEL_COMMAND]))), findings


def _frozen(values: FloatArray) -> FloatArray:
    values = np.ascontiguousarray(values, float)
    values.setflags(write=False)
    return values


def _digest(files: Sequence[Path], settings: Settings) -> str:
    digest = hashlib.sha256()
    for file in (*files, *([settings.path] if settings.path else [])):
        digest.update(os.fsencode(file.name) + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()
