"""Ratings of many players from the results between them: Elo's, by the logistic model.

A player rated R beats one rated S with probability 1 / (1 + 10^((S - R) / 400)) (A. Elo, "The Rating of
Chessplayers", 1978; the model of R. A. Bradley and M. E. Terry, Biometrika 39:324, 1952). All ratings are
fitted at once, so that they do not depend on the order of the matches.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray

PER_LOGIT: Final = 400.0 / np.log(10.0)
"""Elo points in one unit of the logistic model's argument."""
_PRIOR_SD: Final = 600.0
"""Standard deviation of the ratings before any match; it keeps who always wins finite."""
_STEPS: Final = 50
_CLOSE: Final = 1e-9


@dataclass(frozen=True)
class Ratings:
    """Ratings of n players relative to the first one, whose rating is 0."""

    elo: FloatArray
    """Shape (n,)."""
    error: FloatArray
    """Standard error of each, shape (n,); 0 for the first."""


def fit_elo(scores: FloatArray, bouts: FloatArray) -> Ratings:
    """Return the ratings that make the results most probable, with a weak prior.

    Args:
        scores: wins, and half the draws, of each player against each other one, shape (n, n).
        bouts: number of bouts between them, symmetric, shape (n, n).

    Raises:
        InputError: the arrays are not square, or the scores of a pair do not add up to its bouts.
    """
    n = len(scores)
    if scores.shape != (n, n) or bouts.shape != (n, n) or not np.allclose(scores + scores.T, bouts):
        raise InputError("scores: of each pair they must add up to its bouts, in square arrays")
    weight = (PER_LOGIT / _PRIOR_SD) ** 2
    rating = np.zeros(n)
    for _ in range(_STEPS):
        expected = 1.0 / (1.0 + np.exp(rating[None, :] - rating[:, None]))
        gradient = (scores - bouts * expected).sum(axis=1) - weight * rating
        information = bouts * expected * (1.0 - expected)
        hessian = np.diag(information.sum(axis=1) + weight) - information
        step = np.linalg.solve(hessian, gradient)
        # Newton's step may be too long while nobody is rated yet.
        rating = rating + step * min(1.0, 1.0 / max(float(np.abs(step).max()), 1e-12))
        if np.abs(step).max() < _CLOSE:
            break
    covariance = np.linalg.inv(hessian)
    variance = np.diag(covariance) + covariance[0, 0] - 2.0 * covariance[0]
    return Ratings(PER_LOGIT * (rating - rating[0]), PER_LOGIT * np.sqrt(np.maximum(variance, 0.0)))
