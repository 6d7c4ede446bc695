"""Regression of a sparse readable correction on an error that no effect explains: a clue, not physics.

Terms are chosen one after the other, each the one that lowers the squared error most with all chosen so far
refitted (orthogonal least squares; Chen, Billings and Luo, Int. J. Control 50(5), 1989). How many is decided
by leaving out one command sequence after the other; what predicts no better than nothing is not reported.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from sysid.compare.correction import Correction, Feature, Term, features, formula
from sysid.compare.samples import Samples
from sysid.gap.result import EmpiricalTerm
from sysid.gap.search.sparse import Sums, choose

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
