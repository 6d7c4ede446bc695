"""Robot logs: effect-free ones for the model, and those of a case."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from . import bench_commands
from .logs import bench_run, robot_run, write_runs, write_split
from .recipes import Fields
from .robot import HiddenRobot, lifted_wheel, nominal, simulate

SECONDS = 3.0
COMMANDS = round(SECONDS / 0.1)
REPEATS = 2


def rich(rng: np.random.Generator) -> list[np.ndarray]:
    """Return eight sequences, each (COMMANDS, 3): along, across, diagonal, turning, mixed, slow and fast."""
    a, b = (int(v) for v in rng.integers(-8, 9, 2))
    rows = [
        [(20, 0, 0), (60 + a, 0, 0), (95, 0, 0), (30, 180, 0), (80, 180, 0), (0, 0, 0)],
        [(25, 90, 0), (70 + b, 90, 0), (40, -90, 0), (85, -90, 0), (6, 90, 0), (12, -90, 0)],
        [(40, 45, 0), (80 + a, 45, 0), (60, -135, 0), (50, 135, 0), (75, -45, 0), (20, 30, 0)],
        [(0, 0, 15), (0, 0, 45 + b), (0, 0, -30), (0, 0, -60), (0, 0, 5), (0, 0, 20)],
        [(5, 0, 0), (3, 90, 0), (9, 180, 0), (13, -90, 0), (7, 45, 0), (0, 0, 8)],
        [_any(rng) for _ in range(6)],
        [_any(rng) for _ in range(7)],
        [_any(rng) for _ in range(9)],
    ]
    return [_held(levels) for levels in rows]


def straight(rng: np.random.Generator) -> list[np.ndarray]:
    """Return six sequences, forward and gentle: they show neither turning, nor sideways motion, nor slip."""
    return [_held([(level, 0, 0) for level in np.cumsum(rng.integers(5, 13, 5)).tolist()]) for _ in range(6)]


def write_nominal(plant: str, folder: Path) -> None:
    """Write effect-free logs with splits, and what a ruler and a scale tell of the robot.

    The model of "lifted" comes from the wheel off the floor, that of "driven" from the robot's own logs.
    """
    rng = np.random.default_rng([202, len(plant)])
    if plant == "driven":
        commands = rich(rng) + rich(rng)[5:] + rich(rng)[5:]
        runs = _runs(HiddenRobot(), commands, False, rng)
    else:
        rows = np.concatenate([bench_commands.rich(rng) for _ in range(2)])
        runs = []
        for number, row in enumerate(rows):
            time_s, speeds = lifted_wheel(row, rng.spawn(REPEATS))
            runs += [
                bench_run(f"run_{number:02d}_{k}", time_s, row, speed) for k, speed in enumerate(speeds, 1)
            ]
    write_split(f"robot, {plant}, nothing hidden", runs, folder / "logs")
    robot = nominal().robot
    known = {name: getattr(robot, name) for name in robot.__dataclass_fields__}
    (folder / "robot.json").write_text(json.dumps(known), encoding="utf-8")


def write_case(fields: Fields, gentle: bool, rng: np.random.Generator, folder: Path) -> None:
    """Write the logs of a robot with something hidden; every other one has the pose too."""
    hidden = replace(HiddenRobot(), **{**fields, "weak_motor": int(fields.get("weak_motor", 0))})
    pose = bool(rng.integers(2))
    write_runs(_runs(hidden, straight(rng) if gentle else rich(rng), pose, rng), folder)


def _runs(hidden: HiddenRobot, commands: list[np.ndarray], pose: bool, rng: np.random.Generator) -> list:
    runs = []
    for number, rows in enumerate(commands):
        time_s, repeats = simulate(hidden, rows, pose, rng.spawn(REPEATS))
        runs += [
            robot_run(f"run_{number:02d}_{k}", time_s, rows, logged) for k, logged in enumerate(repeats, 1)
        ]
    return runs


def _any(rng: np.random.Generator) -> tuple[int, int, int]:
    return int(rng.integers(10, 70)), int(rng.integers(-12, 13)) * 15, int(rng.integers(-35, 36))


def _held(levels: list[tuple[int, int, int]]) -> np.ndarray:
    """Return a command at rest, then each level held alike."""
    hold = (COMMANDS - 1) // len(levels)
    rows = np.concatenate([[(0, 0, 0)], np.repeat(np.array(levels), hold, axis=0)]).astype(float)
    return np.concatenate([rows, np.repeat(rows[-1:], COMMANDS - len(rows), axis=0)])
