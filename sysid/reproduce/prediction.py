"""Free-running predictions of a law and their errors, set by set (Table 1 and the tests of section 4)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from mecanum_env.law import WheelLaw
from mecanum_env.units import FloatArray
from sysid.estimators import WheelRun
from sysid.reproduce.data import DataSets, Recording
from sysid.reproduce.published import CEILING_RPM


@dataclass(frozen=True)
class SetErrors:
    """How near every model comes to one data set."""

    name: str
    role: str
    """fit, test, beyond or trial."""
    rms_rpm: Mapping[str, float]
    """Method to rms of measured minus predicted, repeats together; infinite where the law overflows."""

    @property
    def mse_rpm2(self) -> dict[str, float]:
        """Method to mean squared error [rpm^2]."""
        return {name: rms * rms for name, rms in self.rms_rpm.items()}


def predict_ticks(law: WheelLaw, run: WheelRun, ceiling_rpm: float = math.inf) -> FloatArray:
    """Return the law's speed at every tick of a run that starts at rest, shape (K+1,).

    Args:
        law: any, unstable ones too.
        run: gives the commands.
        ceiling_rpm: limit on the command.
    """
    with np.errstate(all="ignore"):
        after = lfilter([law.D, law.E, law.F], [1.0, -law.A, -law.B, -law.C], run.command(0.0, ceiling_rpm))
    return np.concatenate([[0.0], np.asarray(after)])


def rms_error(law: WheelLaw, runs: Sequence[WheelRun], ceiling_rpm: float = math.inf) -> float:
    """Return the rms [rpm] of measured minus predicted over all samples of all runs.

    Args:
        law: any, unstable ones too.
        runs: starting at rest.
        ceiling_rpm: limit on the command.
    """
    errors = []
    for run in runs:
        ticks = predict_ticks(law, run, ceiling_rpm)
        with np.errstate(all="ignore"):
            errors.append(run.speed_rpm - np.interp(run.sample_tick, np.arange(len(ticks)), ticks))
    with np.errstate(all="ignore"):
        value = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    return value if math.isfinite(value) else math.inf


def set_errors(data: DataSets, laws: Mapping[str, WheelLaw]) -> list[SetErrors]:
    """Return the errors of every law on every data set: fit and test by speed, beyond, and each trial.

    The known ceiling limits the commands of all of them, as the paper allows ("via programming"); it only
    matters beyond.
    """
    result = []
    for role, recordings in (
        ("fit", data.fit),
        ("test", data.test),
        ("beyond", data.beyond),
        ("trial", data.trials),
    ):
        groups: dict[str, list[Recording]] = {}
        for recording in recordings:
            groups.setdefault(recording.name, []).append(recording)
        for name, group in groups.items():
            runs = [recording.run for recording in group]
            errors = {method: rms_error(law, runs, CEILING_RPM) for method, law in laws.items()}
            result.append(SetErrors(name, role, errors))
    return result


def pooled_rms(sets: Sequence[SetErrors], role: str) -> dict[str, float]:
    """Return method to rms [rpm] over all sets of one `role`, every set weighing the same."""
    chosen = [errors for errors in sets if errors.role == role]
    return {
        method: math.sqrt(sum(errors.mse_rpm2[method] for errors in chosen) / len(chosen))
        for method in chosen[0].rms_rpm
    }
