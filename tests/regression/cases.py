"""Cases of the package's own robot: what is changed, what that is called, and how the logs are replayed."""

from __future__ import annotations

import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mecanum_env.model import Model
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.units import FloatArray
from sysid.logs import BodyCommand, Dataset, Run, read_dataset
from sysid.logs.noise import noise_from_repeats
from sysid.logs.writer import write_run

from .own_robots import COMMAND_S, Changes, nominal, simulate

COMMANDS = 30
REPEATS = 2


@dataclass(frozen=True)
class Case:
    """One change of the robot."""

    name: str
    changes: Changes = field(default_factory=Changes)
    truth: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Effect -> parameter -> true value, where the catalogue has the effect."""
    gentle: bool = False
    """Drive straight and slowly, which leaves much untested."""


CASES = {
    case.name: case
    for case in (
        Case("quiet"),
        Case("turned_sensor", Changes(turned_deg=10.0), {"mount_yaw": {"angle_deg": 10.0}}),
        Case("late_log", Changes(log_late_s=0.05), {"sensor_latency": {"delay_s": 0.05}}),
        Case("weak_motor", Changes(weak_front_left=0.85), {"wheel_gain_mismatch": {"gain_fl": 0.85}}),
        Case("slow_wheels", Changes(wheel_top_rpm=60.0), {"speed_saturation": {"limit_rpm": 60.0}}),
        Case("rough_rollers", Changes(roller_drag_n_m=0.08), {"roller_friction": {"torque_n_m": 0.08}}),
        Case("smooth_floor", Changes(grip=0.12), {"low_grip": {"friction": 0.12}}),
        Case("load", Changes(load_kg=12.0), {"payload": {"mass_kg": 12.0}}),
        Case(
            "slow_wheels_turned_sensor",
            Changes(wheel_top_rpm=60.0, turned_deg=10.0),
            {"speed_saturation": {"limit_rpm": 60.0}, "mount_yaw": {"angle_deg": 10.0}},
        ),
        Case("wind", Changes(wind_n=25.0)),
        Case("wide_robot_driven_straight", Changes(arms=1.15), {"track_width": {"scale": 1.15}}, gentle=True),
    )
}


def logs_of(case: Case, folder: Path, sequences: int | None = None) -> Dataset:
    """Write the logs of a case to a folder, as CSV files alone, and read them as a user's logs are read.

    With a number of `sequences` only the first ones are driven.
    """
    rng = np.random.default_rng(zlib.crc32(case.name.encode()))
    for number, rows in enumerate((_straight(rng) if case.gentle else _rich(rng))[:sequences]):
        time_s, repeats = simulate(case.changes, rows, rng.spawn(REPEATS))
        held = rows[np.minimum(np.floor(time_s / COMMAND_S + 1e-6).astype(int), COMMANDS - 1)]
        for k, channels in enumerate(repeats, 1):
            run = Run(f"run_{number:02d}_{k}.csv", "", "fit", time_s, BodyCommand(*held.T), channels)
            write_run(run, folder / run.file)
    return read_dataset(folder)


def true_model(case: Case) -> Model:
    """Return the nominal model with the effects of a case at their true values."""
    model = nominal()
    for name, values in case.truth.items():
        model = model.with_effect(name, **values)
    return model


def misfit(model: Model, dataset: Dataset) -> float:
    """Return the rms of measured minus simulated, all channels together, over the noise of repeats."""
    noise = noise_from_repeats(dataset.runs) or {}
    squares: list[FloatArray] = []
    for runs in dataset.groups().values():
        predicted = _replayed(model, runs[0])
        for run in runs:
            squares += [
                ((run.channels[name] - predicted[name]) / noise[name].std) ** 2 for name in run.channels
            ]
    return math.sqrt(float(np.mean(np.concatenate(squares))))


def _replayed(model: Model, run: Run) -> dict[str, FloatArray]:
    assert isinstance(run.command, BodyCommand)
    commands = BodyCommands(run.time_s, run.command.v_rpm, run.command.theta_deg, run.command.vc_rpm)
    return drive(model, commands, run.duration_s).channels_at(run.time_s)


def _rich(rng: np.random.Generator) -> list[FloatArray]:
    """Return eight sequences, each (COMMANDS, 3): along, across, diagonal, turning, mixed, slow and fast."""
    a, b = (int(v) for v in rng.integers(-8, 9, 2))
    rows = [
        [(20, 0, 0), (60 + a, 0, 0), (95, 0, 0), (30, 180, 0), (80, 180, 0), (0, 0, 0)],
        [(25, 90, 0), (70 + b, 90, 0), (40, -90, 0), (85, -90, 0), (6, 90, 0), (12, -90, 0)],
        [(40, 45, 0), (80 + a, 45, 0), (60, -135, 0), (50, 135, 0), (75, -45, 0), (20, 30, 0)],
        [(0, 0, 15), (0, 0, 45 + b), (0, 0, -30), (0, 0, -60), (0, 0, 5), (0, 0, 20)],
        [(5, 0, 0), (3, 90, 0), (9, 180, 0), (13, -90, 0), (7, 45, 0), (0, 0, 8)],
        *([_any(rng) for _ in range(count)] for count in (6, 7, 9)),
    ]
    return [_held(levels) for levels in rows]


def _straight(rng: np.random.Generator) -> list[FloatArray]:
    """Return six sequences, forward and gentle: they show neither turning, nor sideways motion, nor slip."""
    return [_held([(level, 0, 0) for level in np.cumsum(rng.integers(5, 13, 5)).tolist()]) for _ in range(6)]


def _any(rng: np.random.Generator) -> tuple[int, int, int]:
    return int(rng.integers(10, 70)), int(rng.integers(-12, 13)) * 15, int(rng.integers(-35, 36))


def _held(levels: list[tuple[int, int, int]]) -> FloatArray:
    """Return a command at rest, then each level held alike; the last goes on."""
    hold = (COMMANDS - 1) // len(levels)
    rows = np.concatenate([[(0, 0, 0)], np.repeat(np.array(levels), hold, axis=0)]).astype(float)
    return np.concatenate([rows, np.repeat(rows[-1:], COMMANDS - len(rows), axis=0)])
