"""The fit linearised at the estimate: the bias from curvature, and what the data cannot tell apart."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.law.coefficients import COEFFICIENTS, WheelLaw
from mecanum_env.units import FloatArray
from sysid.fit.estimators.interface import Estimate, WheelRun
from sysid.fit.estimators.order import noise_variance
from sysid.fit.estimators.problem import LawProblem, Traces, stack

_RANK_TOLERANCE: Final = 1e-11
"""Singular value, relative to the largest, below which a direction is lost in rounding: it is unknown."""
_STEP: Final = 0.2  # step of the second differences, in standard deviations of each direction

_CORRELATION: Final = 0.9  # magnitude of the correlation above which two coefficients are reported as a pair
_MEMBER: Final = 0.25
"""Share of the largest weight above which a coefficient is named in the least known combination."""
_REMEDY: Final = "commands that change more often and in both directions tell them apart better"


@dataclass(frozen=True, eq=False)
class Linearised:
    """Weighted residuals and derivatives at an estimate.

    With J S^-1 = U diag(s) V^T for column norms S, the q parameters in `names` change by `spread` @ z for
    independent directions z of standard deviation 1/s.
    """

    problem: LawProblem
    traces: Traces
    names: tuple[str, ...]
    """A-F, then delay_s and saturation_rpm if they were fitted."""
    value: FloatArray
    """Value of each parameter in `names`, shape (q,)."""
    residual: FloatArray
    """(measured - predicted)/sigma, repeats merged, shape (M,)."""
    jacobian: FloatArray
    """d(predicted)/d(free parameter)/sigma, shape (M, p)."""
    basis: FloatArray
    """U without the lost directions, shape (M, rank)."""
    singular: FloatArray
    """s, shape (p,), largest first."""
    rank: int
    spread: FloatArray
    """d(named)/d(direction), shape (q, p)."""
    samples: int
    """Measurements before merging."""
    fixed_gain: bool
    """Whether E was eliminated, so that the DC gain is always 1."""

    @property
    def sum_of_squares(self) -> float:
        """Weighted sum of squares of all residuals, including those of repeats about their mean."""
        return float(self.residual @ self.residual) + 2.0 * self.problem.within_cost

    def noise_ratio(self, independent: float) -> float:
        """Return the residual standard deviation over the stated sigma, for `independent` samples."""
        cost = 0.5 * self.sum_of_squares * (independent / self.samples)
        return math.sqrt(noise_variance(cost, independent, self.jacobian.shape[1]))

    @property
    def factor(self) -> FloatArray:
        """A matrix L with L L^T the covariance of the parameters for the stated sigmas, shape (q, rank).

        Unknown directions are left out; see `unknown`.
        """
        return np.asarray(self.spread[:, : self.rank] / self.singular[: self.rank])

    @property
    def lost(self) -> FloatArray:
        """The columns of `spread` of the unknown directions, shape (q, p - rank)."""
        return self.spread[:, self.rank :]

    @property
    def unknown(self) -> np.ndarray:
        """Whether each parameter changes along an unknown direction, shape (q,)."""
        size = np.linalg.norm(self.spread, axis=1)
        lost = np.linalg.norm(self.lost, axis=1)
        return np.asarray(lost > 1e-6 * np.where(size > 0.0, size, 1.0))


def linearise(runs: Sequence[WheelRun], estimate: Estimate) -> Linearised:
    """Linearise the free-running prediction of `runs` at an estimate.

    Raises:
        InputError: no usable data (see `sysid.fit.estimators.problem.require_excitation`).
        UnstableLawError: the estimate is unstable, hence has no free-running prediction.
    """
    estimate.law.require_stable()
    problem = stack(runs)
    drive = [name for name in ("delay_s", "saturation_rpm") if name in estimate.free]
    traces = problem.traces(
        estimate.delay_s,
        estimate.saturation_rpm,
        with_delay="delay_s" in drive,
        with_saturation="saturation_rpm" in drive,
    )
    predicted, full = problem.predict_with_jacobian(estimate.coefficients, traces)
    names = (*COEFFICIENTS, *drive)
    by_free = np.array([[float(name == free) for free in estimate.free] for name in names])
    if "E" not in estimate.free:  # E = 1 - A - B - C - D - F
        by_free[4] = [-float(free in COEFFICIENTS) for free in estimate.free]
    jacobian = (full @ by_free) * problem.weight[:, None]
    norms = np.linalg.norm(jacobian, axis=0)
    norms = np.where(norms > 0.0, norms, 1.0)
    # The full right factor is needed if there are fewer samples than parameters; the left one never is.
    triangle = np.linalg.qr(jacobian / norms, mode="r")
    _, singular, right = np.linalg.svd(triangle, full_matrices=True)
    singular = np.concatenate([singular, np.zeros(len(right) - len(singular))])
    rank = int(np.sum(singular > _RANK_TOLERANCE * singular[0]))
    return Linearised(
        problem=problem,
        traces=traces,
        names=names,
        value=np.array([*estimate.coefficients, *(getattr(estimate, name) for name in drive)]),
        residual=(problem.speed_rpm - predicted) * problem.weight,
        jacobian=jacobian,
        basis=(jacobian / norms) @ right[:rank].T / singular[:rank],
        singular=singular,
        rank=rank,
        spread=by_free @ (right / norms).T,
        samples=len(problem.group),
        fixed_gain="E" not in estimate.free,
    )


def second_order_bias(at: Linearised) -> FloatArray:
    """Return the expected error of the parameters for the stated sigmas, shape (q,).

    M. J. Box, "Bias in nonlinear estimation", J. Royal Statistical Society B 33 (1971):
    bias = -1/2 (J^T J)^-1 J^T m with m_i = trace(covariance x Hessian of prediction i). It is proportional to
    the noise variance, so it vanishes relative to the standard error as data grow. Delay and saturation are
    taken as linear. NaN if a law within `_STEP` standard deviations is unstable.
    """
    law, problem = at.value[:6], at.problem
    centre = problem.predict(law, at.traces)
    curvature = np.zeros_like(centre)
    for direction in at.factor[:6].T:
        sides = [law + sign * _STEP * direction for sign in (1.0, -1.0)]
        if not all(WheelLaw.from_coefficients(side, problem.sample_period_s).is_stable for side in sides):
            return np.full(len(at.names), np.nan)
        up, down = (problem.predict(side, at.traces) for side in sides)
        curvature += (up - 2.0 * centre + down) / _STEP**2
    return np.asarray(-0.5 * at.factor @ (at.basis.T @ (curvature * problem.weight)))


@dataclass(frozen=True)
class Quantity:
    """An estimated number and its uncertainty, which is infinite if the data do not determine the number."""

    name: str
    unit: str
    value: float
    standard_error: float
    """Standard error with the noise estimated from the residuals."""
    cramer_rao: float
    """Smallest standard error of any unbiased estimator, with the noise as stated in sigma_rpm."""
    low: float
    high: float
    """Ends of the interval at the requested level, by Student's t."""
    bias: float = 0.0
    """Expected error of a parameter due to curvature, to second order in the noise; not subtracted from the
    value. NaN if it cannot be computed; 0 for metrics."""

    @property
    def relative_error(self) -> float:
        """Standard error over the magnitude of the value."""
        return self.standard_error / abs(self.value) if self.value != 0.0 else math.inf


def weak_combinations(
    at: Linearised, parameters: Sequence[Quantity], metrics: Sequence[Quantity], second_order_suffices: bool
) -> tuple[str, ...]:
    """Return warnings, none if every coefficient is well determined.

    They name unknown `parameters`, pairs that trade off, the least known combination, and those `metrics` of
    the law that are well determined nevertheless. If `second_order_suffices`, C and F are superfluous.
    """
    warnings = list(_unknown(at, parameters, second_order_suffices))
    vague = {q.name for q in parameters if math.isfinite(q.high) and q.high - q.low > abs(q.value)}
    warnings += _pairs(at, parameters, vague)
    if not (warnings or vague):
        return ()
    if vague:
        wide = [q for q in parameters if q.name in vague]
        shown = ", ".join(f"{q.name} = {q.value:.3g} +- {q.high - q.value:.2g}" for q in wide)
        warnings.append(f"95 % interval wider than the value: {shown}; {_REMEDY}")
    if at.rank == len(at.singular) and not second_order_suffices:
        warnings.append(
            f"least known combination: {_combination(at)} "
            f"(condition number {at.singular[0] / at.singular[-1]:.3g})"
        )
    sure = [q for q in metrics if 0.0 < q.relative_error < 0.05]
    if sure:
        shown = ", ".join(f"{q.name} = {q.value:.4g} +- {q.high - q.value:.1g}" for q in sure)
        warnings.append(f"well determined nevertheless: {shown}")
    return tuple(warnings)


def _unknown(at: Linearised, parameters: Sequence[Quantity], second_order_suffices: bool) -> Iterator[str]:
    """Name coefficients that are held at 0, and those without an interval."""
    held = [name for name, row in zip(at.names, at.spread, strict=True) if name in "BCF" and not row.any()]
    if held:
        order = 3 - len(set(held) & {"B", "C"})
        yield (
            f"{', '.join(held)} held at 0: a law of order {order} explains these data as well, and a further "
            f"pole would follow the noise; {_REMEDY}"
        )
    names = ", ".join(q.name for q in parameters if not math.isfinite(q.standard_error))
    if second_order_suffices:
        yield (
            "a second-order law explains these data as well as the third-order one, so A-F have no interval "
            f"of their own: any third pole that a zero cancels fits as well; {_REMEDY}"
        )
    elif names and at.rank == len(at.singular):
        yield f"too few samples for an interval of {names}; record longer runs"
    elif names:
        yield f"these inputs say nothing about {names} on their own; {_REMEDY}"


def _pairs(at: Linearised, parameters: Sequence[Quantity], vague: set[str]) -> list[str]:
    """Name highly correlated pairs of coefficients, of which at least one is vague."""
    factor = at.factor
    size = np.linalg.norm(factor, axis=1)
    found = []
    for i, j in itertools.combinations(range(len(parameters)), 2):
        one, other = parameters[i].name, parameters[j].name
        wide = " and ".join(sorted({one, other} & vague))
        if at.unknown[i] or at.unknown[j] or not wide or size[i] * size[j] == 0.0:
            continue
        correlation = float(factor[i] @ factor[j] / (size[i] * size[j]))
        if abs(correlation) > _CORRELATION:
            text = f"{one} and {other} can hardly be told apart: correlation {correlation:.4f}"
            found.append((-abs(correlation), f"{text}, 95 % interval wider than the value for {wide}"))
    return [text for _, text in sorted(found)]


def _combination(at: Linearised) -> str:
    """Write the direction of largest variance as a sum of named parameters."""
    direction = at.factor[:, -1]
    relative = direction / np.max(np.abs(direction))
    relative = relative / relative[np.argmax(np.abs(relative))]
    weights = zip(relative, at.names, strict=True)
    return " ".join(f"{w:+.2f} {name}" for w, name in weights if abs(w) > _MEMBER).removeprefix("+")
