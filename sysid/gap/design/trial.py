"""Trials of command sequences: what one sequence would tell, and the search for the one that tells most.

What a sequence tells about two models is how far apart their predictions of it are, in standard deviations of
the noise. The distance is that of `sysid.compare.least_squares.problem`: repeats are averaged, and what the
model's own error, or a change of the models' parameters within what the logs so far allow, could produce is
taken off. With d the whitened difference of two predictions and X the columns of those errors, each scaled to
a standard deviation of 1, the squared distance is d' (I + X X')^-1 d. If several models are tied, the
sequence of largest distance tells most (T-optimal designs: Atkinson and Fedorov, Biometrika 62:57, 1975).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal, TypeAlias

import numpy as np

from mecanum_env.effects.apply import sensors_of, without_sensors
from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import POSE, command_to_wheels
from mecanum_env.mjcf.physics import TRAINING_TIMESTEP_S
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start, observe
from sysid.compare.model_error import ModelError, Whitener, plausible_models, shape_columns
from sysid.compare.noise import Noise
from sysid.compare.predicted import SimulationSettings, motion_of, readings
from sysid.gap.design.limits import Limits
from sysid.gap.design.sequences import FIELD_M, changed, library
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs import BenchCommand, BodyCommand, Command, Dataset, Run, WheelCommand
from sysid.logs.runs import Level

REPEATS: Final = 3
"""How often an experiment is to be run."""
_CLEARANCE_M: Final = 0.4
"""Least distance of the robot's centre to the edge [m], on the path that a model predicts: half the robot's
diagonal and a margin."""
_FINEST_S: Final = 0.02
"""Shortest sample interval that is simulated [s]: finer samples are replaced by their means, for speed."""
_PREDICTABLE: Final = 0.2
"""Rms change of a prediction, in noise standard deviations, that a change of the robot's mass by 1/1000 may
cause. Beyond it wheels slip, where details decide and no model is right: differences there tell nothing."""
_GOOD_ENOUGH: Final = 4.0
"""z from which a sequence is not improved further: its power is 1 but for a few in 100,000."""

CommandKind = Literal["bench", "body", "wheels"]
"""Which columns of a log hold the commands."""


@dataclass(frozen=True)
class ExperimentConditions:
    """How the next logs will be recorded and judged."""

    kind: CommandKind
    channels: tuple[str, ...]
    """Measured columns of the log."""
    interval_s: float
    """Time between samples [s]."""
    noise: Noise
    """Noise of single samples."""
    error: ModelError | None
    """Error of the model itself, as its file states it."""
    limits: Limits
    """Commands that the platform takes."""
    settings: SimulationSettings
    """Plant, time step, seed and jobs of the simulations, and the scale of the catalogue's bounds."""
    inflation: float = 1.0
    """Factor on all variances: residual variance of the best fit relative to the expected one."""
    formula_error: float = THRESHOLDS.formula_error
    """Relative error (rms) that the formula of an effect may have."""

    @property
    def level(self) -> Level:
        """Level of the logs."""
        return "bench" if self.kind == "bench" else "robot"


class Trial:
    """One command sequence under given conditions, on which models are compared.

    Args:
        base: the model under study, whose own error counts.
        rows: the sequence, as `sysid.gap.design.sequences` defines it.
        conditions: how it will be recorded.
        coarse: simulate a robot on rollers with twice the physics step, in half the time.
    """

    def __init__(
        self, base: Model, rows: FloatArray, conditions: ExperimentConditions, *, coarse: bool = False
    ) -> None:
        self.base, self.conditions = base, conditions
        self._settings = conditions.settings
        slow = conditions.level == "robot" and self._settings.plant == "rollers"
        if coarse and slow and self._settings.timestep_s is None:
            self._settings = replace(self._settings, timestep_s=TRAINING_TIMESTEP_S)
        step = max(conditions.interval_s, _FINEST_S)
        samples = round(len(rows) * conditions.limits.period_s / step)
        time = np.asarray(np.arange(samples + 1) * step, float)
        self.run = self._run(command_of(rows, conditions, time), time, conditions.channels)
        self.observations = observe(Dataset("next experiment", (self.run,) * REPEATS, ()))
        averaging = math.sqrt(conditions.interval_s / step)
        sigma = {
            name: value if name in POSE else value * averaging
            for name, value in conditions.noise.sigma.items()
        }
        noise = replace(conditions.noise, sigma=sigma)
        self.whitener = Whitener(self.observations, noise, conditions.error)
        shapes = shape_columns(base, conditions.error, self.observations)
        columns = [self.whitener.whiten(parts) for parts in shapes]
        self.nuisance = np.stack(columns, axis=1) if columns else np.zeros((self.whitener.size, 0))
        """Columns of the model's own error (N, q): the shape of its response; `add_law_columns` adds more."""

    def predict(self, model: Model) -> dict[str, FloatArray] | None:
        """Return what a model predicts: channel -> values at the run's rows; on the robot also the pose.

        Returns:
            None if the model cannot be simulated or leaves the field.
        """
        run, physics = self.run, without_sensors(model)
        if run.level == "robot":
            run = self._run(run.command, run.time_s, (*self.conditions.channels, *POSE))
        try:
            motion = motion_of(physics, run, Start(), self._settings)
            channels = readings(motion.seen_by(sensors_of(model)), run, Start())
        except MecanumError:
            return None
        if run.level == "bench":
            return channels
        farthest = max(float(np.max(np.abs(channels[name]))) for name in ("x_m", "y_m"))
        return channels if farthest <= 0.5 * FIELD_M - _CLEARANCE_M else None

    def whitened(self, model: Model) -> FloatArray | None:
        """Return a model's whitened prediction (N,); None if `predict` returns None."""
        channels = self.predict(model)
        if channels is None:
            return None
        measured = {name: channels[name] for name in self.conditions.channels}
        return self.whitener.whiten(self.observations.predicted([measured]))

    def predictable(self, model: Model, prediction: FloatArray) -> bool:
        """Return whether a model's whitened prediction (N,) is robust to details; see `_PREDICTABLE`."""
        if self.run.level == "bench":
            return True
        robot = replace(model.robot, mass_kg=1.001 * model.robot.mass_kg)
        other = self.whitened(replace(model, robot=robot))
        return other is not None and float(np.sqrt(np.mean((other - prediction) ** 2))) <= _PREDICTABLE

    def add_law_columns(self, prediction: FloatArray) -> None:
        """Add the columns of the base model's uncertain parameters to `nuisance`.

        `prediction` is the whitened prediction of the base model (N,).
        """
        columns = self.differences(prediction, plausible_models(self.base))
        self.nuisance = np.concatenate([self.nuisance, columns], axis=1)

    def differences(self, prediction: FloatArray, models: Sequence[Model]) -> FloatArray:
        """Return how whitened predictions of models differ from a given prediction (N,), shape (N, p).

        A model that cannot be simulated is left out.
        """
        found = [other - prediction for other in map(self.whitened, models) if other is not None]
        return np.stack(found, axis=1) if found else np.zeros((prediction.size, 0))

    def squared_distance(self, difference: FloatArray, *hidden: FloatArray) -> float:
        """Return the part of a squared difference (N,) that `nuisance` and `hidden` columns cannot explain.

        Hidden are columns of the models' own parameters, each (N, p).
        """
        x = np.concatenate([self.nuisance, *hidden], axis=1)
        along = x.T @ difference
        left = difference @ difference - along @ np.linalg.solve(np.eye(x.shape[1]) + x.T @ x, along)
        return max(0.0, float(left)) / self.conditions.inflation

    @staticmethod
    def _run(command: Command, time: FloatArray, channels: Sequence[str]) -> Run:
        return Run("next", "next", "fit", time, command, dict.fromkeys(channels, np.zeros(time.size)))


def command_of(
    rows: FloatArray, conditions: ExperimentConditions, time_s: FloatArray | None = None
) -> Command:
    """Return a sequence as the commands of a log: one per row, or held at stamps `time_s` (m,).

    Rows have the shape (n, 1) on the bench and (n, 3) on the robot.
    """
    if time_s is not None:
        index = np.floor(time_s / conditions.limits.period_s + 1e-9).astype(int)
        rows = rows[np.clip(index, 0, len(rows) - 1)]
    if conditions.kind == "bench":
        return BenchCommand(rows[:, 0])
    if conditions.kind == "body":
        return BodyCommand(*rows.T)
    wheels, quantum = command_to_wheels(*rows.T), conditions.limits.quantum_rpm
    return WheelCommand(np.rint(wheels / quantum) * quantum if quantum else wheels)


@dataclass(frozen=True)
class DesignEffort:
    """How much the search for a sequence simulates."""

    thorough: int
    """Sequences of the library that are judged thoroughly."""
    rounds: int
    """Rounds of random changes to the best sequence."""
    changes: int
    """Random changes per round."""


EFFORT: Final[dict[Level, DesignEffort]] = {"bench": DesignEffort(16, 8, 6), "robot": DesignEffort(4, 2, 4)}


@dataclass(frozen=True, eq=False)
class JudgedSequence:
    """A sequence and how well it answers the questions of an experiment."""

    rows: FloatArray
    z: FloatArray
    """For each question: the answer is right with probability Phi(z); shape (p,)."""


Judge: TypeAlias = Callable[[Trial, bool], FloatArray | None]
"""Returns z of a trial, judged thoroughly or not; None if its outcome cannot be predicted."""
Value: TypeAlias = Callable[[JudgedSequence], float]
"""What is maximised, on the scale of z."""


def best_sequence(
    base: Model,
    conditions: ExperimentConditions,
    judge: Judge,
    value_of: Callable[[Sequence[JudgedSequence]], Value | None],
) -> JudgedSequence | None:
    """Return the best sequence found; None if none is of any value.

    All sequences of the library are judged quickly, the promising ones thoroughly; the best is then improved
    by random changes.

    Args:
        base: the model under study.
        conditions: how the experiment will be recorded; its settings have the seed of the random sequences.
        judge: judges the trial of one sequence; called from `settings.jobs` threads.
        value_of: derives from the library's judged sequences the value to maximise; None if there is none.
    """
    settings, limits = conditions.settings, conditions.limits
    rng, effort = np.random.default_rng(settings.seed), EFFORT[limits.level]

    def judge_all(sequences: Sequence[FloatArray], thorough: bool) -> list[JudgedSequence]:
        def z_of(rows: FloatArray) -> FloatArray | None:
            return judge(Trial(base, rows, conditions, coarse=not thorough), thorough)

        found = settings.map(z_of, sequences)
        return [JudgedSequence(rows, z) for rows, z in zip(sequences, found, strict=True) if z is not None]

    quick = judge_all(library(limits, rng), False)
    if not quick or value_of(quick) is None:
        return None
    promising, found = _promising(quick), list[JudgedSequence]()
    while promising and 2 * len(found) < effort.thorough:
        found += judge_all(promising[: effort.thorough], True)
        del promising[: effort.thorough]
    value = value_of(found) if found else None
    if value is None:
        return None
    best = max(found, key=value)
    for _ in range(effort.rounds):
        if value(best) >= _GOOD_ENOUGH:
            break
        tried = [changed(best.rows, limits, rng) for _ in range(effort.changes)]
        best = max([best, *judge_all([rows for rows in tried if rows is not None], True)], key=value)
    return best


def _promising(judged: Sequence[JudgedSequence]) -> list[FloatArray]:
    """Return the sequences, best first: in turn the next best by the lowest z and by each question's z."""
    z = np.array([one.z for one in judged])
    orders = [np.argsort(-values, kind="stable") for values in (z.min(axis=1), *z.T)]
    chosen = dict.fromkeys(int(order[rank]) for rank in range(len(judged)) for order in orders)
    return [judged[i].rows for i in chosen]
