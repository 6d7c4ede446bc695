"""Writing runs as `read_dataset` reads them: one table per run, and a `dataset.toml`."""

from __future__ import annotations

import gzip
import io
import json
import os
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from mecanum_env.errors import InputError, install_command
from mecanum_env.files import atomic_path, write_text
from mecanum_env.tables import has_table_suffix
from mecanum_env.units import FloatArray
from sysid.logs.runs import TIME, Dataset, Run
from sysid.logs.settings import FILE_NAME


def write_dataset(dataset: Dataset, folder: str | os.PathLike[str]) -> None:
    """Write every run under its own file name, and a `dataset.toml` with name, groups and splits.

    Numbers are written in full double precision, so that `read_dataset` returns an equal dataset.

    Raises:
        InputError: a file name that is not a log's, or a folder that cannot be written.
    """
    folder = Path(folder)
    for run in dataset.runs:
        write_run(run, folder / run.file)
    lines = ["[dataset]", f"name = {quoted(dataset.name)}"]
    for run in dataset.runs:
        lines += ["", "[[runs]]", f"file = {quoted(run.file)}"]
        lines += [f"group = {quoted(run.group)}", f"split = {quoted(run.split)}"]
    write_text(folder / FILE_NAME, "\n".join(lines) + "\n")


def write_run(run: Run, path: str | os.PathLike[str]) -> None:
    """Write one run as .csv, .csv.gz or .parquet, by the path's suffix; a missing sample is an empty cell.

    Raises:
        InputError: another suffix, or the folder cannot be written.
    """
    write_columns({TIME: run.time_s + run.start_s, **run.command.columns(), **run.channels}, path)


def write_columns(columns: Mapping[str, FloatArray], path: str | os.PathLike[str]) -> None:
    """Write columns, each of shape (n,), as a log file by the path's suffix.

    Raises:
        InputError: another suffix than .csv, .csv.gz or .parquet, a folder that cannot be written, or
            `pyarrow` is not installed.
    """
    path = Path(path)
    if not has_table_suffix(path):
        raise InputError(f"{path}: a log's name must end in .csv, .csv.gz or .parquet")
    suffix = path.name.lower().rsplit(".", 1)[-1]
    if suffix == "parquet":
        try:
            import pyarrow as pa
            import pyarrow.parquet as pq
        except ImportError as error:
            raise InputError(
                f"{path}: writing Parquet needs pyarrow: {install_command('parquet')}"
            ) from error
        with atomic_path(path) as temporary:
            pq.write_table(pa.table({name: np.asarray(v) for name, v in columns.items()}), temporary)
        return
    text = io.StringIO()
    text.write(",".join(columns) + "\n")
    for row in zip(*(values.tolist() for values in columns.values()), strict=True):
        text.write(",".join("" if cell != cell else _shortest(cell) for cell in row) + "\n")
    data = text.getvalue().encode()
    with atomic_path(path) as temporary:
        # The gzip header has no time stamp, so that equal runs make equal files.
        temporary.write_bytes(gzip.compress(data, mtime=0) if suffix == "gz" else data)


def _shortest(value: float) -> str:
    """Return the shortest text that reads back equal; whole numbers without a point."""
    whole = value.is_integer() and abs(value) < 1e15 and str(value) != "-0.0"
    return str(int(value)) if whole else repr(value)


def quoted(text: str) -> str:
    """Return `text` as a TOML string; bytes of a file name that are no text become question marks."""
    text = text.encode("utf-8", "replace").decode("utf-8")
    # A JSON string is a TOML string, except for DEL, which only JSON allows unescaped.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
