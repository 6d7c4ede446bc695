"""Simulated arrays to the log files that the workflow reads."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from sysid.logs import BenchCommand, BodyCommand, Dataset, Run
from sysid.logs.writer import write_dataset, write_run


def held_at(time_s: np.ndarray, commands: np.ndarray, period_s: float = 0.1) -> np.ndarray:
    """Return the command held at each time, of commands (m, ...) given every period."""
    index = np.floor(time_s / period_s + 1e-6).astype(int)
    return commands[np.minimum(index, len(commands) - 1)]


def bench_run(name: str, time_s: np.ndarray, commands: np.ndarray, speed: np.ndarray) -> Run:
    """Return a bench run of commands (m,) given every 0.1 s."""
    command = BenchCommand(held_at(time_s, commands))
    return Run(f"{name}.csv", "", "fit", time_s, command, {"speed_rpm": speed})


def robot_run(name: str, time_s: np.ndarray, commands: np.ndarray, channels: Mapping[str, np.ndarray]) -> Run:
    """Return a robot run of commands (m, 3): V, theta, VC, given every 0.1 s."""
    return Run(f"{name}.csv", "", "fit", time_s, BodyCommand(*held_at(time_s, commands).T), channels)


def write_runs(runs: list[Run], folder: Path) -> None:
    """Write runs as a user would find them: CSV files and no dataset.toml."""
    for run in runs:
        write_run(run, folder / run.file)


def write_split(name: str, runs: list[Run], folder: Path) -> None:
    """Write runs with groups and splits; a run's file name up to the last "_" is its group."""
    groups = list(dict.fromkeys(run.file.rsplit("_", 1)[0] for run in runs))
    role = {g: ("fit", "validation", "fit", "test", "fit")[i % 5] for i, g in enumerate(groups)}
    stated = []
    for run in runs:
        group = run.file.rsplit("_", 1)[0]
        stated.append(Run(run.file, group, role[group], run.time_s, run.command, run.channels))
    write_dataset(Dataset(name, tuple(stated), ()), folder)
