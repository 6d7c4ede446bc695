"""Samples of several sources, each with stamps of its own, as the columns of one log."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.logs.runs import KNOWN, TIME

Columns: TypeAlias = dict[str, FloatArray]
"""Log columns by name, each of shape (n,); NaN: no sample."""
Stamps: TypeAlias = npt.NDArray[np.int64]
"""Times [ns]; integers, since a float of today's date would round them to 256 ns."""


def on_all_stamps(parts: Sequence[tuple[Stamps, Mapping[str, FloatArray]]]) -> Columns:
    """Return all columns of all `parts`, given with their stamps (n,), in the order of `runs.KNOWN`.

    There is a row for each stamp of any part, with NaN elsewhere; `time_s` comes first and starts at 0. Of
    two samples with one stamp, the later counts. Nothing is resampled.
    """
    union = np.unique(np.concatenate([stamps for stamps, _ in parts]))
    merged = {TIME: (union - union[0]) * 1e-9}
    for stamps, columns in parts:
        rows = np.searchsorted(union, stamps)
        for name, values in columns.items():
            column = merged.get(name, np.full(union.size, np.nan))
            column[rows] = values
            merged[name] = column
    return {name: merged[name] for name in KNOWN if name in merged}
