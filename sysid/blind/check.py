"""Checks of the blind tests themselves: is each hidden effect large, and is ours the same.

Per case: the rms of measured minus simulated over the noise floor with the nominal model, and again with the
catalogue's effect at its true value. What that leaves is the second simulator's other mechanism.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from mecanum_env.model import Model
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from mecanum_env.units import FloatArray
from sysid.blind.case import BlindTests, Case
from sysid.logs import BodyCommand, Dataset, Run, read_dataset
from sysid.logs.noise import noise_from_repeats


@dataclass(frozen=True)
class Check:
    """One case replayed with the nominal model, and with the truth; in units of the noise floor."""

    case: Case
    before: float
    after: float
    """NaN where the catalogue has no counterpart."""

    @property
    def closure(self) -> float:
        """(before - after)/(before - 1), the floor being 1; NaN where there is nothing to close."""
        return (self.before - self.after) / (self.before - 1.0) if self.before > 1.02 else math.nan

    def row(self) -> str:
        """Return a line of the table."""
        return f"{self.case.name:<52} {self.before:9.3f} {self.after:9.3f} {self.closure:8.3f}"


HEAD = f"{'case':<52} {'before':>9} {'truth':>9} {'closure':>8}"


def check_case(tests: BlindTests, case: Case, seed: int, model: Model) -> Check:
    """Replay the logs of a case without and with its true effects.

    Args:
        tests: which write its logs.
        case: whose logs.
        seed: of the list of cases.
        model: the nominal one.
    """
    with TemporaryDirectory() as folder:
        tests.write_case(case.name, seed, Path(folder))
        dataset = read_dataset(folder)
    true = model
    for name, values in case.truth.items():
        true = true.with_effect(name, **values)
    before = _misfit(model, dataset)
    return Check(case, before, _misfit(true, dataset) if case.truth else math.nan)


def _misfit(model: Model, dataset: Dataset) -> float:
    """Return the rms over the noise of repeats, all channels together."""
    noise = noise_from_repeats(dataset.runs) or {}
    squares: list[FloatArray] = []
    for runs in dataset.groups().values():
        predicted = _predicted(model, runs[0])
        for run in runs:
            squares += [
                ((run.channels[name] - predicted[name]) / noise[name].std) ** 2 for name in run.channels
            ]
    return math.sqrt(float(np.mean(np.concatenate(squares))))


def _predicted(model: Model, run: Run) -> dict[str, FloatArray]:
    if isinstance(run.command, BodyCommand):
        command = run.command
        commands = BodyCommands(run.time_s, command.v_rpm, command.theta_deg, command.vc_rpm)
        return drive(model, commands, run.duration_s).channels_at(run.time_s)
    return {"speed_rpm": replay_bench(model, run.time_s, run.command.wheels_rpm[:, 0])}
