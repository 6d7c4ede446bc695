"""The paper's gradient descent on the free-running error, without and with constraints on stability.

S. Nie, N. Igo and K. Hoshino, "Parameter identification of Mecanum wheel robot using descent with stability
criterion", sections 3.2, 3.3 and 4.1. `Options.first_starts` chooses between two forms:

- random: as published. Random starts (`random_starts`) and one constant learning rate alpha = 1.9/L_h, just
  inside the paper's bound 2/L_h, with L_h the largest curvature of H at the best Steiglitz-McBride law.
- informed: improved. Every start is refined by Steiglitz-McBride before the descent, and the steps have
  spectral lengths (`descent.Rule`). The kth start is drawn from the same random numbers as the published kth
  start, which are its first prefilter, so that the two can be compared start by start.

The paper's proof requires that H and the region are convex. Neither is: H of the free run is not convex in A,
B, C (only the one-step error is), and the midpoint of two stable laws can be unstable. So descent finds a
local minimum, the projection is the nearest point of a non-convex set, and several starts are worthwhile.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.law.coefficients import WheelLaw
from mecanum_env.law.stability import FEASIBLE_POLE, nearest_feasible, violation_gradients, violations
from mecanum_env.units import FloatArray
from sysid.fit.estimators.batch import BatchCost, batch_cost
from sysid.fit.estimators.descent import Constraint, Descent, descend
from sysid.fit.estimators.interface import Estimate, Options, StartResult, WheelRun
from sysid.fit.estimators.linear import (
    one_step_coefficients,
    stable_coefficients,
    steiglitz_mcbride_coefficients,
)
from sysid.fit.estimators.problem import LawProblem, stack

_ITERATIONS_PER_EVALUATION: Final = 25
"""Iterations of a descent for each of `Options.max_iterations`, since they are many and cheap."""
_RATE_SHARE: Final = 1.9
"""Constant learning rate in units of 1/L_h; the paper allows 0 to 2."""
_REFINING_ROUNDS: Final = 10
"""Rounds of Steiglitz-McBride that turn a random start into an informed one."""
ROUTH_HURWITZ: Final = Constraint(violations, violation_gradients, nearest_feasible)
"""The four Routh-Hurwitz conditions, and the nearest stable point for an update that violates them."""
_SMALLEST_SLOPE: Final = 1e-9
"""Least slope of the characteristic polynomial, which bounds the derivative of a double root."""


def gradient(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate by unconstrained gradient descent (section 3.2 of the paper, its method of comparison).

    Nothing keeps the result stable: the start with the smallest error is returned, whether stable or not. Of
    the options `starts`, `seed`, `first_starts`, `initial`, `unit_gain` and `max_iterations` are used.

    Raises:
        InputError: no usable data, or no start whose error stays finite.
    """
    return _estimate_by_descent("gradient", runs, options or Options(), None)


def kkt(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate by gradient descent with Routh-Hurwitz constraints (sections 3.2 and 3.3, the proposal).

    KKT multipliers press on violated conditions, and an unstable update is projected to the nearest stable
    law, so that every result is stable. The multipliers have the signs that work (see `descent`), not those
    printed. The options used are those of `gradient`.

    Raises:
        InputError: no usable data.
    """
    return _estimate_by_descent("kkt", runs, options or Options(), ROUTH_HURWITZ)


def pole_discrimination(runs: Sequence[WheelRun], options: Options | None = None) -> Estimate:
    """Estimate by gradient descent with constraints on the pole magnitudes (section 4.1 of the paper).

    The paper names this variant, gives no equations and reports that all trials fail. Here it is `kkt` with
    other constraints: g_i = |z_i| - limit <= 0 for the three poles z_i, and an unstable update is brought
    back by moving each offending pole radially to the limit. Two things differ from Routh-Hurwitz: d|z|/d(A,
    B, C) is infinite at a double pole, and the radial move does not lead to the nearest point and may raise
    H. The options used are those of `gradient`.

    Raises:
        InputError: no usable data.
    """
    return _estimate_by_descent("poles", runs, options or Options(), _POLE_MAGNITUDES)


def random_starts(count: int, seed: int) -> FloatArray:
    """Return random A-F, shape (count, 6), each coefficient uniform in -1..1: half of the laws are stable.

    The paper says "10 sets of random values" and no more. The first n of any count are the same for one seed.
    """
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (count, 6))


def _estimate_by_descent(
    method: str, runs: Sequence[WheelRun], options: Options, constraint: Constraint | None
) -> Estimate:
    """Run one descent from all starts together and keep the best; each start is given an equal time."""
    began = time.perf_counter()
    problem = stack(runs)
    cost = batch_cost(problem)
    kinds, starts = _starting_laws(runs, options, cost)
    descent = descend(
        cost,
        starts,
        rate=_learning_rate(problem, _refined(runs, _one_step_law(runs, options), options, cost)),
        iterations=_ITERATIONS_PER_EVALUATION * options.max_iterations,
        rule="fixed" if options.first_starts == "random" else "spectral",
        constraint=constraint,
        unit_gain=options.unit_gain,
    )
    if not np.any(np.isfinite(descent.cost)):
        raise InputError(
            f"{method}: none of {len(starts)} starts kept a finite error; "
            "use more starts, informed ones, or the method output-error"
        )
    seconds = time.perf_counter() - began
    results = _results(problem, kinds, starts, descent, seconds)
    best = int(np.argmin(descent.cost))
    return Estimate(
        method=method,
        law=WheelLaw.from_coefficients(descent.laws[best], problem.sample_period_s),
        rms_rpm=results[best].rms_rpm,
        cost=0.5 * float(descent.cost[best]) * float(np.sum(problem.weight**2)),
        free=options.free_coefficients,
        starts=tuple(results),
        seconds=seconds,
    )


def _starting_laws(
    runs: Sequence[WheelRun], options: Options, cost: BatchCost
) -> tuple[list[str], FloatArray]:
    """Return the kind of every start and its A-F, shape (S, 6)."""
    if options.initial:
        return ["given"] * len(options.initial), np.array(options.initial, float)
    drawn = random_starts(options.starts, options.seed)
    if options.first_starts == "random":
        return ["random"] * options.starts, drawn
    one_step = _one_step_law(runs, options)
    laws = [_refined(runs, one_step, options, cost), one_step]
    laws += [_refined(runs, row, options, cost) for row in drawn[2:]]
    kinds = ["steiglitz-mcbride", "one-step"] + ["random"] * max(options.starts - 2, 0)
    return kinds[: options.starts], np.array(laws[: options.starts])


def _one_step_law(runs: Sequence[WheelRun], options: Options) -> FloatArray:
    """Return the one-step-ahead law A-F, made stable."""
    law = one_step_coefficients(runs, unit_gain=options.unit_gain)
    return stable_coefficients(law, unit_gain=options.unit_gain)


def _refined(runs: Sequence[WheelRun], law: FloatArray, options: Options, cost: BatchCost) -> FloatArray:
    """Return the best of `_REFINING_ROUNDS` rounds of Steiglitz-McBride that start with the poles of `law`.

    The best and not the last: the rounds do not minimise H, and with a slow pole in the data they may cycle.
    """
    rounds = []
    for _ in range(_REFINING_ROUNDS):
        law = steiglitz_mcbride_coefficients(runs, unit_gain=options.unit_gain, rounds=1, filtered_by=law[:3])
        rounds.append(law)
        if len(rounds) > 1 and np.max(np.abs(law - rounds[-2])) < 1e-9:
            break
    return rounds[int(np.argmin(cost.value(np.array(rounds))))]


def _learning_rate(problem: LawProblem, law: FloatArray) -> float:
    """Return alpha = 1.9/L_h; L_h is the largest eigenvalue of the Gauss-Newton matrix at a good law A-F."""
    jacobian = problem.predict_with_jacobian(law, problem.traces())[1][:, :6] * problem.weight[:, None]
    largest = float(np.linalg.eigvalsh(2.0 * jacobian.T @ jacobian / np.sum(problem.weight**2))[-1])
    return _RATE_SHARE / largest


def _results(
    problem: LawProblem, kinds: Sequence[str], starts: FloatArray, descent: Descent, seconds: float
) -> list[StartResult]:
    traces = problem.traces()
    results = []
    for i, kind in enumerate(kinds):
        law = descent.laws[i]
        finite = bool(np.all(np.isfinite(law)))
        with np.errstate(all="ignore"):
            rms = problem.rms(problem.predict(law, traces)) if finite else np.inf
        results.append(
            StartResult(
                kind=kind,
                initial=tuple(starts[i].tolist()),
                coefficients=tuple(law.tolist()),
                rms_rpm=rms,
                stable=finite and WheelLaw.from_coefficients(law, problem.sample_period_s).is_stable,
                converged=bool(descent.converged[i]),
                iterations=int(descent.iterations[i]),
                seconds=seconds / len(kinds),
            )
        )
    return results


def poles(abc: npt.ArrayLike) -> npt.NDArray[np.complex128]:
    """Return the roots of z^3 - A z^2 - B z - C, shape (S, 3), of (A, B, C), shape (S, 3)."""
    companion = np.zeros((len(np.asarray(abc)), 3, 3))
    companion[:, 0] = abc
    companion[:, 1, 0] = companion[:, 2, 1] = 1.0
    return np.linalg.eigvals(companion).astype(np.complex128)


def magnitude_excess(abc: FloatArray) -> FloatArray:
    """Return |z_i| - `FEASIBLE_POLE`, shape (S, 3), of (A, B, C), shape (S, 3)."""
    return np.abs(poles(abc)) - FEASIBLE_POLE


def magnitude_gradients(abc: FloatArray) -> FloatArray:
    """Return d|z_i|/d(A, B, C), shape (S, 3, 3), from dz = (z^2 dA + z dB + dC) / (3 z^2 - 2 A z - B)."""
    z = poles(abc)
    slope = 3.0 * z * z - 2.0 * abc[:, :1] * z - abc[:, 1:2]
    slope = np.where(np.abs(slope) < _SMALLEST_SLOPE, _SMALLEST_SLOPE, slope)
    by_coefficient = np.stack([z * z, z, np.ones_like(z)], axis=-1) / slope[:, :, None]
    size = np.maximum(np.abs(z), 1e-12)
    return np.asarray(np.real(np.conj(z)[:, :, None] * by_coefficient) / size[:, :, None])


def radially_stable(abc: FloatArray) -> FloatArray:
    """Return (A, B, C), shape (S, 3), with every pole beyond `FEASIBLE_POLE` moved to it along its ray."""
    z = poles(abc)
    size = np.abs(z)
    outside = np.any(size > FEASIBLE_POLE * (1.0 + 1e-12), axis=1)
    z = np.where(size > FEASIBLE_POLE, z * (FEASIBLE_POLE / np.maximum(size, 1e-12)), z)
    one, two, three = z.T
    moved = np.stack(
        [(one + two + three).real, -(one * two + two * three + three * one).real, (one * two * three).real],
        axis=1,
    )
    return np.where(outside[:, None], moved, abc)


_POLE_MAGNITUDES: Final = Constraint(magnitude_excess, magnitude_gradients, radially_stable)
"""The three pole magnitudes, and the radial move for an update that violates them."""
