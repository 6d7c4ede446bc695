"""Strict reading of a table of numbers: CSV (with ',', ';' or tabs), gzipped CSV or Parquet.

NumPy parses a correct file in C. Only if that fails are the cells read one by one, to name the line, the
value and what would be right.
"""

from __future__ import annotations

import csv
import gzip
import io
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, install_command
from mecanum_env.separators import with_plain_separators
from mecanum_env.units import FloatArray

SUFFIXES: Final = (".csv", ".csv.gz", ".parquet")
"""Endings of the names of such files."""


@dataclass(frozen=True, eq=False)
class Table:
    """The numbers of one file."""

    path: Path
    names: tuple[str, ...]
    """Column names."""
    values: FloatArray
    """Numbers, shape (rows, columns), never infinite; NaN where a cell is empty or nan."""
    lines: npt.NDArray[np.intp] | None
    """Line of each row, counted from 1 with the header; None for a Parquet file, which has no lines."""

    def where(self, row: int) -> str:
        """Return the place of a row: ``'file, line 12'``, in a Parquet file ``'file, row 11'``."""
        place = f"row {row + 1}" if self.lines is None else f"line {self.lines[row]}"
        return f"{self.path}, {place}"

    @property
    def header(self) -> str:
        """The place of the header: ``'file, line 1'``, of a Parquet file ``'file'``."""
        return f"{self.path}" if self.lines is None else f"{self.path}, line 1"

    def column(self, name: str) -> FloatArray:
        """Return one column, shape (rows,)."""
        return self.values[:, self.names.index(name)]


def has_table_suffix(path: Path) -> bool:
    """Return whether the file's name ends in one of `SUFFIXES`."""
    return path.name.lower().endswith(SUFFIXES)


def table_stem(path: Path) -> str:
    """Return the file's name without its suffix."""
    for suffix in (".csv.gz", ".csv", ".parquet"):
        if path.name.lower().endswith(suffix):
            return path.name[: -len(suffix)]
    return path.stem


def read_table(path: Path) -> Table:
    """Read a table; the suffix of its name gives the format.

    Raises:
        InputError: the file cannot be read, is empty, is not of the format that its suffix says, or has rows
            of different lengths, text where a number belongs, or an infinite value.
    """
    table = _read_parquet(path) if path.name.lower().endswith(".parquet") else _read_csv(path)
    infinite = np.isinf(table.values)
    if infinite.any():
        row, column = (int(i) for i in np.argwhere(infinite)[0])
        raise InputError(
            f"{table.where(row)}: {table.names[column]} = {table.values[row, column]}, "
            "must be a finite number; leave the cell empty where a sample is missing"
        )
    return table


def _read_csv(path: Path) -> Table:
    text = with_plain_separators(path, read_text(path))
    header, _, body = text.partition("\n")
    names = _header(path, header)
    if not body.strip():
        raise InputError(f"{path}: has a header but no rows; a run needs at least 2")
    # loadtxt refuses empty cells. ",," is replaced twice, since matches do not overlap.
    filled = f"\n{body.rstrip()}\n"
    for empty, nan in ((",,", ",nan,"), (",,", ",nan,"), (",\n", ",nan\n"), ("\n,", "\nnan,")):
        filled = filled.replace(empty, nan)
    try:
        values = np.loadtxt(io.StringIO(filled), delimiter=",", comments=None, ndmin=2)
    except ValueError:
        values = _walk_cells(path, text, names)
    if values.shape[1] != len(names):
        values = _walk_cells(path, text, names)
    lines = np.arange(2, len(values) + 2)
    if body.rstrip("\n").count("\n") + 1 != len(values):  # blank lines were skipped
        lines = np.array([i for i, line in enumerate(text.split("\n"), 1) if line.strip()][1:])
    return Table(path, names, values, lines)


def read_text(path: Path) -> str:
    """Return the text without byte order mark and with bare newlines."""
    try:
        data = path.read_bytes()
        if path.name.lower().endswith(".gz"):
            data = gzip.decompress(data)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"{path}: not a whole gzip file ({error}); compress it again with gzip") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(f"{path}, line {line}: not UTF-8 text; save the log as CSV in UTF-8") from error
    text = text.replace("\r\n", "\n").replace("\r", "\n")
    if not text.strip():
        raise InputError(f"{path}: is empty; a log has a header row and at least 2 rows")
    return text


def _header(path: Path, line: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in next(csv.reader([line]), []))
    where = f"{path}, line 1"
    if names and all(_number(name) is not None for name in names):
        raise InputError(f"{where}: {line[:60]!r} is a row of numbers; the first line must name the columns")
    for index, name in enumerate(names):
        if not name:
            raise InputError(f"{where}: column {index + 1} has no name; name it or remove it")
        if name in names[:index]:
            raise InputError(f"{where}: column {name!r} appears twice; remove one")
    return names


def _number(cell: str) -> float | None:
    """Return the number in a cell, NaN for a missing sample, None for anything else."""
    text = cell.strip()
    if not text:
        return float("nan")
    try:
        # float() accepts 1_000, too, which no other program writes or reads.
        return None if "_" in text else float(text)
    except ValueError:
        return None


def _walk_cells(path: Path, text: str, names: tuple[str, ...]) -> FloatArray:
    """Parse cell by cell, which is slow, and raise an error at the first wrong cell."""
    reader = csv.reader(io.StringIO(text))
    rows = []
    try:
        for cells in reader:
            if reader.line_num == 1 or (len(cells) < 2 and not "".join(cells).strip()):
                continue
            where = f"{path}, line {reader.line_num}"
            if len(cells) != len(names):
                raise InputError(
                    f"{where}: {len(cells)} cells, must be {len(names)} as in the header ({', '.join(names)})"
                )
            row = []
            for name, cell in zip(names, cells, strict=True):
                value = _number(cell)
                if value is None:
                    raise InputError(
                        f"{where}: {name} = {cell.strip()!r}, must be a number; "
                        "leave the cell empty where a sample is missing"
                    )
                row.append(value)
            rows.append(row)
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: not CSV ({error})") from error
    return np.array(rows, float)


def _read_parquet(path: Path) -> Table:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise InputError(
            f"{path}: reading Parquet needs pyarrow; convert the log to CSV, or install it with "
            f"{install_command('parquet')}"
        ) from error
    try:
        table = pq.read_table(path)
    except pa.ArrowInvalid as error:
        raise InputError(f"{path}: not a Parquet file ({error})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error})") from error
    names = tuple(table.column_names)
    for index, name in enumerate(names):
        if name in names[:index]:
            raise InputError(f"{path}: column {name!r} appears twice; remove one")
        kind = table.schema.field(index).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)):
            raise InputError(f"{path}: column {name!r} holds {kind}, must be numbers")
    if table.num_rows == 0:
        raise InputError(f"{path}: has columns but no rows; a run needs at least 2")
    columns = [column.cast(pa.float64()).to_numpy() for column in table.columns]
    return Table(path, names, np.column_stack([np.asarray(c, float) for c in columns]), None)
