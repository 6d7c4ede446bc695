"""The error of a robot's model along what effects would do: common to all command sequences, and of each.

A model of a robot with other rollers errs a little differently in each command sequence: where friction, slip
or the point of contact matter, the same factors do not fit all of them. So the whitened residual of sequence
s is r_s = K_s (f + d_s) + e_s: f are the factors that all sequences share, and d_s, normal with a standard
deviation for each column, are what a single sequence adds. Both are found from the logs of the fit by maximum
likelihood (EM; random effects, Laird and Ware, Biometrics 38:963, 1982). In other logs d_s of each sequence
is unknown again: only what is systematic over them, and more than what the sequences of the fit differ by,
is then told from the model's own error.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

_ROUNDS: Final = 30
"""Rounds of EM."""
_LEAST_SIZE: Final = 1e-9
_START: Final = 1.0
"""Standard deviation from which EM starts: a stated one of a fitted parameter, 5 % of an effect's range."""
_NEGLIGIBLE: Final = 0.1
"""Length of a column, in noise sigmas over all samples, below which it is left out."""


@dataclass(frozen=True, eq=False)
class VaryingPosterior:
    """The factors given a whitened residual with a variance of 1 beside them."""

    mean: FloatArray
    """Of the common factors, shape (q,)."""
    covariance: FloatArray
    """Of the common factors, shape (q, q)."""
    precision: FloatArray
    """Of the prior of each common factor, shape (q,)."""
    varying: FloatArray
    """Standard deviation by which each factor differs between command sequences, (q,)."""

    @classmethod
    def of(
        cls,
        residual: FloatArray,
        columns: FloatArray,
        folds: npt.NDArray[np.intp],
        size: FloatArray,
        group_of: npt.NDArray[np.intp],
    ) -> VaryingPosterior:
        """Return the posterior of the factors of `columns` (N, q) given a `residual` (N,).

        Args:
            residual: whitened.
            columns: whitened.
            folds: the command sequence that each value belongs to, (N,).
            size: prior standard deviation of each factor, (q,); where it is estimated, the start.
            group_of: number of the group of factors that share an estimated deviation, (q,); factors of
                negative groups keep theirs, and vary from sequence to sequence.
        """
        size, varies = np.array(size, float), group_of < 0
        parts = [_Sums.of(residual[folds == fold], columns[folds == fold]) for fold in np.unique(folds)]
        spread = np.where(varies, _START, 0.0)
        estimated = [np.flatnonzero(group_of == group) for group in np.unique(group_of[~varies])]
        for _ in range(_ROUNDS):
            mean, covariance, squares = _expected(parts, size, spread, varies)
            around = mean**2 + np.diag(covariance)
            for mine in estimated:
                size[mine] = np.sqrt(np.mean(around[mine])) + _LEAST_SIZE
            spread[varies] = np.minimum(np.sqrt(squares), size[varies]) + _LEAST_SIZE
        mean, covariance, _ = _expected(parts, size, spread, varies)
        return cls(mean, covariance, size**-2.0, spread)

    def left_out_costs(
        self, residual: FloatArray, columns: FloatArray, folds: npt.NDArray[np.intp]
    ) -> FloatArray:
        """Return e' C^-1 e of each fold, (f,), with e the error of what the others predict.

        The whitened `residual` (N,), `columns` (N, q) and `folds` (N,) are those of `of`.
        """
        names = np.unique(folds)
        parts = [_Sums.of(residual[folds == fold], columns[folds == fold]) for fold in names]
        size, varies, costs = self.precision**-0.5, self.varying > 0.0, []
        for index, part in enumerate(parts):
            others = [*parts[:index], *parts[index + 1 :]]
            mean, covariance, _ = _expected(others, size, self.varying, varies)
            mine = folds == names[index]
            e, k = residual[mine] - columns[mine] @ mean, columns[mine]
            along = k.T @ e
            inner = np.linalg.inv(covariance + np.diag(self.varying**2)) + part.gram
            costs.append(float(e @ e - along @ np.linalg.solve(inner, along)))
        return np.array(costs)


def columns_of_sequences(
    columns: FloatArray, varying: FloatArray, folds: npt.NDArray[np.intp]
) -> list[FloatArray]:
    """Return what factors that differ between the command sequences of some logs may add: columns (N, k).

    Args:
        columns: whitened, (N, q).
        varying: standard deviation by which each factor differs, (q,).
        folds: the command sequence that each value belongs to, (N,).
    """
    found = []
    for fold in np.unique(folds) if np.any(varying) else ():
        mine = folds == fold
        scaled = columns[np.ix_(mine, varying > 0.0)] * varying[varying > 0.0]
        directions, length, _ = np.linalg.svd(scaled, full_matrices=False)
        kept = length > _NEGLIGIBLE
        whole = np.zeros((folds.size, int(np.count_nonzero(kept))))
        whole[mine] = directions[:, kept] * length[kept]
        found.append(whole)
    return found


@dataclass(frozen=True, eq=False)
class _Sums:
    """What the likelihood needs of one command sequence."""

    gram: FloatArray
    aim: FloatArray

    @classmethod
    def of(cls, residual: FloatArray, columns: FloatArray) -> _Sums:
        """Return K' K and K' r of a sequence."""
        return cls(columns.T @ columns, columns.T @ residual)


def _expected(
    parts: list[_Sums], size: FloatArray, spread: FloatArray, varies: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return mean and covariance of the common factors, and the mean squares of what sequences add, (v,).

    The factors of each sequence are eliminated from the normal equations.
    """
    own = np.diag(np.maximum(spread[varies], _LEAST_SIZE) ** -2.0)
    information, aim, eliminated = np.diag(size**-2.0), np.zeros(size.size), []
    for part in parts:
        inverse = np.linalg.inv(part.gram[np.ix_(varies, varies)] + own)
        across = inverse @ part.gram[varies]
        information = information + part.gram - part.gram[varies].T @ across
        aim = aim + part.aim - across.T @ part.aim[varies]
        eliminated.append((inverse, across, inverse @ part.aim[varies]))
    covariance = np.asarray(np.linalg.inv(information), float)
    mean = covariance @ aim
    squares = np.zeros(int(np.count_nonzero(varies)))
    for inverse, across, alone in eliminated:
        variance = np.diag(inverse) + np.sum((across @ covariance) * across, axis=1)
        squares += (alone - across @ mean) ** 2 + variance
    return mean, covariance, squares / max(1, len(parts))
