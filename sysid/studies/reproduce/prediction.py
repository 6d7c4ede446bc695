"""Free-running predictions of the laws: errors on every data set, and step responses.

Errors are those of Table 1 and of the tests in section 4; step metrics and responses those of Fig. 3, 4 and
5.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np
from scipy.signal import lfilter

from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics, step_metrics, step_response
from mecanum_env.units import FloatArray
from sysid.fit.estimators import WheelRun
from sysid.studies.reproduce.data import (
    LAW_PERIOD_S,
    NOISE_RPM,
    REST_PERIODS,
    STEP_PERIODS,
    DataSets,
    Recording,
)
from sysid.studies.reproduce.published import CEILING_RPM


@dataclass(frozen=True)
class SetErrors:
    """The error of every model on one data set."""

    name: str
    role: str
    """One of fit, test, beyond and trial."""
    rms_rpm: Mapping[str, float]
    """Method -> rms of measured minus predicted over all repeats; infinite if the law overflows."""

    @property
    def mse_rpm2(self) -> dict[str, float]:
        """Method -> mean squared error [rpm^2]."""
        return {name: rms * rms for name, rms in self.rms_rpm.items()}


def _predict_ticks(law: WheelLaw, run: WheelRun, ceiling_rpm: float = math.inf) -> FloatArray:
    """Return the speed of a law, stable or not, at every tick of a run that starts at rest, shape (K+1,).

    Commands are limited to the ceiling.
    """
    with np.errstate(all="ignore"):
        after = lfilter([law.D, law.E, law.F], [1.0, -law.A, -law.B, -law.C], run.command(0.0, ceiling_rpm))
    return np.concatenate([[0.0], np.asarray(after)])


def rms_error(law: WheelLaw, runs: Sequence[WheelRun], ceiling_rpm: float = math.inf) -> float:
    """Return the rms [rpm] of measured minus predicted by a law, over all samples of the runs."""
    errors = []
    for run in runs:
        ticks = _predict_ticks(law, run, ceiling_rpm)
        with np.errstate(all="ignore"):
            errors.append(run.speed_rpm - np.interp(run.sample_tick, np.arange(len(ticks)), ticks))
    with np.errstate(all="ignore"):
        value = float(np.sqrt(np.mean(np.concatenate(errors) ** 2)))
    return value if math.isfinite(value) else math.inf


def set_errors(data: DataSets, laws: Mapping[str, WheelLaw]) -> list[SetErrors]:
    """Return the errors of every law on every data set: fit and test by speed, beyond, and each trial.

    The known ceiling limits all commands, as the paper allows ("via programming"); it only matters for the
    step beyond the ceiling.
    """
    result = []
    for role, recordings in (
        ("fit", data.fit),
        ("test", data.test),
        ("beyond", data.beyond),
        ("trial", data.trials),
    ):
        for name, group in groupby(recordings, key=lambda recording: recording.name):
            runs = [recording.run for recording in group]
            errors = {method: rms_error(law, runs, CEILING_RPM) for method, law in laws.items()}
            result.append(SetErrors(name, role, errors))
    return result


def pooled_rms(sets: Sequence[SetErrors], role: str) -> dict[str, float]:
    """Return method -> rms [rpm] over all sets of one `role`; every set has the same weight."""
    chosen = [errors for errors in sets if errors.role == role]
    return {
        method: math.sqrt(sum(errors.mse_rpm2[method] for errors in chosen) / len(chosen))
        for method in chosen[0].rms_rpm
    }


_STEP_TIME_S = 0.1 * REST_PERIODS
STEP_S = 0.1 * STEP_PERIODS


@dataclass(frozen=True)
class ModelStep:
    """Metrics of a law's step response; those of a linear law do not depend on the speed."""

    stable: bool
    relative_error_after_1_s: float
    """(speed - command) / command 1 s after the step, the paper's definition."""
    relative_error: float
    """The final relative error: DC gain - 1; NaN for an unstable law."""
    rise_s: float
    settling_s: float
    overshoot: float


@dataclass(frozen=True, eq=False)
class TargetSteps:
    """Metrics of the target system's step responses; arrays with one entry per speed."""

    speeds_rpm: tuple[int, ...]
    relative_error: FloatArray
    """From the mean of the measured repeats."""
    rise_s: FloatArray
    settling_s: FloatArray
    true_relative_error: FloatArray
    """From the wheel's true speed."""
    true_rise_s: FloatArray
    true_settling_s: FloatArray


@dataclass(frozen=True, eq=False)
class Response:
    """One recording and the prediction of every model."""

    name: str
    time_s: FloatArray
    measured_rpm: FloatArray
    true_rpm: FloatArray
    tick_s: FloatArray
    command_rpm: FloatArray
    """The command held from each tick on."""
    models_rpm: Mapping[str, FloatArray]
    """Method -> speed at every tick; infinite or NaN where an unstable law overflows."""


def model_step(law: WheelLaw) -> ModelStep:
    """Measure the step response of a law, stable or not."""
    if law.is_stable:
        after, full = law_step_metrics(law, duration_s=STEP_S), law_step_metrics(law)
        error = after.relative_steady_state_error
        gain = law.dc_gain - 1.0
        return ModelStep(True, error, gain, full.rise_time_s, full.settling_time_s, full.overshoot)
    speed = step_response(law, round(STEP_S / law.sample_period_s))
    if not np.all(np.isfinite(speed)):
        return ModelStep(False, math.nan, math.nan, math.nan, math.nan, math.nan)
    time = np.arange(len(speed)) * law.sample_period_s
    seen = step_metrics(time, speed, 0.0, 1.0, steady_share=0.0, noise_rpm=0.0)
    error = seen.relative_steady_state_error
    return ModelStep(False, error, math.nan, seen.rise_time_s, seen.settling_time_s, seen.overshoot)


def target_steps(data: DataSets) -> TargetSteps:
    """Return the metrics of the target system's test steps, from the mean of the repeats."""
    speeds, measured, true = [], [], []
    for group in (list(same) for _, same in groupby(data.test, key=lambda recording: recording.name)):
        command = float(group[0].record.command_rpm[-1])
        speeds.append(round(command))
        mean = np.mean([recording.record.speed_rpm for recording in group], axis=0)
        inner = np.mean([recording.record.true_speed_rpm for recording in group], axis=0)
        time = group[0].record.time_s
        # A speed is counted over the interval that ends at its stamp, and belongs to its middle.
        middle = time - 0.5 * (time[1] - time[0])
        noise = NOISE_RPM / math.sqrt(len(group))
        measured.append(step_metrics(middle, mean, 0.0, command, step_time_s=_STEP_TIME_S, noise_rpm=noise))
        true.append(step_metrics(time, inner, 0.0, command, step_time_s=_STEP_TIME_S, noise_rpm=0.0))
    return TargetSteps(
        tuple(speeds),
        np.array([m.relative_steady_state_error for m in measured]),
        np.array([m.rise_time_s for m in measured]),
        np.array([m.settling_time_s for m in measured]),
        np.array([m.relative_steady_state_error for m in true]),
        np.array([m.rise_time_s for m in true]),
        np.array([m.settling_time_s for m in true]),
    )


def response(recording: Recording, laws: Mapping[str, WheelLaw], ceiling_rpm: float = math.inf) -> Response:
    """Return a recording beside the free-running prediction of every law, commands limited to a ceiling."""
    run, log = recording.run, recording.record
    command = run.command()
    return Response(
        recording.name,
        log.time_s,
        log.speed_rpm,
        log.true_speed_rpm,
        np.asarray(np.arange(len(command) + 1) * LAW_PERIOD_S, float),
        np.append(command, command[-1]),
        {name: _predict_ticks(law, run, ceiling_rpm) for name, law in laws.items()},
    )


def shown_steps(data: DataSets, laws: Mapping[str, WheelLaw], speeds_rpm: Sequence[int]) -> list[Response]:
    """Return the first recording of each of the `speeds_rpm` from the test steps, with all `laws`."""
    first = {recording.name: recording for recording in reversed(data.test)}
    return [response(first[f"step {speed} rpm"], laws) for speed in speeds_rpm]
