"""The free-running error of many laws at once, with its exact gradient by A-F.

The prediction is linear in the command, and the cost is quadratic in the prediction. So the commands are
first reduced to a basis (steps of one shape and any height need one row), and the measurements to the
quadratic form H = constant - 2 q.y + y.Q.y of the basis responses y. This leaves two passes of the recursion
per law.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.signal import lfilter
from scipy.sparse import csr_matrix

from mecanum_env.units import FloatArray
from sysid.fit.estimators.problem import LawProblem

_FEW: Final = 100
"""Number of laws up to which a compiled filter per law is faster than one vectorised recursion."""


@dataclass(frozen=True, eq=False)
class BatchCost:
    """H(A-F), the weighted mean of (measured - predicted)^2 [rpm^2]; build it with `batch_cost`."""

    basis: FloatArray
    """Basis of the commands relative to the start [rpm], shape (K, R)."""
    quadratic: csr_matrix
    """Q, banded, shape (K R, K R)."""
    linear: FloatArray
    """q, shape (K R, 1)."""
    constant: float

    def value(self, laws: npt.ArrayLike) -> FloatArray:
        """Return H, shape (S,), of `laws` A-F, shape (S, 6); infinite on overflow."""
        x = np.asarray(laws, float)
        with np.errstate(over="ignore", invalid="ignore"):
            flat = self._response(x, self._by_d(x)).reshape(-1, len(x))
            cost = self.constant + np.sum(flat * (self.quadratic @ flat - 2.0 * self.linear), axis=0)
        return np.where(np.isfinite(cost), np.maximum(cost, 0.0), np.inf)

    def __call__(self, laws: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return H, shape (S,), infinite on overflow, and dH/d(A-F), shape (S, 6), of `laws`, shape (S, 6).

        The laws may be unstable, since the horizon is that of the data.
        """
        x = np.asarray(laws, float)
        count, (ticks, rank) = len(x), self.basis.shape
        with np.errstate(over="ignore", invalid="ignore"):
            by_d = self._by_d(x)
            y = self._response(x, by_d)
            by_a = np.zeros_like(y)
            by_a[1:] = all_pole(x[:, :3], y[:-1])
            flat = y.reshape(ticks * rank, count)
            product = self.quadratic @ flat
            cost = self.constant + np.sum(flat * (product - 2.0 * self.linear), axis=0)
            back = (2.0 * (product - self.linear)).reshape(y.shape)
            columns = [
                np.einsum("krs,krs->s", back[lag:], signal[: ticks - lag])
                for signal in (by_a, by_d)
                for lag in range(3)
            ]
        gradient = np.stack(columns, axis=1)
        lost = ~(np.isfinite(cost) & np.all(np.isfinite(gradient), axis=1))
        cost[lost], gradient[lost] = np.inf, 0.0
        return np.maximum(cost, 0.0), gradient

    def _by_d(self, x: FloatArray) -> FloatArray:
        """Return the basis through 1/(1 - A/z - B/z^2 - C/z^3), which is d(response)/dD, shape (K, R, S)."""
        return all_pole(x[:, :3], np.broadcast_to(self.basis[:, :, None], (*self.basis.shape, len(x))))

    @staticmethod
    def _response(x: FloatArray, by_d: FloatArray) -> FloatArray:
        """Return the responses after ticks 0..K-1, shape (K, R, S)."""
        y = x[:, 3] * by_d
        y[1:] += x[:, 4] * by_d[:-1]
        y[2:] += x[:, 5] * by_d[:-2]
        return np.asarray(y)


def all_pole(abc: FloatArray, drive: FloatArray) -> FloatArray:
    """Return y(k) = drive(k) + A y(k-1) + B y(k-2) + C y(k-3) from rest, `drive` and y of shape (K, R, S).

    A, B, C have shape (S, 3).
    """
    ticks, rank, count = drive.shape
    if count <= _FEW:
        result = np.empty((ticks, rank, count))
        for s in range(count):
            result[:, :, s] = lfilter([1.0], [1.0, *(-abc[s])], drive[:, :, s], axis=0)
        return result
    a, b, c = (np.ascontiguousarray(column) for column in abc.T)
    padded = np.zeros((ticks + 3, rank, count))
    product = np.empty((rank, count))
    for k in range(ticks):
        y = padded[k + 3]
        np.multiply(a, padded[k + 2], out=y)
        y += drive[k]
        y += np.multiply(b, padded[k + 1], out=product)
        y += np.multiply(c, padded[k], out=product)
    return padded[3:]


def batch_cost(problem: LawProblem) -> BatchCost:
    """Reduce a problem to the cost of many laws at once.

    The commands have no additional delay or limit. Runs are treated as deviations from their steady start,
    which is exact for starts at rest and for laws of unit gain.
    """
    inputs = problem.traces().command_rpm - problem.initial_rpm[:, None]  # (U, K)
    left, values, right = np.linalg.svd(inputs, full_matrices=False)
    keep = values > 1e-12 * values[0]
    basis, loading = right[keep].T * values[0], left[:, keep] * (values[keep] / values[0])
    ticks, rank = basis.shape
    samples = len(problem.row)
    pieces = []
    # A measurement at tick + fraction mixes the responses after ticks `tick - 1` and `tick`, from tick 0 on.
    for shift, share in ((-1, 1.0 - problem.fraction), (0, problem.fraction)):
        after = problem.tick + shift
        used = (after >= 0) & (share != 0.0)
        index = after[used, None] * rank + np.arange(rank)
        data = share[used, None] * loading[problem.row[used]]
        rows = np.broadcast_to(np.flatnonzero(used)[:, None], index.shape)
        places = (rows.ravel(), index.ravel())
        pieces.append(csr_matrix((data.ravel(), places), shape=(samples, ticks * rank)))
    gather = (pieces[0] + pieces[1]).tocsr()
    precision = problem.weight**2
    precision /= np.sum(precision)
    deviation = problem.speed_rpm - problem.initial_rpm[problem.row]
    weighted = gather.multiply(precision[:, None]).T.tocsr()
    within = 2.0 * problem.within_cost / float(np.sum(problem.weight**2))
    return BatchCost(
        basis=basis,
        quadratic=(weighted @ gather).tocsr(),
        linear=np.asarray(weighted @ deviation)[:, None],
        constant=float(precision @ deviation**2) + within,
    )
