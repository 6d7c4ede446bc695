"""The fit linearised at the estimate: residuals, Jacobian and its directions; the bias from curvature."""

from __future__ import annotations

import math
from collections.abc import Sequence
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
_STEP: Final = 0.2
"""Step of the second differences, in standard deviations of each direction."""


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
    singular, right = _singular(jacobian / norms)
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


def _singular(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return all p singular values and right vectors (rows), shapes (p,) and (p, p), of an (M, p) matrix."""
    triangle = np.linalg.qr(matrix, mode="r")
    _, singular, right = np.linalg.svd(triangle, full_matrices=True)
    return np.concatenate([singular, np.zeros(len(right) - len(singular))]), right


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
