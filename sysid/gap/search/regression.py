"""Regression of a sparse readable correction on an error that no effect explains: a clue, not physics.

Terms are chosen one after the other, each the one that lowers the squared error most with all chosen so far
refitted (orthogonal least squares; Chen, Billings and Luo, Int. J. Control 50(5), 1989). How many terms is
decided by leaving out one command sequence after the other; a correction that predicts the sequences left
out no better than none is not reported. A term may have several columns, such as the sine and cosine of an
angle, which are chosen together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from operator import add
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.compare.correction import Correction, Feature, Term, features, formula
from sysid.compare.samples import Samples
from sysid.gap.result import EmpiricalTerm

_MOST_TERMS: Final = 4
"""Largest number of terms: a longer formula is no clue."""
_LEAST_EXPLAINED: Final = 0.05
"""Share of the squared error in sequences left out that the first term must explain."""
_LEAST_GAIN: Final = 0.02
"""Share of the squared error that each further term must explain."""
_SURE: Final = 2.0
"""Standard errors over the sequences by which a gain must exceed zero."""
_RIDGE: Final = 1e-9
"""Relative ridge that keeps the normal equations regular when columns are collinear."""
_NOT_TRIED: Final = ("x_m", "y_m", "yaw_rad", "battery_v")
"""The error of a pose is the sum of all earlier errors; no function of the moment describes it."""


def fit_correction(samples: Sequence[Samples]) -> Correction | None:
    """Return the correction of the improved model's error; None if none holds on sequences left out.

    The error of `after` is corrected, in the samples of the runs that decide. At least two command sequences
    (or two runs of one) are needed, since one that was not fitted has to confirm.
    """
    by_channel: dict[str, list[Samples]] = {}
    for part in samples:
        if part.channel not in _NOT_TRIED and part.time_s.size >= 2:
            by_channel.setdefault(part.channel, []).append(part)
    terms, explained = {}, {}
    for channel, parts in by_channel.items():
        tables = [features(channel, part.time_s, part.wheels, part.after) for part in parts]
        names = list(tables[0])
        widths = [tables[0][name].columns.shape[1] for name in names]
        chosen = _choose(_sums(parts, tables), widths)
        if chosen is not None:
            coefficients, explained[channel] = chosen
            terms[channel] = tuple(Term(names[term], values) for term, values in coefficients.items())
    return Correction(terms, explained) if terms else None


def empirical_term(correction: Correction, adopted: bool) -> EmpiricalTerm:
    """Return a correction as formulas for the report, `adopted` if it is in the improved model's file."""
    formulas = {channel: formula(channel, terms) for channel, terms in correction.terms.items()}
    return EmpiricalTerm(formulas, correction.explained, adopted)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Sums of products over the samples of one part of the data: all that least squares needs of it."""

    gram: FloatArray
    """Products of the columns with each other, shape (p, p)."""
    moment: FloatArray
    """Products of the columns with the target, shape (p,)."""
    square: float
    """Square of the target."""

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


def _sums(parts: Sequence[Samples], tables: Sequence[Mapping[str, Feature]]) -> list[_Sums]:
    """Return the sums of each command sequence; of each run if there is one sequence only."""
    one_sequence = len({part.group for part in parts}) < 2
    found: dict[str, _Sums] = {}
    for part, table in zip(parts, tables, strict=True):
        error = part.errors()[1]
        known = np.isfinite(error)
        columns = np.concatenate([feature.columns for feature in table.values()], axis=1)[known]
        weight = (np.ones(error.size) if part.weight is None else part.weight)[known]
        weighted, target = columns * weight[:, None], error[known]
        sums = _Sums(columns.T @ weighted, weighted.T @ target, float(weight @ target**2))
        key = part.run if one_sequence else part.group
        found[key] = found[key] + sums if key in found else sums
    return list(found.values())


def _choose(
    parts: Sequence[_Sums], widths: Sequence[int]
) -> tuple[dict[int, tuple[float, ...]], float] | None:
    """Return term -> coefficients and the share explained in parts left out; None if no term holds there.

    Each of the parts of the data is left out in turn; `widths` are the numbers of columns of the terms.
    """
    squares = np.array([part.square for part in parts])
    if len(parts) < 2 or squares.sum() <= 0.0:
        return None
    edges = np.concatenate([[0], np.cumsum(widths)])
    terms = [list(range(a, b)) for a, b in pairwise(edges)]
    whole = reduce(add, parts)
    # Row k: the error in each part that k terms leave, chosen and fitted without that part.
    left = np.array([_errors(whole.without(part), part, terms) for part in parts]).T
    count = _how_many(left, squares)
    if count == 0:
        return None
    order = _forward(whole, terms, count)
    values = iter(whole.solve([column for term in order for column in terms[term]]).tolist())
    coefficients = {term: tuple(next(values) for _ in terms[term]) for term in order}
    return coefficients, float(1.0 - left[count].sum() / squares.sum())


def _errors(rest: _Sums, part: _Sums, terms: Sequence[list[int]]) -> list[float]:
    """Return the squared errors in a part that 0, 1, 2 ... terms leave, chosen and fitted to the rest."""
    errors = [part.square]
    order = _forward(rest, terms, _MOST_TERMS)
    for count in range(1, _MOST_TERMS + 1):
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
        if share >= needed * (more - count) and share > _SURE * standard_error:
            count = more
    return count
