"""Bench logs of a drive: effect-free ones for the model, and those of a case."""

from __future__ import annotations

import json
import zlib
from pathlib import Path

import numpy as np

from . import bench_commands
from .bench import simulate
from .drive import DRIVES, Hidden
from .logs import bench_run, write_runs, write_split

REPEATS = 3


def write_nominal(plant: str, folder: Path) -> None:
    """Write effect-free logs of a drive with splits, and the robot section that goes with it."""
    rng = np.random.default_rng([101, zlib.crc32(plant.encode())])
    commands = np.concatenate([bench_commands.rich(rng) for _ in range(2)])
    write_split(f"{plant}, nothing hidden", _runs(plant, Hidden(), commands, rng), folder / "logs")
    (folder / "robot.json").write_text(json.dumps(DRIVES[plant].robot()), encoding="utf-8")


def write_case(plant: str, hidden: Hidden, gentle: bool, rng: np.random.Generator, folder: Path) -> None:
    """Write the logs of a drive with something hidden."""
    commands = bench_commands.gentle(rng) if gentle else bench_commands.rich(rng)
    write_runs(_runs(plant, hidden, commands, rng), folder)


def _runs(plant: str, hidden: Hidden, commands: np.ndarray, rng: np.random.Generator) -> list:
    time_s, speeds = simulate(DRIVES[plant], hidden, np.repeat(commands, REPEATS, axis=0), rng)
    return [
        bench_run(f"run_{row // REPEATS:02d}_{row % REPEATS + 1}", time_s, commands[row // REPEATS], speed)
        for row, speed in enumerate(speeds)
    ]
