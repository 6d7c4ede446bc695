"""Output error: the stable law whose free-running simulation is nearest to the measurements.

This is maximum likelihood if the measurement noise is white and normal (Ljung, "System Identification",
section 7.4). The search runs in Schur-Cohn coordinates, so every iterate is stable, and with E eliminated, so
every iterate has unit DC gain. Each start has two stages:

1. Variable projection (`projection`): D, E, F enter linearly, so the best ones are solved for and the trust
   region moves in the three pole coordinates only. This is what makes random starts converge.
2. Trust-region least squares in all parameters, including delay and saturation, with the exact Jacobian.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.stability import free_coordinates, stabilised_abc, stable_abc, stable_abc_jacobian
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, Options, StartResult, WheelRun
from sysid.fit.estimators.linear import (
    one_step_coefficients,
    random_coefficients,
    stable_coefficients,
    steiglitz_mcbride_coefficients,
)
from sysid.fit.estimators.order import FREE_BY_ORDER, FittedOrder, simplest_law
from sysid.fit.estimators.problem import LawProblem, Traces, stack
from sysid.fit.estimators.projection import drive_start, gain_start, project

_TOLERANCE: Final = 1e-10
_HUBER: Final = 1.345
_SATURATION_SCALE_RPM: Final = 10.0
"""Unit in which saturation is searched [rpm], so that it is of the size of the other parameters."""


@dataclass(frozen=True)
class _Point:
    """A law with its drive parameters."""

    coefficients: FloatArray
    delay_s: float = 0.0
    saturation_rpm: float = np.inf

    def traces(self, problem: LawProblem) -> Traces:
        return problem.traces(self.delay_s, self.saturation_rpm)

    def rms(self, problem: LawProblem) -> float:
        return problem.rms(problem.predict(self.coefficients, self.traces(problem)))


@dataclass(frozen=True)
class _Reached:
    """Result of the search from one start."""

    point: _Point
    cost: float
    converged: bool
    iterations: int


def output_error(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate the law by output error from several starts and keep the best.

    The law is always stable, and of unit DC gain unless `options.unit_gain` is off. All options are used.

    Raises:
        InputError: no usable data (see `problem.require_excitation`).
    """
    options = options or Options()
    began = time.perf_counter()
    problem = stack(runs, merge=options.loss == "linear")
    delay, limit = drive_start(problem, options)
    delivered = [replace(run, command_rpm=run.command(delay, limit), source=None) for run in runs]
    starts, results = [], []
    for kind, initial in _starting_points(delivered, options):
        start_began = time.perf_counter()
        reached = _fit_from(problem, _Point(initial, delay, limit), options)
        seconds = time.perf_counter() - start_began
        coefficients = reached.point.coefficients
        results.append(reached)
        starts.append(
            StartResult(
                kind=kind,
                initial=tuple(initial.tolist()),
                coefficients=tuple(coefficients.tolist()),
                rms_rpm=reached.point.rms(problem),
                stable=WheelLaw.from_coefficients(coefficients, problem.sample_period_s).is_stable,
                converged=reached.converged,
                iterations=reached.iterations,
                seconds=seconds,
            )
        )
    best = min(results, key=lambda reached: reached.cost)
    found = FittedOrder(3, best.point.coefficients, best.cost)
    if options.order == "auto" and options.loss == "linear":
        found = simplest_law(problem, best.point.traces(problem), found, unit_gain=options.unit_gain)
    point = replace(best.point, coefficients=found.coefficients)
    free = [name for name in FREE_BY_ORDER[found.order] if name in options.free_coefficients]
    free += ["delay_s"] if options.fit_delay else []
    free += ["saturation_rpm"] if np.isfinite(point.saturation_rpm) else []
    return Estimate(
        method="output-error",
        law=WheelLaw.from_coefficients(point.coefficients, problem.sample_period_s),
        rms_rpm=point.rms(problem),
        cost=found.cost,
        free=tuple(free),
        starts=tuple(starts),
        seconds=time.perf_counter() - began,
        delay_s=point.delay_s,
        saturation_rpm=point.saturation_rpm,
    )


def _fit_from(problem: LawProblem, start: _Point, options: Options) -> _Reached:
    """Search from one start, whose poles are first reflected into the stable region."""
    command = start.traces(problem).command_rpm
    gain = 1.0 if options.unit_gain else gain_start(problem, command)
    abc = stabilised_abc(start.coefficients[:3], 0.999)
    coefficients, evaluations = project(problem, Traces(gain * command), abc)
    coefficients[3:] *= gain
    reached = _refine(problem, replace(start, coefficients=coefficients), options)
    return replace(reached, iterations=evaluations + reached.iterations)


def _refine(problem: LawProblem, start: _Point, options: Options) -> _Reached:
    """Stage 2: search all free parameters together from a good start."""
    free_delay, free_limit = options.fit_delay, bool(np.isfinite(start.saturation_rpm))
    period = problem.sample_period_s
    fixed = None if free_delay or free_limit else start.traces(problem)
    laws = len(options.free_coefficients)

    def unpack(x: FloatArray) -> _Point:
        abc = stable_abc(x[:3])
        if options.unit_gain:
            law = np.array([*abc, x[3], 1.0 - (np.sum(abc) + x[3] + x[4]), x[4]])
        else:
            law = np.concatenate([abc, x[3:6]])
        delay = x[laws] * period if free_delay else start.delay_s
        limit = x[-1] * _SATURATION_SCALE_RPM if free_limit else start.saturation_rpm
        return _Point(law, float(delay), float(limit))

    def residual(x: FloatArray) -> FloatArray:
        point = unpack(x)
        return problem.residual(point.coefficients, fixed or point.traces(problem))

    def jacobian(x: FloatArray) -> FloatArray:
        point = unpack(x)
        traces = fixed or problem.traces(
            point.delay_s, point.saturation_rpm, with_delay=free_delay, with_saturation=free_limit
        )
        full = problem.predict_with_jacobian(point.coefficients, traces)[1]
        law = full[:, :6]
        if options.unit_gain:
            law = np.delete(law - law[:, [4]], 4, axis=1)
        extra = full[:, 6:] * np.array([period] * free_delay + [_SATURATION_SCALE_RPM] * free_limit)
        by_x = np.hstack([law[:, :3] @ stable_abc_jacobian(x[:3]), law[:, 3:], extra])
        return np.asarray(by_x * problem.weight[:, None])

    c = start.coefficients
    x = [*free_coordinates(c[:3]), *(c[[3, 5]] if options.unit_gain else c[3:])]
    low, high = [-np.inf] * laws, [np.inf] * laws
    if free_delay:
        longest = max(options.max_delay_s / period, 1e-9)
        x.append(min(max(start.delay_s / period, 0.0), longest))
        low, high = [*low, 0.0], [*high, longest]
    if free_limit:
        largest = problem.largest_command
        x.append(min(start.saturation_rpm, largest) / _SATURATION_SCALE_RPM)
        low, high = [*low, 0.0], [*high, largest / _SATURATION_SCALE_RPM]
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
        unpack(found.x), float(found.cost) + problem.within_cost, found.status > 0, int(found.nfev)
    )


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
