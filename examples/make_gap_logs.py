"""Make `examples/gap_logs`: the wheel of `examples/logs` after something was changed that nobody wrote down.

    python examples/make_gap_logs.py

The motor, the gear and the PID are those of `examples/logs` (`sysid.studies.target_system`). Before a command
reaches the PID, two things now happen to it, as in many motor drivers:

- a command nearer to zero than `DEAD_BAND_RPM` is treated as zero, as for a joystick near its centre;
- the result is limited in its rate of change to `RAMP_RPM_S`, to protect the gear.

The host logs the commands that it sent and knows of neither. There are eight command sequences of 2 to 4 s
(steps, reversals, slow and random ones), each repeated three times and logged at 100 Hz with 0.5 rpm noise.
Every run of this program writes the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, Dataset, Run, Split
from sysid.logs.writer import write_dataset
from sysid.studies.target_system import TargetSystem, simulate_target

DEAD_BAND_RPM = 12.5
"""Hidden dead band [rpm]; between two whole numbers, since commands are whole rpm."""
RAMP_RPM_S = 900.0
"""Hidden largest rate of change of the command that reaches the PID [rpm/s]."""
SEED = 4040
REPEATS = 3
FOLDER = Path(__file__).parent / "gap_logs"
TICK_S = 0.001
"""Period of the PID, which is also that of the ramp [s]."""
COMMAND_S = 0.1
"""Period of the host's commands [s]."""


def commands(rng: np.random.Generator) -> list[tuple[str, Split, FloatArray]]:
    """Return name, split and commands [rpm] of each sequence, one command per `COMMAND_S`.

    The random sequences are drawn with `rng`.
    """
    return [
        ("steps", "fit", held([20, 60, 100, 130], 6)),
        ("back_and_forth", "fit", held([60, -60, 100, -100, 30, -30], 5)),
        ("slow", "fit", held([2, 5, -3, 8, -6, 12, -10, 20, -25, 15], 3)),
        ("random_a", "fit", held(rng.integers(-130, 131, 9), 4)),
        ("random_b", "validation", held(rng.integers(-130, 131, 9), 4)),
        ("slow_again", "validation", held([-4, 9, 14, -18, 24, -8, 11, -22, 28, 6], 3)),
        ("random_c", "test", held(rng.integers(-130, 131, 9), 4)),
        ("staircase", "test", held([-10, -30, -80, -120, -40, 15], 5)),
    ]


def held(levels_rpm: Sequence[int] | npt.NDArray[np.int_], periods: int) -> FloatArray:
    """Return 0.2 s of rest, each level held for a number of command periods, and 0.3 s of rest."""
    return np.concatenate([np.zeros(2), np.repeat(np.asarray(levels_rpm, float), periods), np.zeros(3)])


def changed(sent_rpm: FloatArray) -> FloatArray:
    """Return the commands that reach the PID for the commands sent, both one value per tick."""
    wanted = np.where(np.abs(sent_rpm) < DEAD_BAND_RPM, 0.0, sent_rpm)
    step = RAMP_RPM_S * TICK_S
    seen = np.empty(wanted.size)
    now = 0.0
    for tick, target in enumerate(wanted.tolist()):
        now += min(max(target - now, -step), step)
        seen[tick] = now
    return seen


def make_run(name: str, repeat: int, split: Split, command_rpm: FloatArray, rng: np.random.Generator) -> Run:
    """Drive the changed system and log it as a host would: what it sent, speeds to 0.01 rpm."""
    seen = changed(np.repeat(command_rpm, round(COMMAND_S / TICK_S)))
    record = simulate_target(seen, rng=rng, system=TargetSystem(command_period_s=TICK_S))
    rows = np.arange(record.time_s.size) // round(COMMAND_S / record.time_s[1])
    return Run(
        file=f"{name}_{repeat}.csv",
        group=name,
        split=split,
        time_s=np.round(record.time_s, 3),
        command=BenchCommand(command_rpm[np.minimum(rows, command_rpm.size - 1)]),
        channels={"speed_rpm": np.round(record.speed_rpm, 2)},
    )


def make_dataset() -> Dataset:
    """Return all runs."""
    rng = np.random.default_rng(SEED)
    runs = tuple(
        make_run(name, repeat, split, command, rng)
        for name, split, command in commands(rng)
        for repeat in range(1, REPEATS + 1)
    )
    return Dataset("one wheel on the bench, after a change", runs, ())


if __name__ == "__main__":
    write_dataset(make_dataset(), FOLDER)
    size = sum(file.stat().st_size for file in FOLDER.iterdir())
    print(f"{FOLDER}: {len(list(FOLDER.glob('*.csv')))} runs, {size / 1000:.0f} kB")
