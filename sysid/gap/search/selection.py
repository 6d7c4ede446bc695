"""Which of many terms describe a residual, and how many: regression that is confirmed on parts left out.

Terms are chosen one after the other, each the one that lowers the squared error most with all chosen so far
refitted (orthogonal least squares; Chen, Billings and Luo, Int. J. Control 50(5), 1989). How many terms is
decided by leaving out one part of the data after the other, such as a command sequence: terms that predict
the parts left out no better than none are not chosen. A term may have several columns, such as the sine and
cosine of an angle, which are chosen together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import add
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray

MOST_TERMS: Final = 3
"""Largest number of terms: a longer formula is no clue."""
_LEAST_EXPLAINED: Final = 0.05
"""Share of the squared error in parts left out that the first term must explain."""
_LEAST_GAIN: Final = 0.02
"""Share of the squared error that each further term must explain."""
_SURE: Final = 2.0
"""Standard errors over the parts by which a gain must exceed zero."""
_PLAIN: Final = 0.5
"""Explained share from which a gain is sure anyway: parts in which little happens gain little."""
_RIDGE: Final = 1e-9
"""Relative ridge that keeps the normal equations regular when columns are collinear."""


@dataclass(frozen=True)
class Choice:
    """The terms that hold on parts left out."""

    terms: tuple[int, ...]
    """Indices of the terms, the most important first."""
    coefficients: tuple[tuple[float, ...], ...]
    """Of each term's columns."""
    explained: float
    """Share of the squared error in parts left out that they explain."""

    def first(self, count: int) -> Choice:
        """Return the choice cut down to its first terms; `count` is at least 1."""
        return Choice(self.terms[:count], self.coefficients[:count], self.explained)


def choose(
    target: FloatArray,
    columns: FloatArray,
    widths: Sequence[int],
    parts: Sequence[npt.NDArray[np.bool_]],
) -> Choice | None:
    """Return the terms that describe a target (N,); None if none does on parts left out.

    Args:
        target: what is to be described.
        columns: of all terms side by side, shape (N, p).
        widths: number of columns of each term, together p.
        parts: which of the N values belong to each part; at least two parts are needed.
    """
    sums = [_Sums.of(target[part], columns[part]) for part in parts]
    squares = np.array([part.square for part in sums])
    if len(sums) < 2 or squares.sum() <= 0.0 or not widths:
        return None
    edges = np.concatenate([[0], np.cumsum(widths)])
    terms = [list(range(a, b)) for a, b in pairwise(edges)]
    whole = reduce(add, sums)
    # Row k: the error in each part that k terms leave, chosen and fitted without that part.
    left = np.array([_errors(whole.without(part), part, terms) for part in sums]).T
    count = _how_many(left, squares)
    if count == 0:
        return None
    order = _forward(whole, terms, count)
    values = iter(whole.solve([column for term in order for column in terms[term]]).tolist())
    coefficients = tuple(tuple(next(values) for _ in terms[term]) for term in order)
    return Choice(tuple(order), coefficients, float(1.0 - left[count].sum() / squares.sum()))


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums of products over the samples of one part of the data: all that least squares needs of it."""

    gram: FloatArray
    """Products of the columns with each other, shape (p, p)."""
    moment: FloatArray
    """Products of the columns with the target, shape (p,)."""
    square: float
    """Square of the target."""

    @staticmethod
    def of(target: FloatArray, columns: FloatArray) -> _Sums:
        """Return the sums of a target (n,) and columns (n, p)."""
        return _Sums(columns.T @ columns, columns.T @ target, float(target @ target))

    def __add__(self, other: _Sums) -> _Sums:
        return _Sums(self.gram + other.gram, self.moment + other.moment, self.square + other.square)

    def without(self, part: _Sums) -> _Sums:
        """Return the sums less those of a `part` that is in them."""
        return _Sums(self.gram - part.gram, self.moment - part.moment, self.square - part.square)

    def solve(self, use: Sequence[int]) -> FloatArray:
        """Return the least-squares coefficients of the columns in `use`."""
        gram = self.gram[np.ix_(use, use)]
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        scaled = gram / np.outer(size, size) + _RIDGE * np.eye(len(use))
        found: FloatArray = np.linalg.solve(scaled, self.moment[use] / size) / size
        return found

    def error(self, use: Sequence[int], coefficients: FloatArray) -> float:
        """Return the squared error that columns in `use` with these coefficients leave."""
        explained = (
            2.0 * self.moment[use] @ coefficients - coefficients @ self.gram[np.ix_(use, use)] @ coefficients
        )
        return self.square - float(explained)


def _errors(rest: _Sums, part: _Sums, terms: Sequence[list[int]]) -> list[float]:
    """Return the squared errors in a part that 0, 1, 2 ... terms leave, chosen and fitted to the rest."""
    errors = [part.square]
    order = _forward(rest, terms, MOST_TERMS)
    for count in range(1, len(order) + 1):
        use = [column for term in order[:count] for column in terms[term]]
        errors.append(part.error(use, rest.solve(use)))
    return errors


def _forward(sums: _Sums, terms: Sequence[list[int]], count: int) -> list[int]:
    """Return the terms in the order in which each lowers the error most beside those before it."""
    order: list[int] = []
    for _ in range(min(count, len(terms))):
        use = [column for term in order for column in terms[term]]
        left = {
            term: sums.error([*use, *columns], sums.solve([*use, *columns]))
            for term, columns in enumerate(terms)
            if term not in order
        }
        order.append(min(left, key=lambda term: left[term]))
    return order


def _how_many(left: FloatArray, squares: FloatArray) -> int:
    """Return how many terms hold on parts left out: each further one must gain enough, and surely.

    `left` is the squared error for each number of terms (rows) in each part (columns), `squares` is that of
    the target in each part.
    """
    total = squares.sum()
    count = 0
    for more in range(1, len(left)):
        gains = left[count] - left[more]
        share = gains.sum() / total
        standard_error = np.std(gains, ddof=1) * np.sqrt(len(gains)) / total
        needed = _LEAST_EXPLAINED if count == 0 else _LEAST_GAIN
        sure = share > min(_SURE * standard_error, _PLAIN)
        if share >= needed * (more - count) and sure:
            count = more
    return count
