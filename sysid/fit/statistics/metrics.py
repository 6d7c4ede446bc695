"""Metrics of a fitted law: errors on each split, step response, stability, starts, time and memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from mecanum_env.law import WheelLaw
from mecanum_env.law.coefficients import COEFFICIENTS
from mecanum_env.law.metrics import StepMetrics, law_step_metrics
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.fit.estimators import Estimate, WheelRun
from sysid.logs.runs import SPLITS, Split

Runs = Mapping[Split, Mapping[str, Sequence[WheelRun]]]
"""Split -> wheel name -> its runs on the law's clock."""


@dataclass(frozen=True)
class ErrorMetrics:
    """Measured minus simulated on the runs of one split."""

    rms_rpm: float
    max_rpm: float
    samples: int
    runs: int


@dataclass(frozen=True)
class MethodMetrics:
    """Result of one method."""

    estimate: Estimate
    errors: Mapping[Split, ErrorMetrics]
    """Errors on the splits that have runs."""
    metrics: StepMetrics
    """Of the law's response to a unit step."""
    peak_memory_mib: float

    def as_json(self) -> dict[str, Any]:
        """Return the object of this method in fit.json."""
        found, law = self.estimate, self.estimate.law
        return {
            "rms_rpm": {split: e.rms_rpm for split, e in self.errors.items()},
            "max_error_rpm": {split: e.max_rpm for split, e in self.errors.items()},
            "samples": {split: e.samples for split, e in self.errors.items()},
            "runs": {split: e.runs for split, e in self.errors.items()},
            "rise_time_s": self.metrics.rise_time_s,
            "settling_time_s": self.metrics.settling_time_s,
            "overshoot": self.metrics.overshoot,
            "relative_steady_state_error": law.dc_gain - 1.0,
            "poles": [[float(p.real), float(p.imag)] for p in law.poles],
            "stable": law.is_stable,
            "coefficients": dict(zip(COEFFICIENTS, law.coefficients.tolist(), strict=True)),
            "sample_period_s": law.sample_period_s,
            "delay_s": found.delay_s,
            "saturation_rpm": found.saturation_rpm,
            "starts": len(found.starts),
            "success_rate": found.success_share,
            "stable_rate": found.stable_share,
            "seconds": found.seconds,
            "peak_memory_mib": self.peak_memory_mib,
        }


def method_metrics(estimate: Estimate, runs: Runs, peak_memory_mib: float) -> MethodMetrics:
    """Evaluate an estimate, which needed `peak_memory_mib` [MiB] of memory, on the `runs` of all splits."""
    errors = {}
    for split in SPLITS:
        data = [run for wheel in runs[split].values() for run in wheel]
        if data:
            error = np.concatenate([residual(run, estimate) for run in data])
            errors[split] = ErrorMetrics(rms(error), float(np.max(np.abs(error))), error.size, len(data))
    return MethodMetrics(estimate, errors, law_step_metrics(estimate.law), peak_memory_mib)


def residual(run: WheelRun, estimate: Estimate) -> FloatArray:
    """Return measured minus simulated (free-running) speed [rpm] at the run's samples, shape (N,)."""
    ticks = simulate(run, estimate.law, estimate.delay_s, estimate.saturation_rpm)
    return run.speed_rpm - np.interp(run.sample_tick, np.arange(len(ticks)), ticks)


def simulate(
    run: WheelRun, law: WheelLaw, delay_s: float = 0.0, saturation_rpm: float = math.inf
) -> FloatArray:
    """Simulate a law on a run's commands from its steady start: w(0..K) [rpm], shape (K+1,)."""
    c = law.coefficients
    deviation = run.command(delay_s, saturation_rpm) - run.initial_rpm / law.dc_gain
    after = lfilter(c[3:], [1.0, *-c[:3]], deviation)
    return run.initial_rpm + np.concatenate([[0.0], after])
