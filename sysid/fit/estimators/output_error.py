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
from functools import cached_property
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


@dataclass(frozen=True, eq=False)
class _Coordinates:
    """The free parameters as one vector x: stable coordinates of A-C, then of D-F, then delay and ceiling.

    With unit DC gain x holds D and F, and E follows; else D, E and F. The delay is in ticks, the ceiling in
    units of `_SATURATION_SCALE_RPM`; what is not free stays as in `start`.
    """

    problem: LawProblem
    start: _Point
    options: Options

    @property
    def free_delay(self) -> bool:
        return self.options.fit_delay

    @property
    def free_limit(self) -> bool:
        return bool(np.isfinite(self.start.saturation_rpm))

    @cached_property
    def fixed_traces(self) -> Traces | None:
        """The traces of the commands, if no free parameter changes them."""
        return None if self.free_delay or self.free_limit else self.start.traces(self.problem)

    def point(self, x: FloatArray) -> _Point:
        """Return the law and the drive at a place."""
        abc, laws = stable_abc(x[:3]), len(self.options.free_coefficients)
        if self.options.unit_gain:
            law = np.array([*abc, x[3], 1.0 - (np.sum(abc) + x[3] + x[4]), x[4]])
        else:
            law = np.concatenate([abc, x[3:6]])
        delay = x[laws] * self.problem.sample_period_s if self.free_delay else self.start.delay_s
        limit = x[-1] * _SATURATION_SCALE_RPM if self.free_limit else self.start.saturation_rpm
        return _Point(law, float(delay), float(limit))

    def residual(self, x: FloatArray) -> FloatArray:
        """Return the weighted residual at a place."""
        point = self.point(x)
        return self.problem.residual(point.coefficients, self.fixed_traces or point.traces(self.problem))

    def jacobian(self, x: FloatArray) -> FloatArray:
        """Return the exact derivative of `residual`."""
        point = self.point(x)
        traces = self.fixed_traces or self.problem.traces(
            point.delay_s, point.saturation_rpm, with_delay=self.free_delay, with_saturation=self.free_limit
        )
        full = self.problem.predict_with_jacobian(point.coefficients, traces)[1]
        law = full[:, :6]
        if self.options.unit_gain:
            law = np.delete(law - law[:, [4]], 4, axis=1)
        units = [self.problem.sample_period_s] * self.free_delay + [_SATURATION_SCALE_RPM] * self.free_limit
        by_x = np.hstack([law[:, :3] @ stable_abc_jacobian(x[:3]), law[:, 3:], full[:, 6:] * np.array(units)])
        return np.asarray(by_x * self.problem.weight[:, None])

    def begin(self) -> tuple[FloatArray, list[float], list[float]]:
        """Return the place of the start, and the lower and the upper bounds of a search."""
        c, laws = self.start.coefficients, len(self.options.free_coefficients)
        x = [*free_coordinates(c[:3]), *(c[[3, 5]] if self.options.unit_gain else c[3:])]
        low, high = [-np.inf] * laws, [np.inf] * laws
        if self.free_delay:
            period = self.problem.sample_period_s
            longest = max(self.options.max_delay_s / period, 1e-9)
            x.append(min(max(self.start.delay_s / period, 0.0), longest))
            low, high = [*low, 0.0], [*high, longest]
        if self.free_limit:
            largest = self.problem.largest_command
            x.append(min(self.start.saturation_rpm, largest) / _SATURATION_SCALE_RPM)
            low, high = [*low, 0.0], [*high, largest / _SATURATION_SCALE_RPM]
        return np.array(x), low, high


def _refine(problem: LawProblem, start: _Point, options: Options) -> _Reached:
    """Stage 2: search all free parameters together from a good start."""
    free = _Coordinates(problem, start, options)
    x, low, high = free.begin()
    found = least_squares(
        free.residual,
        x,
        free.jacobian,
        bounds=(low, high) if free.free_delay or free.free_limit else (-np.inf, np.inf),
        method="trf",
        loss=options.loss,
        f_scale=_HUBER,
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=options.max_iterations,
    )
    return _Reached(
        free.point(found.x), float(found.cost) + problem.within_cost, found.status > 0, int(found.nfev)
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
