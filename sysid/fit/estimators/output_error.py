"""Output error: the stable law whose free-running simulation is nearest to the measurements.

Maximum likelihood when the measurement noise is white and normal (Ljung, "System Identification", section
7.4). The search runs in Schur-Cohn coordinates, so every iterate is stable, and with E eliminated, so every
iterate has unit DC gain. Two stages per start:

1. Variable projection (`projection`): D, E, F enter linearly, so for given poles the best ones are solved
   for, and the trust region moves in the three pole coordinates only. This is what makes random starts
   converge.
2. All parameters together, delay and saturation included, by trust-region least squares with the exact
   Jacobian.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.stability import (
    free_coordinates,
    stabilised_abc,
    stable_abc,
    stable_abc_jacobian,
)
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, Options, StartResult, WheelRun
from sysid.fit.estimators.linear import (
    one_step_coefficients,
    random_coefficients,
    stable_coefficients,
    steiglitz_mcbride_coefficients,
)
from sysid.fit.estimators.order import (
    FREE_BY_ORDER,
    correlated_share,
    lower_order,
    noise_gain,
    noise_variance,
)
from sysid.fit.estimators.problem import LawProblem, Traces, stack
from sysid.fit.estimators.projection import drive_start, gain_start, project

_TOLERANCE = 1e-10
_HUBER = 1.345
_LIMIT_SCALE = 10.0
"""Saturation is searched in units of this [rpm], to be of the size of the other parameters."""


@dataclass(frozen=True)
class _Point:
    """A law with its drive parameters, somewhere in the search."""

    coefficients: FloatArray
    delay_s: float = 0.0
    saturation_rpm: float = np.inf


@dataclass(frozen=True)
class _Reached:
    point: _Point
    cost: float
    converged: bool
    iterations: int


def output_error(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate the law by output error from several starts and keep the best.

    Args:
        runs: one or more runs of one wheel, or of several to be pooled.
        options: see `Options`; all of it is used.

    Returns:
        A stable law, always; of unit DC gain unless `options.unit_gain` is off.

    Raises:
        InputError: no usable data (see `problem.require_excitation`).
    """
    options = options or Options()
    began = time.perf_counter()
    problem = stack(runs, merge=options.loss == "linear")
    delay, limit = drive_start(problem, options)
    delivered = [replace(run, command_rpm=run.command(delay, limit), source=None) for run in runs]
    results: list[tuple[StartResult, _Reached]] = []
    for kind, initial in _starting_points(delivered, options):
        start_began = time.perf_counter()
        reached = fit_from(problem, initial, options, delay_s=delay, saturation_rpm=limit)
        seconds = time.perf_counter() - start_began
        coefficients = reached.point.coefficients
        results.append(
            (
                StartResult(
                    kind=kind,
                    initial=tuple(float(x) for x in initial),
                    coefficients=tuple(float(x) for x in coefficients),
                    rms_rpm=_rms(problem, reached.point),
                    stable=WheelLaw.from_coefficients(coefficients, problem.sample_period_s).is_stable,
                    converged=reached.converged,
                    iterations=reached.iterations,
                    seconds=seconds,
                ),
                reached,
            )
        )
    best = min(results, key=lambda pair: pair[1].cost)
    point, cost, order = best[1].point, best[1].cost, 3
    if options.order == "auto" and options.loss == "linear":
        point, cost, order = _simplest(problem, point, cost, options)
    free = [name for name in FREE_BY_ORDER[order] if name != "E" or not options.unit_gain]
    free += ["delay_s"] if options.fit_delay else []
    free += ["saturation_rpm"] if np.isfinite(point.saturation_rpm) else []
    return Estimate(
        method="output-error",
        law=WheelLaw.from_coefficients(point.coefficients, problem.sample_period_s),
        rms_rpm=_rms(problem, point),
        cost=cost,
        free=tuple(free),
        starts=tuple(start for start, _ in results),
        seconds=time.perf_counter() - began,
        delay_s=point.delay_s,
        saturation_rpm=point.saturation_rpm,
    )


def fit_from(
    problem: LawProblem,
    initial: FloatArray,
    options: Options,
    *,
    delay_s: float = 0.0,
    saturation_rpm: float = np.inf,
) -> _Reached:
    """Search from one start `initial`, A-F, shape (6,), first reflected into the stable region."""
    traces = problem.traces(delay_s, saturation_rpm)
    gain = 1.0 if options.unit_gain else gain_start(problem, traces.command_rpm)
    scaled = Traces(gain * traces.command_rpm)
    coefficients, evaluations = project(problem, scaled, stabilised_abc(initial[:3], 0.999))
    coefficients[3:] *= gain
    return _polish(problem, _Point(coefficients, delay_s, saturation_rpm), options, evaluations)


def _polish(problem: LawProblem, start: _Point, options: Options, evaluations: int) -> _Reached:
    """Stage 2: all free parameters together from a good start."""
    free_delay, free_limit = options.fit_delay, bool(np.isfinite(start.saturation_rpm))
    period = problem.sample_period_s
    fixed = None if free_delay or free_limit else problem.traces(start.delay_s, start.saturation_rpm)
    laws = 5 if options.unit_gain else 6

    def unpack(x: FloatArray) -> _Point:
        abc = stable_abc(x[:3])
        if options.unit_gain:
            law = np.array([*abc, x[3], 1.0 - (np.sum(abc) + x[3] + x[4]), x[4]])
        else:
            law = np.concatenate([abc, x[3:6]])
        delay = x[laws] * period if free_delay else start.delay_s
        limit = x[-1] * _LIMIT_SCALE if free_limit else start.saturation_rpm
        return _Point(law, float(delay), float(limit))

    def residual(x: FloatArray) -> FloatArray:
        point = unpack(x)
        traces = fixed or problem.traces(point.delay_s, point.saturation_rpm)
        return (problem.predict(point.coefficients, traces) - problem.speed_rpm) * problem.weight

    def jacobian(x: FloatArray) -> FloatArray:
        point = unpack(x)
        traces = fixed or problem.traces(
            point.delay_s, point.saturation_rpm, with_delay=free_delay, with_saturation=free_limit
        )
        full = problem.predict_with_jacobian(point.coefficients, traces)[1]
        law = full[:, :6]
        if options.unit_gain:
            law = np.delete(law - law[:, [4]], 4, axis=1)
        extra = full[:, 6:] * np.array([period] * free_delay + [_LIMIT_SCALE] * free_limit)
        return np.asarray(
            np.hstack([law[:, :3] @ stable_abc_jacobian(x[:3]), law[:, 3:], extra]) * problem.weight[:, None]
        )

    c = start.coefficients
    x = [*free_coordinates(c[:3]), *(c[[3, 5]] if options.unit_gain else c[3:])]
    low, high = [-np.inf] * laws, [np.inf] * laws
    if free_delay:
        longest = max(options.max_delay_s / period, 1e-9)
        x.append(min(max(start.delay_s / period, 0.0), longest))
        low, high = [*low, 0.0], [*high, longest]
    if free_limit:
        largest = problem.largest_command
        x.append(min(start.saturation_rpm, largest) / _LIMIT_SCALE)
        low, high = [*low, 0.0], [*high, largest / _LIMIT_SCALE]
    found = least_squares(
        residual,
        np.array(x),
        jacobian,
        bounds=(low, high) if free_delay or free_limit else (-np.inf, np.inf),
        method="trf",
        loss=options.loss,
        f_scale=_HUBER,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=options.max_iterations,
    )
    return _Reached(
        unpack(found.x),
        float(found.cost) + problem.within_cost,
        found.status > 0,
        evaluations + int(found.nfev),
    )


def _simplest(problem: LawProblem, point: _Point, cost: float, options: Options) -> tuple[_Point, float, int]:
    """Return (point, cost, order): the lowest order that explains the data as well as the next one."""
    traces = problem.traces(point.delay_s, point.saturation_rpm)
    c = point.coefficients
    gain = 1.0 if options.unit_gain else float(np.sum(c[3:]) / (1.0 - np.sum(c[:3])))
    samples = len(problem.group)
    predicted = problem.predict(c, traces)[problem.group]
    correlated = correlated_share(problem.measured_rpm - predicted)
    order = 3
    for lower in (2, 1):
        found = lower_order(problem, traces, lower, unit_gain=options.unit_gain, gain=gain)
        variance = noise_variance(cost, samples, 2 * order - options.unit_gain)
        if 2.0 * (found.cost - cost) > noise_gain(samples) * variance * correlated:
            break
        point, cost, order = replace(point, coefficients=found.coefficients), found.cost, lower
    return point, cost, order


def _starting_points(runs: Sequence[WheelRun], options: Options) -> list[tuple[str, FloatArray]]:
    """Return (kind, A-F) of every start, the informed ones first."""
    if options.initial:
        return [("given", np.array(row, float)) for row in options.initial]
    points: list[tuple[str, FloatArray]] = []
    if options.first_starts == "informed":
        points.append(("steiglitz-mcbride", steiglitz_mcbride_coefficients(runs)))
        points.append(("one-step", stable_coefficients(one_step_coefficients(runs), unit_gain=True)))
    rng = np.random.default_rng(options.seed)
    points += [("random", random_coefficients(rng)) for _ in range(options.starts - len(points))]
    return points[: options.starts]


def _rms(problem: LawProblem, point: _Point) -> float:
    traces = problem.traces(point.delay_s, point.saturation_rpm)
    return problem.rms(problem.predict(point.coefficients, traces))
