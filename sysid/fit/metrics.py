"""The figures of one method: errors on each split, step metrics, stability, starts, time and memory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import lfilter

from mecanum_env.law import WheelLaw
from mecanum_env.law.metrics import StepMetrics, law_step_metrics
from mecanum_env.units import FloatArray
from sysid.fit.estimators import Estimate, WheelRun
from sysid.logs.runs import SPLITS, Split

Runs = Mapping[Split, Mapping[str, Sequence[WheelRun]]]


@dataclass(frozen=True)
class ErrorMetrics:
    """Measured minus simulated on the runs of one split."""

    rms_rpm: float
    max_rpm: float
    samples: int
    runs: int


@dataclass(frozen=True)
class MethodMetrics:
    """What one method reached."""

    estimate: Estimate
    errors: Mapping[Split, ErrorMetrics]
    """Only the splits that have runs."""
    metrics: StepMetrics
    """Of the law's response to a unit step."""
    peak_memory_mib: float

    def as_json(self) -> dict[str, Any]:
        """Return the object that fit.json holds for this method; what is not finite is null."""
        found, law = self.estimate, self.estimate.law
        return {
            "rms_rpm": {split: finite_or_none(e.rms_rpm) for split, e in self.errors.items()},
            "max_error_rpm": {split: finite_or_none(e.max_rpm) for split, e in self.errors.items()},
            "samples": {split: e.samples for split, e in self.errors.items()},
            "runs": {split: e.runs for split, e in self.errors.items()},
            "rise_time_s": finite_or_none(self.metrics.rise_time_s),
            "settling_time_s": finite_or_none(self.metrics.settling_time_s),
            "overshoot": finite_or_none(self.metrics.overshoot),
            "relative_steady_state_error": finite_or_none(law.dc_gain - 1.0),
            "poles": [[float(p.real), float(p.imag)] for p in law.poles],
            "stable": law.is_stable,
            "coefficients": dict(zip("ABCDEF", (float(c) for c in law.coefficients), strict=True)),
            "sample_period_s": law.sample_period_s,
            "delay_s": found.delay_s,
            "saturation_rpm": finite_or_none(found.saturation_rpm),
            "starts": len(found.starts),
            "success_rate": found.success_share,
            "stable_rate": found.stable_share,
            "seconds": found.seconds,
            "peak_memory_mib": self.peak_memory_mib,
        }


def method_metrics(estimate: Estimate, runs: Runs, peak_memory_mib: float) -> MethodMetrics:
    """Evaluate an estimate on all splits.

    Args:
        estimate: what the method found.
        runs: split -> wheel name -> data.
        peak_memory_mib: measured beside [MiB].
    """
    errors = {}
    for split in SPLITS:
        data = [run for wheel in runs[split].values() for run in wheel]
        if data:
            error = np.concatenate([residual(run, estimate) for run in data])
            errors[split] = ErrorMetrics(rms(error), float(np.max(np.abs(error))), error.size, len(data))
    return MethodMetrics(estimate, errors, law_step_metrics(estimate.law), peak_memory_mib)


def residual(run: WheelRun, estimate: Estimate) -> FloatArray:
    """Return measured minus simulated speed [rpm] at the run's samples, shape (N,), free-running."""
    ticks = simulate(run, estimate.law, estimate.delay_s, estimate.saturation_rpm)
    return run.speed_rpm - np.interp(run.sample_tick, np.arange(len(ticks)), ticks)


def rms(error: FloatArray) -> float:
    """Return the root mean square of an error."""
    return math.sqrt(float(np.mean(error**2)))


def simulate(
    run: WheelRun, law: WheelLaw, delay_s: float = 0.0, saturation_rpm: float = math.inf
) -> FloatArray:
    """Free-run a law through a run's commands from its steady start: w(0..K) [rpm], shape (K+1,)."""
    c = law.coefficients
    deviation = run.command(delay_s, saturation_rpm) - run.initial_rpm / law.dc_gain
    after = lfilter(c[3:], [1.0, *-c[:3]], deviation)
    return run.initial_rpm + np.concatenate([[0.0], after])


def finite_or_none(value: float) -> float | None:
    """Return the number, or None (null in JSON) where it is infinite or nan."""
    return float(value) if math.isfinite(value) else None
