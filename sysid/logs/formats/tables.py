"""Tables with other columns than ours, CSV or Parquet, with stamps of any kind."""

from __future__ import annotations

import csv
import io
from pathlib import Path

import numpy as np

from mecanum_env.errors import InputError, install_command
from mecanum_env.separators import with_plain_separators
from mecanum_env.tables import read_text, table_stem
from sysid.logs.formats.column_map import Numbers
from sysid.logs.formats.foreign import ForeignRun, Part


def read_foreign_table(path: Path) -> ForeignRun:
    """Read a table; columns that hold anything but numbers are left out, whole numbers stay exact integers.

    Raises:
        InputError: the file cannot be read, or has no numbers.
    """
    columns = _parquet(path) if path.name.lower().endswith(".parquet") else _csv(path)
    if not columns:
        raise InputError(f"{path}: no column of numbers")
    return ForeignRun(table_stem(path), str(path), [Part(columns)])


def _csv(path: Path) -> dict[str, Numbers]:
    rows = list(csv.reader(io.StringIO(with_plain_separators(path, read_text(path)))))
    names = [name.strip() for name in rows[0]]
    body = [(line, row) for line, row in enumerate(rows[1:], 2) if any(cell.strip() for cell in row)]
    for line, row in body:
        if len(row) != len(names):
            raise InputError(f"{path}, line {line}: {len(row)} cells, must be {len(names)} as in the header")
    found = {}
    for index, name in enumerate(names):
        numbers = _numbers([row[index].strip() for _, row in body])
        if numbers is not None and name:
            found[name] = numbers
    return found


def _numbers(cells: list[str]) -> Numbers | None:
    for kind in (np.int64, np.float64):
        try:
            return np.array([cell or "nan" for cell in cells], dtype="U").astype(kind)
        except (ValueError, OverflowError):
            continue
    return None


def _parquet(path: Path) -> dict[str, Numbers]:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise InputError(f"{path}: reading Parquet needs pyarrow: {install_command('parquet')}") from error
    try:
        table = pq.read_table(path)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(f"{path}: cannot be read as Parquet ({error})") from error
    found = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if pa.types.is_timestamp(kind):
            column = column.cast(pa.timestamp("ns")).cast(pa.int64())
        elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind)):
            continue
        found[name] = np.asarray(column.to_numpy())
    return found
