"""Looking for the command sequence that tells most: the library first, then random changes of its best.

What a command sequence would tell: how far apart models' predictions of it are, in sigmas.

The distance is that of `sysid.compare.problem`: noise of repeats averaged, and what the model's own error,
or a change of the models' own parameters within what the logs so far allow, could make of it taken off. With
d the whitened difference of two predictions and X the columns of all these, scaled to a spread of 1, the
distance is d' (I + X X')^-1 d. Where several models are tied, the sequence of largest distance tells most
(T-optimal designs: Atkinson and Fedorov, Biometrika 62:57, 1975).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from mecanum_env.effects.apply import without_sensors
from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error import ModelError
from sysid.compare.noise import Noise
from sysid.compare.nuisance import plausible_models, shape_columns
from sysid.compare.observations import observe
from sysid.compare.prediction import POSE, Start, compile_for, motion_of, predict, sensor_readings
from sysid.compare.study import Study
from sysid.compare.whitening import Whitener
from sysid.gap.design.sequences import FIELD_M, Limits, changed, library
from sysid.logs import BenchCommand, BodyCommand, Command, Dataset, Run, WheelCommand
from sysid.logs.runs import Level


@dataclass(frozen=True)
class DesignEffort:
    """How much is simulated."""

    thorough: int
    """Sequences of the library that are judged with everything that could hide a difference."""
    rounds: int
    changes: int
    """Random changes a round."""


PLENTY: Final = 4.0
"""A sequence worth this much is not improved: its power is 1 but for a few in 100,000."""
EFFORT: Final[dict[Level, DesignEffort]] = {"bench": DesignEffort(16, 8, 6), "robot": DesignEffort(4, 2, 4)}


@dataclass(frozen=True, eq=False)
class JudgedSequence:
    """A sequence and how well it tells."""

    rows: FloatArray
    z: FloatArray
    """(p,), one a question: the answer is right with probability Phi(z)."""


Judge: TypeAlias = Callable[[FloatArray, bool], JudgedSequence | None]
"""Judges a sequence, thoroughly or not; None where its outcome cannot be predicted."""
Worth: TypeAlias = Callable[[JudgedSequence], float]
"""What a sequence is worth, on the scale of z."""


def search(
    limits: Limits,
    judge: Judge,
    worth_of: Callable[[Sequence[JudgedSequence]], Worth | None],
    effort: DesignEffort,
    *,
    seed: int = 0,
    jobs: int = 1,
) -> JudgedSequence | None:
    """Return the best sequence found; None where none is worth anything.

    Args:
        limits: of the robot.
        judge: of sequences; called from `jobs` threads.
        worth_of: says, from the library's best, what a sequence is worth; None if nothing is.
        effort: how much to simulate.
        seed: of the random sequences and changes.
        jobs: sequences judged at a time; changes the time taken, not the result.
    """
    rng = np.random.default_rng(seed)
    quick = _all(judge, library(limits, rng), False, jobs)
    if not quick or worth_of(quick) is None:
        return None
    promising, found = _promising(quick), list[JudgedSequence]()
    while promising and 2 * len(found) < effort.thorough:
        found += _all(judge, promising[: effort.thorough], True, jobs)
        del promising[: effort.thorough]
    worth = worth_of(found) if found else None
    if worth is None:
        return None
    best = max(found, key=worth)
    for _ in range(effort.rounds):
        if worth(best) >= PLENTY:
            break
        tried = [changed(best.rows, limits, rng) for _ in range(effort.changes)]
        new = _all(judge, [rows for rows in tried if rows is not None], True, jobs)
        best = max([best, *new], key=worth)
    return best


def _promising(found: Sequence[JudgedSequence]) -> list[FloatArray]:
    """Return the sequences in order: in turn, the best for the worst question and for each question."""
    every = np.array([j.z for j in found])
    orders = [np.argsort(-values, kind="stable") for values in (every.min(axis=1), *every.T)]
    chosen = dict.fromkeys(int(order[rank]) for rank in range(len(found)) for order in orders)
    return [found[i].rows for i in chosen]


def _all(judge: Judge, sequences: Sequence[FloatArray], thorough: bool, jobs: int) -> list[JudgedSequence]:
    if jobs == 1:
        found = [judge(rows, thorough) for rows in sequences]
    else:
        # Threads: MuJoCo lets go of the interpreter while it steps.
        with ThreadPoolExecutor(jobs) as pool:
            found = list(pool.map(lambda rows: judge(rows, thorough), sequences))
    return [judged for judged in found if judged is not None]


REPEATS: Final = 3
"""Times that an experiment is to be run."""
CLEARANCE_M: Final = 0.4
"""Of the robot's centre to the edge, on the path that a model predicts: half its diagonal and some air."""
FINEST_S: Final = 0.02
"""Samples closer than this count as their mean: a design needs no more, and is found sooner."""

PREDICTABLE: Final = 0.2
"""Root mean square, in sigmas, that a thousandth of the robot's mass may move a prediction by. Where wheels
spin, details decide, and no model is right: what a sequence seems to tell there is not to be had."""

CommandKind = Literal["bench", "body", "wheels"]
"""Columns of a log that hold the commands."""


@dataclass(frozen=True)
class ExperimentConditions:
    """How the next logs will be recorded and judged."""

    kind: CommandKind
    channels: tuple[str, ...]
    """Measured, by the columns of a log."""
    interval_s: float
    """Between samples."""
    noise: Noise
    """Of single samples."""
    error: ModelError | None
    """Of the model itself."""
    inflation: float = 1.0
    """Of all variances, where the best fit leaves more than expected."""


class Trial:
    """One command sequence under a setting, ready to compare models on.

    Args:
        base: the model under study, whose own error counts.
        rows: the sequence, as `sysid.gap.design.sequences` has it.
        setting: how it will be recorded.
        rough: simulate the robot with twice the physics step, in half the time.
    """

    def __init__(
        self, base: Model, rows: FloatArray, setting: ExperimentConditions, *, rough: bool = False
    ) -> None:
        self.base, self.setting = base, setting
        self._timestep_s = TRAINING_TIMESTEP_S if rough else None
        step = max(setting.interval_s, FINEST_S)
        count = round(len(rows) * base.wheel.command_period_s / step)
        time = np.asarray(np.arange(count + 1) * step, float)
        self.run = self._run(command_of(rows, base, setting.kind, time), time, setting.channels)
        runs = tuple(self.run for _ in range(REPEATS))
        self.observations = observe(Dataset("next experiment", runs, ()))
        fewer = math.sqrt(setting.interval_s / step)
        sigma = {name: v if name in POSE else v * fewer for name, v in setting.noise.sigma.items()}
        self.whitener = Whitener(self.observations, replace(setting.noise, sigma=sigma), setting.error)
        shapes = shape_columns(base, setting.error, self.observations)
        columns = [self.whitener.whiten(parts) for parts in shapes]
        self.own = np.stack(columns, axis=1) if columns else np.zeros((self.whitener.size, 0))
        """Columns of the model's own error (N, q): its shape; `with_law` adds the law's."""

    def channels_of(self, model: Model) -> dict[str, FloatArray] | None:
        """Return what a model predicts at the run's rows, the pose always among it on the robot.

        None where it cannot be simulated or leaves the field.

        Args:
            model: wheel, robot and effects.
        """
        try:
            if self.run.level == "bench":
                return predict(model, self.run, Start())
            posed = self._run(self.run.command, self.run.time_s, (*self.setting.channels, *POSE))
            physics = without_sensors(model)
            compiled = compile_for(physics, "robot", Study(timestep_s=self._timestep_s))
            channels = sensor_readings(model, posed, Start(), motion_of(physics, posed, Start(), compiled))
        except MecanumError:
            return None
        away = max(float(np.max(np.abs(channels[name]))) for name in ("x_m", "y_m"))
        return channels if away <= 0.5 * FIELD_M - CLEARANCE_M else None

    def whitened(self, model: Model) -> FloatArray | None:
        """Return a model's prediction in sigmas (N,); None where `channels_of` is.

        Args:
            model: wheel, robot and effects.
        """
        channels = self.channels_of(model)
        if channels is None:
            return None
        measured = {name: channels[name] for name in self.setting.channels}
        return self.whitener.whiten([block.of(self.run, measured) for block in self.observations.blocks])

    def predictable(self, model: Model, prediction: FloatArray) -> bool:
        """Return whether a model's prediction does not hang on details; see `PREDICTABLE`.

        Args:
            model: wheel, robot and effects.
            prediction: its own, whitened (N,).
        """
        if self.run.level == "bench":
            return True
        robot = replace(model.robot, mass_kg=1.001 * model.robot.mass_kg)
        other = self.whitened(replace(model, robot=robot))
        return other is not None and float(np.sqrt(np.mean((other - prediction) ** 2))) <= PREDICTABLE

    def with_law(self, base: FloatArray) -> None:
        """Add the columns of the base model's own parameters to `own`.

        Args:
            base: its whitened prediction (N,).
        """
        columns = self.columns(base, plausible_models(self.base))
        self.own = np.concatenate([self.own, columns], axis=1)

    def columns(self, at: FloatArray, moved: Sequence[Model]) -> FloatArray:
        """Return how the predictions of models moved by one sigma differ from that of one, (N, p).

        Args:
            at: whitened prediction of the one that they were moved from (N,).
            moved: those that cannot be simulated are left out.
        """
        found = [other - at for other in map(self.whitened, moved) if other is not None]
        return np.stack(found, axis=1) if found else np.zeros((at.size, 0))

    def square(self, difference: FloatArray, *hidden: FloatArray) -> float:
        """Return the square sum of a difference (N,) that `own` and other columns (N, p) cannot explain.

        Args:
            difference: of two whitened predictions.
            hidden: columns of the models' own parameters.
        """
        x = np.concatenate([self.own, *hidden], axis=1)
        along = x.T @ difference
        left = difference @ difference - along @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, along)
        return max(0.0, float(left)) / self.setting.inflation

    @staticmethod
    def _run(command: Command, time: FloatArray, channels: Sequence[str]) -> Run:
        nothing = np.zeros(time.size)
        return Run("next", "next", "fit", time, command, dict.fromkeys(channels, nothing))


def command_of(rows: FloatArray, base: Model, kind: CommandKind, time_s: FloatArray | None = None) -> Command:
    """Return a sequence as the commands of a log, one a command period, or held at the stamps of a log.

    Args:
        rows: (n, 1) on the bench, (n, 3) on the robot.
        base: whose command period and quantum count.
        kind: which columns the platform takes.
        time_s: stamps of the log (m,) [s].
    """
    if time_s is not None:
        index = np.floor(time_s / base.wheel.command_period_s + 1e-9).astype(int)
        rows = rows[np.clip(index, 0, len(rows) - 1)]
    if kind == "bench":
        return BenchCommand(rows[:, 0])
    if kind == "body":
        return BodyCommand(*rows.T)
    wheels, quantum = command_to_wheels(*rows.T), base.wheel.command_quantum_rpm
    return WheelCommand(np.rint(wheels / quantum) * quantum if quantum else wheels)
