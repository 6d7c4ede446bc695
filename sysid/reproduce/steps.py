"""Steady-state error, rise and settling of target system and models; step responses (Fig. 3, 4 and 5)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import law_step_metrics, step_metrics, step_response
from mecanum_env.units import FloatArray
from sysid.reproduce.data import LAW_PERIOD_S, NOISE_RPM, REST_PERIODS, STEP_PERIODS, DataSets, Recording
from sysid.reproduce.prediction import predict_ticks

STEP_TIME_S = 0.1 * REST_PERIODS
STEP_S = 0.1 * STEP_PERIODS


@dataclass(frozen=True)
class ModelStep:
    """The step response of a law; a linear law has the same figures at every speed."""

    stable: bool
    relative_error_after_1_s: float
    """(speed - command)/command 1 s after the step, as the paper takes it."""
    relative_error: float
    """The same for ever: DC gain - 1; nan for an unstable law."""
    rise_s: float
    settling_s: float
    overshoot: float


@dataclass(frozen=True, eq=False)
class TargetSteps:
    """The target system's step responses; arrays of one entry for each speed."""

    speeds_rpm: tuple[int, ...]
    relative_error: FloatArray
    """Mean of the repeats, as measured."""
    rise_s: FloatArray
    settling_s: FloatArray
    true_relative_error: FloatArray
    """Of the wheel itself, without sensor."""
    true_rise_s: FloatArray
    true_settling_s: FloatArray


@dataclass(frozen=True, eq=False)
class Response:
    """One recording and what every model makes of it."""

    name: str
    time_s: FloatArray
    measured_rpm: FloatArray
    true_rpm: FloatArray
    tick_s: FloatArray
    command_rpm: FloatArray
    """Held from each tick."""
    models_rpm: Mapping[str, FloatArray]
    """Method to speed at every tick; infinite or nan where an unstable law overflows."""


def model_step(law: WheelLaw) -> ModelStep:
    """Measure the step response of a law, stable or not."""
    if law.is_stable:
        after, full = law_step_metrics(law, duration_s=STEP_S), law_step_metrics(law)
        error = after.relative_steady_state_error
        return ModelStep(
            True, error, law.dc_gain - 1.0, full.rise_time_s, full.settling_time_s, full.overshoot
        )
    speed = step_response(law, round(STEP_S / law.sample_period_s))
    if not np.all(np.isfinite(speed)):
        return ModelStep(False, math.nan, math.nan, math.nan, math.nan, math.nan)
    time = np.arange(len(speed)) * law.sample_period_s
    seen = step_metrics(time, speed, 0.0, 1.0, steady_share=0.0, noise_rpm=0.0)
    error = seen.relative_steady_state_error
    return ModelStep(False, error, math.nan, seen.rise_time_s, seen.settling_time_s, seen.overshoot)


def target_steps(data: DataSets) -> TargetSteps:
    """Measure the test steps of the target system; repeats are averaged before they are measured."""
    groups: dict[str, list[Recording]] = {}
    for recording in data.test:
        groups.setdefault(recording.name, []).append(recording)
    measured, true = [], []
    speeds = []
    for group in groups.values():
        command = float(group[0].record.command_rpm[-1])
        speeds.append(round(command))
        mean = np.mean([recording.record.speed_rpm for recording in group], axis=0)
        inner = np.mean([recording.record.true_speed_rpm for recording in group], axis=0)
        time = group[0].record.time_s
        # A speed is counted over the interval that ends at its stamp: it belongs to the interval's middle.
        middle = time - 0.5 * (time[1] - time[0])
        noise = NOISE_RPM / math.sqrt(len(group))
        measured.append(step_metrics(middle, mean, 0.0, command, step_time_s=STEP_TIME_S, noise_rpm=noise))
        true.append(step_metrics(time, inner, 0.0, command, step_time_s=STEP_TIME_S, noise_rpm=0.0))
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
    """Return a recording beside the free-running prediction of every law.

    Args:
        recording: of the target system.
        laws: method to law.
        ceiling_rpm: commands are limited to this first.
    """
    run, log = recording.run, recording.record
    command = run.command()
    return Response(
        recording.name,
        log.time_s,
        log.speed_rpm,
        log.true_speed_rpm,
        np.asarray(np.arange(len(command) + 1) * LAW_PERIOD_S, float),
        np.append(command, command[-1]),
        {name: predict_ticks(law, run, ceiling_rpm) for name, law in laws.items()},
    )


def shown_steps(data: DataSets, laws: Mapping[str, WheelLaw], speeds_rpm: Sequence[int]) -> list[Response]:
    """Return the first recording of each of the `speeds_rpm` from the test steps, with all `laws`."""
    first = {recording.name: recording for recording in reversed(data.test)}
    return [response(first[f"step {speed} rpm"], laws) for speed in speeds_rpm]
