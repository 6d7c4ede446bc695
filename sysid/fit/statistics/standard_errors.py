"""Standard errors, intervals and Cramer-Rao bounds of A-F and of the metrics of the law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.stats import t as student

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.metrics import step_response
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, WheelRun
from sysid.fit.estimators.order import lower_order, noise_gain
from sysid.fit.statistics.identifiability import (
    Linearised,
    Quantity,
    linearise,
    second_order_bias,
    weak_combinations,
)

_LEVEL: Final = 0.95
"""Probability that an interval holds the truth."""
_DIFFERENCE: Final = 0.1
"""Step of the finite differences of the metrics, in standard deviations of a direction."""
_LARGEST_MOVE: Final = 1e-4  # largest change of a coefficient in these finite differences
_METRICS: Final = (
    ("dc_gain", ""),
    ("rise_time_s", "s"),
    ("settling_time_s", "s"),
    ("overshoot", ""),
    ("slowest_time_constant_s", "s"),
)
"""Names and units of the metrics of a law."""


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Uncertainty of an estimate."""

    parameters: tuple[Quantity, ...]
    """A-F, then delay_s and saturation_rpm if fitted."""
    metrics: tuple[Quantity, ...]
    """DC gain, rise time, settling time, overshoot and the slowest pole's time constant: often well
    determined even if A-F are not."""
    covariance: FloatArray
    """Covariance of the parameters with the noise estimated from the residuals, shape (q, q); infinite where
    unknown."""
    condition_number: float
    """Condition number of the Jacobian with its columns scaled to length 1."""
    noise_ratio: float
    """Residual standard deviation over the stated sigma: 1 if the law explains all but the noise."""
    samples: int
    effective_samples: float
    """Number of samples that count as independent."""
    degrees_of_freedom: float
    warnings: tuple[str, ...]
    """Sentences about coefficients that these data cannot tell apart."""

    def __getitem__(self, name: str) -> Quantity:
        """Return a parameter or metric by its name."""
        for quantity in (*self.parameters, *self.metrics):
            if quantity.name == name:
                return quantity
        raise KeyError(name)


def uncertainty(
    runs: Sequence[WheelRun], estimate: Estimate, *, effective_samples: float | None = None
) -> Uncertainty:
    """Return standard errors, 95 % intervals, bounds and warnings for an estimate from its runs.

    The covariance is (J^T J)^-1 with J = d(prediction)/d(parameters)/sigma, exact at the estimate. It gives
    the Cramer-Rao bound, and scaled by the residual variance the standard errors. `effective_samples` is the
    number of independent samples, if a slow sensor repeats samples; None: all.

    Raises:
        InputError: data without excitation, or a bad `effective_samples`.
        UnstableLawError: the law is unstable.
    """
    at = linearise(runs, estimate)
    effective = float(at.samples) if effective_samples is None else float(effective_samples)
    if not 0.0 < effective <= at.samples:
        raise InputError(f"effective_samples = {effective_samples}, must be above 0 and at most {at.samples}")
    freedom = effective - len(estimate.free)
    simpler = _second_order_if_as_good(at, estimate)
    # With N_eff independent samples of N, errors grow by sqrt(N/N_eff) in every direction.
    held = at.samples / effective
    ratio = at.noise_ratio(effective)
    quantile = float(student.ppf(0.5 + _LEVEL / 2.0, freedom)) if freedom > 0.0 else math.inf

    def quantity(name: str, unit: str, value: float, gradient: FloatArray, known: bool) -> Quantity:
        """Return a quantity from its derivatives with respect to the directions, shape (rank,)."""
        bound = math.sqrt(held) * float(np.linalg.norm(gradient)) if known else math.inf
        error = ratio * bound if bound > 0.0 else 0.0
        half = quantile * error if error > 0.0 else 0.0
        return Quantity(name, unit, value, error, bound, value - half, value + half)

    units = {"delay_s": "s", "saturation_rpm": "rpm"}
    bias = second_order_bias(at) * held * ratio**2 if freedom > 0.0 else np.full(len(at.names), np.nan)
    parameters = []
    for i, name in enumerate(at.names):
        known = not at.unknown[i] and (name in units or simpler is None)
        plain = quantity(name, units.get(name, ""), float(at.value[i]), at.factor[i], known)
        parameters.append(replace(plain, bias=float(bias[i])))
    metrics = tuple(quantity(*one) for one in _metrics(at, estimate.law, simpler, freedom > 0.0))
    with np.errstate(invalid="ignore"):
        covariance = at.factor @ at.factor.T * (held * ratio**2)
    unsure = np.array([not math.isfinite(q.standard_error) for q in parameters])
    covariance[unsure, :] = covariance[:, unsure] = np.inf
    smallest = at.singular[-1]
    return Uncertainty(
        parameters=tuple(parameters),
        metrics=metrics,
        covariance=covariance,
        condition_number=float(at.singular[0] / smallest) if at.rank == len(at.singular) else math.inf,
        noise_ratio=ratio,
        samples=at.samples,
        effective_samples=effective,
        degrees_of_freedom=max(freedom, 0.0),
        warnings=weak_combinations(at, parameters, metrics, simpler is not None),
    )


def _second_order_if_as_good(at: Linearised, estimate: Estimate) -> WheelLaw | None:
    """Return a second-order law that fits as well as a third-order estimate; None if there is none."""
    if "C" not in estimate.free:
        return None
    gain = estimate.law.dc_gain
    found = lower_order(at.problem, at.traces, 2, unit_gain=at.fixed_gain, gain=gain)
    gained = 2.0 * found.cost - at.sum_of_squares
    if gained > noise_gain(at.samples) * at.noise_ratio(at.samples) ** 2:
        return None
    return WheelLaw.from_coefficients(found.coefficients, estimate.law.sample_period_s)


def _metrics(
    at: Linearised, law: WheelLaw, simpler: WheelLaw | None, usable: bool
) -> list[tuple[str, str, float, FloatArray, bool]]:
    """Return (name, unit, value, derivatives with respect to the directions, known) of every metric."""
    period = law.sample_period_s
    slowest = max(min(abs(law.poles[0]), 0.9999), 0.1)
    ticks = int(min(200 + 12.0 / -math.log(slowest), 50_000))
    centre = _metric_values(law.coefficients, period, ticks)

    def gradient(directions: FloatArray, most: float) -> FloatArray:
        columns = []
        for direction in directions.T:
            size = min(most, _LARGEST_MOVE / max(float(np.max(np.abs(direction))), 1e-300))
            up = _metric_values(law.coefficients + size * direction, period, ticks)
            down = _metric_values(law.coefficients - size * direction, period, ticks)
            columns.append((up - down) / (2.0 * size))
        return np.stack(columns, axis=1) if columns else np.zeros((len(centre), 0))

    slopes = gradient(at.factor[:6], _DIFFERENCE)
    if at.fixed_gain:
        slopes[0] = 0.0  # differences would have rounding noise
    lost = at.lost[:6]
    scale = np.linalg.norm(lost, axis=0)
    nudges = gradient(lost / np.where(scale > 0.0, scale, 1.0), _LARGEST_MOVE)
    # Two laws that fit equally well differ by something the data leave open: one more direction.
    other = None if simpler is None else _metric_values(simpler.coefficients, period, ticks)
    noise = at.noise_ratio(at.samples)
    result = []
    for i, (name, unit) in enumerate(_METRICS):
        known = usable and bool(
            np.isfinite(centre[i]) and np.all(np.isfinite(slopes[i])) and np.all(np.abs(nudges[i]) < 1e-6)
        )
        gradient_i = slopes[i] if other is None else np.append(slopes[i], (other[i] - centre[i]) / noise)
        known = known and bool(np.all(np.isfinite(gradient_i)))
        result.append((name, unit, float(centre[i]), gradient_i, known))
    return result


def _metric_values(coefficients: FloatArray, period: float, ticks: int) -> FloatArray:
    """Return the metrics of A-F, shape (5,), interpolated between ticks; NaN for an unstable law."""
    law = WheelLaw.from_coefficients(coefficients, period)
    if not law.is_stable or abs(law.dc_gain) < 1e-9:
        return np.full(len(_METRICS), np.nan)
    progress = step_response(law, ticks) / law.dc_gain
    outside = np.flatnonzero(np.abs(progress - 1.0) > 0.02)
    last = int(outside[-1]) if len(outside) else 0
    settling = math.nan
    if last < ticks:
        edge = 1.0 + math.copysign(0.02, progress[last] - 1.0)
        settling = period * (last + (edge - progress[last]) / (progress[last + 1] - progress[last]))
    size = abs(law.poles[0])
    return np.array(
        [
            law.dc_gain,
            period * (_first_crossing(progress, 0.9) - _first_crossing(progress, 0.1)),
            settling,
            max(float(np.max(progress)) - 1.0, 0.0),
            -period / math.log(size) if size > 0.0 else 0.0,
        ]
    )


def _first_crossing(progress: FloatArray, level: float) -> float:
    """Return the time [ticks] at which `level` is first reached, interpolated; NaN if never."""
    reached = np.flatnonzero(progress >= level)
    if len(reached) == 0:
        return math.nan
    i = int(reached[0])
    return 0.0 if i == 0 else i - 1 + float((level - progress[i - 1]) / (progress[i] - progress[i - 1]))
