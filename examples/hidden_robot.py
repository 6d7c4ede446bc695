"""The robot of `examples/close_the_loop.py`: it makes logs and fights; its parameters stay in this file.

Its wheel is logged on the bench, with the bench's own motor driver. Then the robot is built, and two effects
appear that nobody wrote down (`_HIDDEN`). The host logs its commands, the encoders and the pose and velocity
from motion capture. Other files get CSV files, the outcomes of fights, and for `examples/onto_a_robot.py` its
packets, nothing else.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Model, paper_model, write_model
from mecanum_env.simulator import BodyCommands, RobotPlant, compile_plant, drive, replay_bench
from mecanum_env.units import FloatArray
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, Split
from sysid.logs.writer import write_dataset
from training.evaluate import Evaluation, Job, Setup, controller_factory, evaluate_controller

_BUILT: Final = paper_model()
_HIDDEN: Final = _BUILT.with_effect("command_latency", delay_s=0.1).with_effect(
    "direction_asymmetry", reverse_ratio=0.8
)
"""The radio delays every command by a command period, and the motor drivers are weaker in reverse."""
_NOISE: Final = {"speed": 0.5, "v": 0.005, "yaw_rate": 0.01, "x": 0.002, "y": 0.002, "yaw": 0.002}
"""Prefix of channel names -> standard deviation of noise in the channel's unit; the longest prefix counts."""
SEED: Final = 5050
REPEATS: Final = 2
COMMAND_S, SAMPLE_S = 0.1, 0.01
SPLITS: Final[tuple[Split, ...]] = ("fit", "validation", "fit", "test", "fit", "fit", "validation", "test")
"""Splits of the command sequences, in their order."""
FIRST_SEED: Final = 20_000
"""First seed of its fights: no certificate and no training uses these seeds."""


@dataclass(frozen=True)
class Fights(Job):
    """Fights of a controller on the hidden robot; the model in `setup` is what the controller knows."""

    def play(self) -> Evaluation:
        """Play the fights."""
        known = self.setup.model
        setup = replace(self.setup, model=_HIDDEN, known=known)
        seeds = range(FIRST_SEED, FIRST_SEED + self.episodes)
        return evaluate_controller(controller_factory(self.controller, known), setup, seeds)


def fights(controller: str, known: Model, episodes: int, plant: RobotPlant) -> Fights:
    """Return fights on the hidden robot, ready to be played.

    Args:
        controller: name or path; see `training.controllers.named.make_controller`.
        known: the robot as the controller knows it.
        episodes: number of fights.
        plant: simulated system of the hidden robot.
    """
    return Fights("the robot itself", controller, Setup(known, plant), episodes)


def write_bench_logs(folder: Path) -> None:
    """Write logs of one wheel on the bench, before the robot was built: eight sequences of 3 s."""
    rng = np.random.default_rng([SEED, 1])
    steps = [[20, 60, 100, 125], [-30, -70, -110, -15], [60, -60, 100, -100], [5, -8, 12, -20]]
    sequences = [_held(levels, 7) for levels in steps]
    sequences += [_held(rng.integers(-125, 126, 29 // hold), hold) for hold in (3, 4, 5, 7)]
    runs = []
    for number, sequence in enumerate(sequences):
        time_s = _clock(len(sequence))
        command = sequence[_row_of(time_s, len(sequence))]
        true = {"speed_rpm": replay_bench(_BUILT, time_s, command)}
        runs += _repeats(number, time_s, BenchCommand(command), true, rng)
    write_dataset(Dataset("one wheel on the bench", tuple(runs), ()), folder)


def write_robot_logs(folder: Path, plant: RobotPlant) -> None:
    """Write logs of the robot, simulated on a plant, to a folder: eight sequences of 3 s.

    It drives ahead, sideways and diagonally, turns, and does several at a time.
    """
    rng = np.random.default_rng([SEED, 2])
    plans = [
        [(25, 0, 0), (60, 0, 0), (95, 0, 0), (40, 180, 0), (85, 180, 0)],
        [(30, 90, 0), (70, 90, 0), (50, -90, 0), (85, -90, 0)],
        [(40, 45, 0), (80, 45, 0), (60, -135, 0), (50, 135, 0), (75, -45, 0)],
        [(60, 30, 0), (80, -150, 20), (35, 90, -30), (70, 180, 0), (20, 0, 40)],
        [(0, 0, 20), (0, 0, 50), (0, 0, -35), (0, 0, -60)],
    ]
    plans += [[_random_level(rng) for _ in range(count)] for count in (5, 6, 7)]
    robot = compile_plant(_HIDDEN, plant)
    runs = []
    for number, plan in enumerate(plans):
        sequence = _held(plan, 29 // len(plan))
        sent = np.arange(len(sequence)) * COMMAND_S
        time_s = _clock(len(sequence))
        commands = BodyCommands(sent, *sequence.T)
        driven = drive(_HIDDEN, commands, float(time_s[-1]), plant=plant, mj_model=robot)
        command = BodyCommand(*sequence[_row_of(time_s, len(sequence))].T)
        runs += _repeats(number, time_s, command, driven.channels_at(time_s), rng)
    write_dataset(Dataset("the robot, on the floor", tuple(runs), ()), folder)


@contextmanager
def served() -> Iterator[str]:
    """Serve the hidden robot over UDP from a process of its own, in step with its controller; yield its name.

    Its link is 10 ms late each way, 2 ms more or less, and loses every fiftieth packet.
    """
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "model.json"
        write_model(_HIDDEN, model)
        command = [sys.executable, "-m", "training.run.simulated_robot", "--model", str(model), "--port", "0"]
        command += ["--first-seed", str(FIRST_SEED), "--in-step"]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as robot:
            try:
                assert robot.stdout is not None
                yield robot.stdout.readline().strip()
            finally:
                robot.terminate()


def reveal() -> dict[str, dict[str, float]]:
    """Return the hidden effects with their parameters, for the last line that is printed."""
    return {name: dict(values) for name, values in _HIDDEN.effects.items()}


def _repeats(
    number: int,
    time_s: FloatArray,
    command: BenchCommand | BodyCommand,
    true: dict[str, FloatArray],
    rng: np.random.Generator,
) -> list[Run]:
    """Return the repeats of a command sequence: the true channels with noise, rounded to five digits."""
    name = f"run_{number:02d}"
    runs = []
    for repeat in range(1, REPEATS + 1):
        measured = {
            channel: np.round(values + _noise(channel) * rng.standard_normal(values.size), 5)
            for channel, values in true.items()
        }
        runs.append(Run(f"{name}_{repeat}.csv", name, SPLITS[number], time_s, command, measured))
    return runs


def _noise(channel: str) -> float:
    return max(((len(start), std) for start, std in _NOISE.items() if channel.startswith(start)))[1]


def _clock(commands: int) -> FloatArray:
    return np.round(np.arange(round(commands * COMMAND_S / SAMPLE_S) + 1) * SAMPLE_S, 3)


def _row_of(time_s: FloatArray, commands: int) -> npt.NDArray[np.intp]:
    """Return the index of the command that is held at each time."""
    return np.minimum(np.floor(time_s / COMMAND_S + 1e-6).astype(int), commands - 1)


def _held(levels: Sequence[object] | npt.NDArray[np.int_], commands: int) -> FloatArray:
    """Return one command per 0.1 s: rest, then each level for a number of commands, the last until 3 s."""
    rows = np.repeat(np.array(levels, float), commands, axis=0)
    rest = np.zeros((1, *rows.shape[1:]))
    left = 30 - 1 - len(rows)
    return np.concatenate([rest, rows, np.repeat(rows[-1:], left, axis=0)])


def _random_level(rng: np.random.Generator) -> tuple[int, int, int]:
    return int(rng.integers(15, 75)), int(rng.integers(-12, 13)) * 15, int(rng.integers(-35, 36))
