"""Make `examples/logs`: bench logs of the target system, the same bytes at every run.

    python examples/make_example_logs.py

Runs to fit are steps of 10, 40, 80 and 130 rpm; runs to validate are steps of 20 and 100 rpm and a
random-hold sequence; runs to test are steps of 60 rpm and another sequence. Each is repeated three times,
begins with 0.2 s of rest, and is logged at 100 Hz with 0.5 rpm noise.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, Dataset, Run, Split
from sysid.logs.writer import write_dataset
from sysid.studies.target_system import simulate_target

SEED = 20240
REPEATS = 3
FOLDER = Path(__file__).parent / "logs"
STEPS: dict[int, Split] = {
    10: "fit",
    20: "validation",
    40: "fit",
    60: "test",
    80: "fit",
    100: "validation",
    130: "fit",
}


def step_command(speed_rpm: float) -> FloatArray:
    """Return 0.2 s of rest and 1.2 s of the speed, one command per 0.1 s."""
    return np.concatenate([np.zeros(2), np.full(12, float(speed_rpm))])


def random_hold_command(rng: np.random.Generator) -> FloatArray:
    """Return 5.2 s: five long holds (0.6-0.9 s) and five short ones (0.1-0.2 s), shuffled, one per 0.1 s.

    Long holds let the wheel settle, short ones do not. Speeds are whole rpm between -130 and 130.
    """
    while True:
        periods = np.concatenate([rng.integers(6, 10, 5), rng.integers(1, 3, 5)])
        if periods.sum() == 50:
            break
    rng.shuffle(periods)
    return np.concatenate([np.zeros(2), np.repeat(rng.integers(-130, 131, 10).astype(float), periods)])


def make_run(name: str, repeat: int, split: Split, command_rpm: FloatArray, rng: np.random.Generator) -> Run:
    """Drive the target system and log it as a host would, speeds to 0.01 rpm."""
    record = simulate_target(command_rpm, rng=rng)
    return Run(
        file=f"{name}_{repeat}.csv",
        group=name,
        split=split,
        time_s=np.round(record.time_s, 3),
        command=BenchCommand(record.command_rpm),
        channels={"speed_rpm": np.round(record.speed_rpm, 2)},
    )


def make_dataset() -> Dataset:
    """Return all runs."""
    rng = np.random.default_rng(SEED)
    plans: list[tuple[str, Split, FloatArray]] = [
        (f"step_{speed:03d}", split, step_command(speed)) for speed, split in STEPS.items()
    ]
    plans.append(("random_hold_a", "validation", random_hold_command(rng)))
    plans.append(("random_hold_b", "test", random_hold_command(rng)))
    runs = tuple(
        make_run(name, repeat, split, command, rng)
        for name, split, command in plans
        for repeat in range(1, REPEATS + 1)
    )
    return Dataset("example: one wheel on the bench, turning freely", runs, ())


if __name__ == "__main__":
    write_dataset(make_dataset(), FOLDER)
    size = sum(file.stat().st_size for file in FOLDER.iterdir())
    print(f"{FOLDER}: {len(list(FOLDER.glob('*.csv')))} runs, {size / 1000:.0f} kB")
