"""Writing logs as the contract of log folders has them: a CSV file per run, and a `dataset.toml`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt


@dataclass(frozen=True)
class ListedRun:
    """What `dataset.toml` says of one run."""

    file: str
    group: str
    """Repeats of one command sequence have the same."""
    split: str = ""
    """fit, validation or test; empty: left to the reader."""


def write_run(path: Path, columns: Mapping[str, npt.NDArray[np.float64]]) -> None:
    """Write one run as CSV.

    Args:
        path: of the file.
        columns: name -> samples (n,), in the order of the columns; a missing sample (nan) is an empty cell,
            and stamps (`time_s`) are written to the microsecond.
    """
    rows = np.stack(list(columns.values()), axis=1).tolist()
    forms = ["{:.6f}" if name == "time_s" else "{:.6g}" for name in columns]
    lines = [
        ",".join("" if math.isnan(v) else form.format(v) for v, form in zip(row, forms, strict=True))
        for row in rows
    ]
    path.write_text("\n".join([",".join(columns), *lines]) + "\n", encoding="utf-8")


def write_dataset(folder: Path, name: str, runs: Sequence[ListedRun]) -> None:
    """Write the `dataset.toml` of a folder.

    Args:
        folder: that holds the runs.
        name: of the dataset.
        runs: the files, with the groups and splits that they belong to.
    """
    lines = ["[dataset]", f'name = "{name}"']
    for run in runs:
        lines += ["", "[[runs]]", f'file = "{run.file}"', f'group = "{run.group}"']
        if run.split:
            lines.append(f'split = "{run.split}"')
    (folder / "dataset.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")
