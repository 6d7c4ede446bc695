"""Step metrics: rise, settling, overshoot and steady-state error of a measured or simulated step response.

Definitions follow the paper (section 4.2): rise from 10 to 90 % of the change, settling to within 2 % of it
for good, both against the response's *own* steady value. Its Eq. 22 is not printed, but its relative
steady-state error of -4.41e-8 for a law that approaches from below (ours, exactly normalised, is 4.46e-8
short after 120 ticks) implies (steady - command) / command: negative means too slow.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray

_NOISE_SIGMAS: Final = 5.0
"""1,000 samples of white noise leave this band with a probability of 1/1,700; a band of 4 with 1/16."""


@dataclass(frozen=True)
class StepMetrics:
    """Metrics of one step response; nan for a level that was never reached."""

    rise_time_s: float
    """Time from 10 to 90 % of the change, interpolated between samples [s]."""
    settling_time_s: float
    """Time from the step to the first sample after which all lie within the settling band [s]."""
    overshoot: float
    """Largest excursion beyond the steady value, relative to the change; 0 if noise explains it."""
    relative_steady_state_error: float
    """(steady - command) / command: negative means too slow; nan for a command of 0."""
    steady_rpm: float
    """Mean speed over the last part of the response [rpm]."""
    settling_band_rpm: float
    """Half-width of the band [rpm]: 2 % of the change, or 5 standard deviations of the noise if larger."""


def step_metrics(
    time_s: npt.ArrayLike,
    speed_rpm: npt.ArrayLike,
    start_rpm: float,
    command_rpm: float,
    *,
    step_time_s: float = 0.0,
    steady_share: float = 0.2,
    noise_rpm: float | None = None,
) -> StepMetrics:
    """Measure one step response.

    Args:
        time_s: strictly increasing sample times [s], shape (N,); those before `step_time_s` are ignored.
        speed_rpm: wheel speed [rpm], shape (N,); nan marks a missing sample.
        start_rpm: speed before the step [rpm].
        command_rpm: commanded speed after the step [rpm].
        step_time_s: time of the step [s].
        steady_share: the steady value is the mean over this last share of the time after the step (at least
            one sample).
        noise_rpm: standard deviation of the measurement noise [rpm]; None estimates it from differences of
            neighbouring samples in the steady part, 0 is right for a simulation.

    Raises:
        InputError: shapes differ, times do not increase, or no sample follows the step.
    """
    time, speed = _usable(time_s, speed_rpm, step_time_s)
    steady_part = speed[time >= time[-1] - steady_share * (time[-1] - step_time_s)]
    steady = float(np.mean(steady_part))
    noise = _noise_of(steady_part) if noise_rpm is None else noise_rpm
    change = steady - start_rpm
    band = max(0.02 * abs(change), _NOISE_SIGMAS * noise)
    error = (steady - command_rpm) / command_rpm if command_rpm != 0.0 else math.nan
    if abs(change) <= _NOISE_SIGMAS * noise or change == 0.0:  # it never moved
        return StepMetrics(math.nan, math.nan, math.nan, error, steady, band)
    # 0 at the start, 1 at the steady value, for steps up and down; the step itself is a sample.
    progress = np.concatenate([[0.0], (speed - start_rpm) / change])
    clock = np.concatenate([[0.0], time - step_time_s])
    excess = max(float(np.max(progress)) - 1.0, 0.0)
    return StepMetrics(
        rise_time_s=_rise_time(clock, progress),
        settling_time_s=_settling_time(clock, progress, band / abs(change)),
        overshoot=excess if excess * abs(change) > _NOISE_SIGMAS * noise else 0.0,
        relative_steady_state_error=error,
        steady_rpm=steady,
        settling_band_rpm=band,
    )


def law_step_metrics(law: WheelLaw, command_rpm: float = 1.0, duration_s: float | None = None) -> StepMetrics:
    """Return the metrics of a law's own response to a step from rest to `command_rpm`.

    Times and overshoot are those of the whole transient, until 1e-12 of it is left. With `duration_s` None
    the steady value is taken there too, so that the steady-state error is that of the DC gain; a number takes
    the steady value after that time, as the paper does after 1 s.

    Raises:
        UnstableLawError: the law is unstable and has no steady value.
        InputError: `duration_s` is shorter than one tick.
    """
    ticks = _ticks_until_steady(law)
    at = ticks if duration_s is None else round(duration_s / law.sample_period_s)
    if at < 1:
        raise InputError(f"duration_s = {duration_s}, must be at least one tick, {law.sample_period_s:g} s")
    speeds = command_rpm * step_response(law, max(ticks, at))
    time = np.arange(len(speeds)) * law.sample_period_s
    metrics = step_metrics(time, speeds, 0.0, command_rpm, steady_share=0.0, noise_rpm=0.0)
    if duration_s is None:
        return metrics
    steady = float(speeds[at])
    error = (steady - command_rpm) / command_rpm if command_rpm != 0.0 else math.nan
    return replace(metrics, steady_rpm=steady, relative_steady_state_error=error)


def step_response(law: WheelLaw, ticks: int) -> FloatArray:
    """Return w(0..`ticks`), shape (ticks + 1,), for a unit step at tick 0 from rest.

    It is that of `WheelLaw.simulate` up to rounding, computed by compiled code for long horizons.
    """
    zeros, poles = [0.0, law.D, law.E, law.F], [1.0, -law.A, -law.B, -law.C]
    return np.asarray(lfilter(zeros, poles, np.ones(ticks + 1)))


def _ticks_until_steady(law: WheelLaw) -> int:
    """Return the ticks until 1e-12 of a transient is left, at most a million."""
    slowest = abs(law.require_stable().poles[0])
    decay = math.log(1e-12) / math.log(slowest) if slowest > 0.0 else 0.0
    # Ten more ticks for the zeros; the factor is for a triple pole, which decays later than a single one.
    return min(10 + math.ceil(1.5 * decay), 1_000_000)


def _usable(
    time_s: npt.ArrayLike, speed_rpm: npt.ArrayLike, step_time_s: float
) -> tuple[FloatArray, FloatArray]:
    time, speed = np.asarray(time_s, float), np.asarray(speed_rpm, float)
    if time.ndim != 1 or time.shape != speed.shape:
        raise InputError(f"time_s {time.shape} and speed_rpm {speed.shape} must have one common shape (N,)")
    if np.any(np.diff(time) <= 0.0):
        raise InputError(f"time_s does not increase at sample {int(np.argmax(np.diff(time) <= 0.0)) + 1}")
    keep = np.isfinite(speed) & (time > step_time_s)
    if not np.any(keep):
        raise InputError(f"no finite sample after the step at {step_time_s:g} s")
    return time[keep], speed[keep]


def _noise_of(steady_part: FloatArray) -> float:
    """Return the standard deviation of white noise from differences of neighbours, which drift hardly enters.

    A root mean square, no median: most differences of a speed rounded to 1 rpm are exactly 0.
    """
    if len(steady_part) < 3:
        return 0.0
    return math.sqrt(float(np.mean(np.diff(steady_part) ** 2)) / 2.0)


def _rise_time(clock: FloatArray, progress: FloatArray) -> float:
    reached = progress >= 0.9
    if not np.any(reached):
        return math.nan
    high = int(np.argmax(reached))
    low = int(np.flatnonzero(progress[:high] < 0.1)[-1]) + 1  # progress[0] is 0, so there is one
    return _crossing(clock, progress, high, 0.9) - _crossing(clock, progress, low, 0.1)


def _crossing(clock: FloatArray, progress: FloatArray, after: int, level: float) -> float:
    """Interpolate when `level` was crossed between the samples `after` - 1 and `after`."""
    fraction = (level - progress[after - 1]) / (progress[after] - progress[after - 1])
    return float(clock[after - 1] + fraction * (clock[after] - clock[after - 1]))


def _settling_time(clock: FloatArray, progress: FloatArray, band: float) -> float:
    outside = np.flatnonzero(np.abs(progress - 1.0) > band)
    # If the band is as wide as the step, no sample is outside.
    after = int(outside[-1]) + 1 if len(outside) else 0
    return float(clock[after]) if after < len(clock) else math.nan
