"""The fitting problem of the law: all runs together, their simulation by the law, and its exact derivatives.

With w' and r' the deviations from the steady start, the law is the filter
W'(z) = (D + E/z + F/z^2) / (1 - A/z - B/z^2 - C/z^3) R'(z)/z. The derivative by a coefficient obeys the same
recursion driven by a delayed signal, so two filter passes give all six (the sensitivities of output-error
identification, Ljung, "System Identification", section 10.3).
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, StartResult, WheelRun

_LEAST_GAIN: Final = 1e-6
"""Smallest DC gain assumed for the steady start, so that a search may pass through a gain of 0."""
_LAGS: Final = 3
"""Ticks by which a coefficient's signal may come later, itself included."""
_DELAY_STEP: Final = 1e-4
"""Step of the finite difference d(command)/d(delay) [ticks]; the command is piecewise linear in the delay."""

Indices = npt.NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Traces:
    """The different commands of a problem, shape (U, K); repeats of one command share a row."""

    command_rpm: FloatArray
    by_delay: FloatArray | None = None
    """d(command)/d(delay) [rpm/s], shape (U, K)."""
    by_saturation: FloatArray | None = None
    """d(command)/d(saturation), shape (U, K)."""


@dataclass(frozen=True, eq=False)
class LawProblem:
    """All runs together: U different traces of K ticks, M measurements to predict.

    Build it with `stack`. Arrays that describe measurements have shape (M,).
    """

    sources: tuple[WheelRun, ...]
    """One run for each trace."""
    initial_rpm: FloatArray
    """Steady speed before each trace [rpm], shape (U,)."""
    length: int
    """Number of ticks K of the longest trace."""
    row: Indices
    tick: Indices
    fraction: FloatArray
    """A measurement lies at tick + fraction of trace `row`."""
    speed_rpm: FloatArray
    weight: FloatArray
    """1/sigma [1/rpm]; of the mean, for merged measurements."""
    within_cost: float
    """Half the weighted sum of squares of repeats about their mean, which no law can change."""
    group: Indices
    """Index of the measurement that contains each original sample, in the order of the runs, shape (N,)."""
    measured_rpm: FloatArray
    """The original samples in the order of the runs [rpm], shape (N,)."""
    sample_period_s: float

    @property
    def largest_command(self) -> float:
        """Largest command of any run, before a fitted limit [rpm]."""
        return max(float(np.max(np.abs(run.command()))) for run in self.sources)

    def traces(
        self,
        delay_s: float = 0.0,
        saturation_rpm: float = np.inf,
        *,
        with_delay: bool = False,
        with_saturation: bool = False,
    ) -> Traces:
        """Return the commands for a delay and a limit; derivatives if `with_delay`, `with_saturation`."""

        def build(delay: float, limit: float) -> FloatArray:
            rows = np.empty((len(self.sources), self.length))
            for row, run in zip(rows, self.sources, strict=True):
                command = run.command(delay, limit)
                row[: len(command)] = command
                row[len(command) :] = command[-1]
            return rows

        command = build(delay_s, saturation_rpm)
        by_delay = by_saturation = None
        if with_delay:
            step = _DELAY_STEP * self.sample_period_s
            by_delay = (build(delay_s + step, saturation_rpm) - command) / step
        if with_saturation:
            step = 1e-6 * max(1.0, saturation_rpm)
            by_saturation = (command - build(delay_s, saturation_rpm - step)) / step
        return Traces(command, by_delay, by_saturation)

    def predict(self, coefficients: npt.ArrayLike, traces: Traces) -> FloatArray:
        """Return the free-running prediction [rpm] of every measurement, shape (M,), for `coefficients` A-F.

        The prediction of an unstable law may be infinite or NaN; there is no warning.
        """
        c = np.asarray(coefficients, float)
        start = self.initial_rpm[:, None]
        with np.errstate(all="ignore"):
            deviation = lfilter(c[3:], _denominator(c), traces.command_rpm - start / _dc_gain(c))
            return np.asarray(self.initial_rpm[self.row] + self._gathered(deviation)[:, 0])

    def residual(self, coefficients: npt.ArrayLike, traces: Traces) -> FloatArray:
        """Return (predicted - measured)/sigma of every measurement, shape (M,), for `coefficients` A-F."""
        return np.asarray((self.predict(coefficients, traces) - self.speed_rpm) * self.weight)

    def predict_with_jacobian(
        self, coefficients: npt.ArrayLike, traces: Traces
    ) -> tuple[FloatArray, FloatArray]:
        """Return the prediction, shape (M,), and its derivatives, shape (M, 6 [+ delay] [+ saturation]).

        `coefficients` are A-F, shape (6,), of a stable law.
        """
        c = np.asarray(coefficients, float)
        denominator, gain, start = _denominator(c), _dc_gain(c), self.initial_rpm[:, None]
        command = traces.command_rpm - start / gain
        by_d = lfilter([1.0], denominator, command)
        deviation = lfilter(c[3:], [1.0], by_d)
        by_a = lfilter([0.0, 1.0], denominator, deviation)
        columns = [self._gathered(signal, lags=3) for signal in (by_a, by_d)]
        extra = [x for x in (traces.by_delay, traces.by_saturation) if x is not None]
        columns += [self._gathered(lfilter(c[3:], denominator, x)) for x in extra]
        jacobian = np.concatenate(columns, axis=1)
        if np.any(self.initial_rpm):
            # The command that held the start is initial/gain, which depends on the coefficients.
            step = self._gathered(lfilter(c[3:], denominator, np.broadcast_to(start, command.shape)))
            by_inverse_gain = np.concatenate([-np.ones(3), np.full(3, -1.0 / gain)]) / np.sum(c[3:])
            jacobian[:, :6] -= step * by_inverse_gain
        return self.initial_rpm[self.row] + self._gathered(deviation)[:, 0], jacobian

    def linear_columns(self, abc: npt.ArrayLike, traces: Traces) -> FloatArray:
        """Return the factors of D, E and F in the prediction, shape (M, 3), for `abc` and unit gain."""
        command = traces.command_rpm - self.initial_rpm[:, None]
        by_d = lfilter([1.0], _denominator(np.asarray(abc, float)), command)
        return self._gathered(by_d, lags=3)

    def rms(self, predicted: FloatArray) -> float:
        """Return the unweighted rms [rpm] of all original samples about `predicted`, shape (M,).

        It is infinite if any prediction is not finite.
        """
        with np.errstate(all="ignore"):
            value = float(np.sqrt(np.mean((self.measured_rpm - predicted[self.group]) ** 2)))
        return value if np.isfinite(value) else np.inf

    def _gathered(self, after: FloatArray, lags: int = 1) -> FloatArray:
        """Interpolate a signal x(1..K), (U, K), at the measurements and the lags before them, (M, lags)."""
        padded = np.zeros((len(after), self.length + _LAGS))
        padded[:, _LAGS:] = after
        places, following = (index[:, :lags] for index in self._places)
        value = np.take(padded, places)
        if self._between_ticks:
            value = value + self.fraction[:, None] * (np.take(padded, following) - value)
        return np.asarray(value)

    @cached_property
    def _places(self) -> tuple[Indices, Indices]:
        """Where signals behind `_LAGS` zeros have each measurement's tick, and the next, later by each lag.

        Both are indices into all signals, one behind the other, shape (M, `_LAGS`).
        """
        stride = self.length + _LAGS
        places = (self.row * stride + self.tick + (_LAGS - 1))[:, None] - np.arange(_LAGS)
        return places, np.minimum(places + 1, len(self.sources) * stride - 1)

    @cached_property
    def _between_ticks(self) -> bool:
        return bool(np.any(self.fraction))


def stack(runs: Sequence[WheelRun], *, merge: bool = True) -> LawProblem:
    """Combine runs into one problem; with `merge`, repeats of one sample become their weighted mean.

    Merging changes no least-squares estimate, since the mean is sufficient, and makes every step faster.

    Raises:
        InputError: no runs, different clocks, or data that cannot determine a law (`require_excitation`).
    """
    period = _common_period(runs)
    require_excitation(runs)
    keys: dict[tuple[bytes, float], int] = {}
    sources: list[WheelRun] = []
    rows = np.empty(len(runs), np.intp)
    for i, run in enumerate(runs):
        # Unlimited commands: two runs that are equal under one limit may differ under another.
        key = (np.ascontiguousarray(run.command()).tobytes(), run.initial_rpm)
        if key not in keys:
            keys[key] = len(sources)
            sources.append(run)
        rows[i] = keys[key]
    length = max(len(run.command_rpm) for run in sources)
    row = np.repeat(rows, [len(run.speed_rpm) for run in runs])
    sampled = np.concatenate([run.sample_tick for run in runs])
    speed = measured = np.concatenate([run.speed_rpm for run in runs])
    precision = np.concatenate([run.sigma_rpm for run in runs]) ** -2.0
    group: Indices = np.arange(len(speed), dtype=np.intp)
    within = 0.0
    if merge:
        _, first, group = np.unique(row * (length + 1.0) + sampled, return_index=True, return_inverse=True)
        total = np.bincount(group, precision)
        mean = np.bincount(group, precision * speed) / total
        within = 0.5 * float(np.sum(precision * (speed - mean[group]) ** 2))
        row, sampled = row[first], sampled[first]
        speed, precision = mean, np.asarray(total, float)
    tick = np.minimum(sampled.astype(np.intp), length)
    return LawProblem(
        sources=tuple(sources),
        initial_rpm=np.array([run.initial_rpm for run in sources]),
        length=length,
        row=row,
        tick=tick,
        fraction=sampled - tick,
        speed_rpm=speed,
        weight=np.sqrt(precision),
        within_cost=within,
        group=group,
        measured_rpm=measured,
        sample_period_s=period,
    )


def require_excitation(runs: Sequence[WheelRun]) -> None:
    """Check that the data can determine a law at all.

    Raises:
        InputError: fewer samples than coefficients, no command that ever differs from the steady start, or
            a speed that never moves although the command does (a dead sensor).
    """
    samples = sum(len(run.speed_rpm) for run in runs)
    if samples < 7:
        raise InputError(
            f"{', '.join(run.name for run in runs)}: {samples} samples in all, must be at least 7 for six "
            "coefficients; record longer runs"
        )
    moved = max(float(np.max(np.abs(run.command() - run.initial_rpm))) for run in runs)
    if moved == 0.0:
        raise InputError(
            f"the command never leaves the steady start ({runs[0].initial_rpm:g} rpm), so nothing can be "
            f"learnt from {len(runs)} run(s) starting with {runs[0].name}; record a step from rest"
        )
    still = all(float(np.ptp(run.speed_rpm)) == 0.0 for run in runs)
    if still and len({float(run.speed_rpm[0]) for run in runs}) == 1:
        raise InputError(
            f"speed_rpm is {runs[0].speed_rpm[0]:g} in every sample while the command moves by "
            f"{moved:g} rpm: a dead sensor or the wrong column; check `speed_rpm` in the logs"
        )


def single_estimate(
    problem: LawProblem,
    coefficients: FloatArray,
    method: str,
    kind: str,
    free: tuple[str, ...],
    iterations: int,
    began: float,
) -> Estimate:
    """Return the estimate of a `method` that does not search from starting points.

    The `problem` has all runs, also those that were not fitted; of the `coefficients` A-F, shape (6,), those
    named in `free` were estimated. `kind` and `iterations` are those of its only `StartResult`; the method
    `began` at that `time.perf_counter()`.
    """
    law = WheelLaw.from_coefficients(coefficients, problem.sample_period_s)
    predicted = problem.predict(coefficients, problem.traces())
    rms = problem.rms(predicted)
    with np.errstate(all="ignore"):
        residual = (predicted - problem.speed_rpm) * problem.weight
        cost = 0.5 * float(residual @ residual) + problem.within_cost
    seconds = time.perf_counter() - began
    start = StartResult(kind, (), tuple(coefficients.tolist()), rms, law.is_stable, True, iterations, seconds)
    return Estimate(method, law, rms, cost if np.isfinite(cost) else np.inf, free, (start,), seconds)


def _common_period(runs: Sequence[WheelRun]) -> float:
    """Return the law's period [s], which all runs must share."""
    if not runs:
        raise InputError("no runs to fit; give at least one run with a changing command")
    periods = {run.sample_period_s for run in runs}
    if len(periods) > 1:
        raise InputError(
            f"runs on different clocks (sample_period_s {min(periods):g} to {max(periods):g}); "
            "put all on one law period before fitting"
        )
    return runs[0].sample_period_s


def _denominator(coefficients: FloatArray) -> FloatArray:
    return np.array([1.0, -coefficients[0], -coefficients[1], -coefficients[2]])


def _dc_gain(c: FloatArray) -> float:
    """Return steady speed over command; exactly 1 if the six sum to 1, so that rounding adds no transient."""
    numerator, denominator = float(c[3] + c[4] + c[5]), float(1.0 - c[0] - c[1] - c[2])
    if abs(numerator - denominator) <= 1e-12:
        return 1.0
    gain = numerator / denominator
    return math.copysign(max(abs(gain), _LEAST_GAIN), gain)
