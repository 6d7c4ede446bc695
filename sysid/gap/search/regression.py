"""Regression of a sparse readable correction on an error that no effect explains: a clue, not physics.

Terms are chosen one after the other, each the one that lowers the squared error most with all chosen so far
refitted (orthogonal least squares; Chen, Billings and Luo, Int. J. Control 50(5), 1989). How many terms is
decided by leaving out one command sequence after the other; a correction that predicts the sequence left out
no better than none is not reported.
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
from sysid.compare.correction import Correction, Term, formula
from sysid.compare.features import Feature, features
from sysid.compare.samples import Samples
from sysid.gap.result import EmpiricalTerm

MOST_TERMS: Final = 4
"""More are no longer a clue."""
LEAST_EXPLAINED: Final = 0.05
"""Share of the squared error, on parts left out, from which something was found."""
LEAST_GAIN: Final = 0.02
"""What a further term must explain besides."""
SURE: Final = 2.0
"""Gains count from so many of their standard errors over the parts."""
_RIDGE: Final = 1e-9
"""Relative; keeps columns that say the same from dividing by zero."""
_NOT_TRIED: Final = ("x_m", "y_m", "yaw_rad", "battery_v")
"""The error of a pose is the sum of all that went wrong before; no function of the moment."""


def fit_correction(samples: Sequence[Samples]) -> Correction | None:
    """Return the correction of what the better model leaves over; None where nothing holds on other runs.

    Args:
        samples: of the runs that may decide; `after` is what is corrected. There must be two command
            sequences at least, since one that was not fitted has to confirm.
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
        chosen = choose(_sums(parts, tables), widths)
        if chosen is not None:
            terms[channel] = tuple(
                Term(names[group], tuple(values)) for group, values in chosen.coefficients.items()
            )
            explained[channel] = chosen.explained
    return Correction(terms, explained) if terms else None


def empirical_term(correction: Correction, adopted: bool) -> EmpiricalTerm:
    """Return a correction as the report tells it.

    Args:
        correction: as fitted.
        adopted: whether it is in the improved model's file.
    """
    return EmpiricalTerm(
        {channel: formula(channel, terms) for channel, terms in correction.terms.items()},
        correction.explained,
        adopted,
    )


def _sums(parts: Sequence[Samples], tables: Sequence[Mapping[str, Feature]]) -> list[Sums]:
    """Return the sums of products of each command sequence; of each run where there is but one sequence."""
    alone = len({part.group for part in parts}) < 2
    found: dict[str, Sums] = {}
    for part, table in zip(parts, tables, strict=True):
        error = part.errors()[1]
        known = np.isfinite(error)
        columns = np.concatenate([feature.columns for feature in table.values()], axis=1)[known]
        weight = np.ones(error.size) if part.weight is None else part.weight
        sums = Sums.of(columns, error[known], weight[known])
        key = part.run if alone else part.group
        found[key] = found[key] + sums if key in found else sums
    return list(found.values())


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products over the samples of one part of the data: all that least squares needs of it."""

    gram: FloatArray
    """Of the columns with each other, shape (p, p)."""
    moment: FloatArray
    """Of the columns with the target, shape (p,)."""
    square: float
    """Of the target with itself."""

    @classmethod
    def of(cls, columns: FloatArray, target: FloatArray, weight: FloatArray) -> Sums:
        """Return the sums of some samples.

        Args:
            columns: candidates, shape (n, p).
            target: what they shall explain, shape (n,).
            weight: of each sample, shape (n,).
        """
        weighed = columns * weight[:, None]
        return cls(columns.T @ weighed, weighed.T @ target, float(weight @ target**2))

    def __add__(self, other: Sums) -> Sums:
        return Sums(self.gram + other.gram, self.moment + other.moment, self.square + other.square)

    def without(self, part: Sums) -> Sums:
        """Return the sums less those of a `part` that is in them."""
        return Sums(self.gram - part.gram, self.moment - part.moment, self.square - part.square)

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


@dataclass(frozen=True)
class Choice:
    """A few groups of columns and their coefficients."""

    coefficients: Mapping[int, tuple[float, ...]]
    """Group -> one coefficient a column, in the order of choice."""
    explained: float
    """Share of the squared target in parts that were left out."""


def choose(parts: Sequence[Sums], widths: Sequence[int]) -> Choice | None:
    """Return the groups that explain the target on parts that were not fitted; None where none does.

    Args:
        parts: of the data; each is left out in turn. At least two.
        widths: columns of each group, which are chosen together.
    """
    if len(parts) < 2:
        return None
    edges = np.concatenate([[0], np.cumsum(widths)])
    groups = [list(range(a, b)) for a, b in pairwise(edges)]
    whole = reduce(add, parts)
    squares = np.array([part.square for part in parts])
    if squares.sum() <= 0.0:
        return None
    # Row s: the error that s terms, chosen and fitted without a part, leave in it.
    left = np.array([_left(whole.without(part), part, groups) for part in parts]).T
    count = _how_many(left, squares)
    if count == 0:
        return None
    order = _forward(whole, groups, count)
    use = [column for group in order for column in groups[group]]
    values = iter(whole.solve(use).tolist())
    found = {group: tuple(next(values) for _ in groups[group]) for group in order}
    return Choice(found, float(1.0 - left[count].sum() / squares.sum()))


def _left(rest: Sums, part: Sums, groups: Sequence[list[int]]) -> list[float]:
    errors = [part.square]
    order = _forward(rest, groups, MOST_TERMS)
    for count in range(1, MOST_TERMS + 1):
        use = [column for group in order[:count] for column in groups[group]]
        errors.append(part.error(use, rest.solve(use)))
    return errors


def _forward(sums: Sums, groups: Sequence[list[int]], count: int) -> list[int]:
    """Return the groups in the order in which each lowers the error most beside those before it."""
    order: list[int] = []
    for _ in range(min(count, len(groups))):
        use = [column for group in order for column in groups[group]]
        left = {
            group: sums.error([*use, *columns], sums.solve([*use, *columns]))
            for group, columns in enumerate(groups)
            if group not in order
        }
        order.append(min(left, key=lambda group: left[group]))
    return order


def _how_many(left: FloatArray, squares: FloatArray) -> int:
    """Return how many terms hold on parts left out: each further one must gain enough, and surely.

    Args:
        left: error of each number of terms (rows) in each part (columns).
        squares: of the target in each part.
    """
    total = squares.sum()
    count = 0
    for more in range(1, len(left)):
        gains = left[count] - left[more]
        share = gains.sum() / total
        # Over the parts; with few of them a gain must be the more alike in all.
        doubt = np.std(gains, ddof=1) * np.sqrt(len(gains)) / total
        needed = LEAST_EXPLAINED if count == 0 else LEAST_GAIN
        if share >= needed * (more - count) and share > SURE * doubt:
            count = more
    return count
