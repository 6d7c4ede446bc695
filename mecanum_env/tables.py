"""Strict reading of a table of numbers: CSV (with ',', ';' or tabs), gzipped CSV or Parquet.

NumPy parses a correct file in C. Only if that fails are the cells read one by one, to name the line, the
value and what would be right.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError, install_command
from mecanum_env.reading import read_bytes
from mecanum_env.separators import with_plain_separators
from mecanum_env.units import FloatArray, unit_of_stamps

_MOST_BYTES: Final = 1 << 30
"""Largest text of a table [bytes]; a day at 100 Hz has about half of it."""
_MOST_CELLS: Final = 1 << 27
"""Most cells of a Parquet file; a file of a few bytes can hold any number of equal ones."""
_MOST_COLUMNS: Final = 10_000
_LONGEST_NAME: Final = 1000
"""Longest name of a column [characters]."""
_EXACT: Final = 1 << 53
"""From here on double precision skips whole numbers."""
_LONGEST_JUMP_S: Final = 3600.0
"""Longest time between two rows [s]. A run is simulated from its first stamp to its last, so a single wrong
stamp could exhaust the memory."""
_LONGEST_RUN_S: Final = 86400.0
"""Longest time from the first row to the last [s]: ten million ticks of the law still fit into memory."""
_FEW_ROWS: Final = 20
"""So few rows do not show the unit of their stamps."""
_SPLIT: Final = "split the run into several files"

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


def read_table(path: Path, ignored: Collection[str] = ()) -> Table:
    """Read a table; the suffix of its name gives the format.

    Columns that are to be `ignored` may hold anything, and have no numbers in the table.

    Raises:
        InputError: the file cannot be read, is empty, is not of the format that its suffix says, or has rows
            of different lengths, text where a number belongs, or an infinite value.
    """
    is_parquet = path.name.lower().endswith(".parquet")
    table = _read_parquet(path, ignored) if is_parquet else _read_csv(path, ignored)
    table.values[:, [name in ignored for name in table.names]] = np.nan
    infinite = np.isinf(table.values)
    if infinite.any():
        row, column = (int(i) for i in np.argwhere(infinite)[0])
        raise InputError(
            f"{table.where(row)}: {table.names[column]} = {table.values[row, column]}, "
            "must be a finite number; leave the cell empty where a sample is missing"
        )
    return table


def check_stamps(table: Table, time_s: FloatArray) -> None:
    """Refuse stamps of the rows of a table, shape (rows,) [s], with which no run can be simulated.

    Raises:
        InputError: one is missing, not later than the one before, or far from the others.
    """
    missing = np.flatnonzero(np.isnan(time_s))
    if missing.size:
        where = table.where(int(missing[0]))
        raise InputError(f"{where}: time_s is missing; every row needs a stamp in seconds")
    backwards = np.flatnonzero(np.diff(time_s) <= 0.0)
    if backwards.size:
        row = int(backwards[0]) + 1
        raise InputError(
            f"{table.where(row)}: time_s = {time_s[row]!s} after {time_s[row - 1]!s}, must be larger than "
            "the stamp before; cut the file where the clock jumps, and remove rows that appear twice"
        )
    far = np.flatnonzero(np.diff(time_s) > _LONGEST_JUMP_S)
    late = np.flatnonzero(time_s - time_s[0] > _LONGEST_RUN_S)
    usual = float(np.median(np.diff(time_s))) if len(time_s) > _FEW_ROWS else 0.0
    if usual > _LONGEST_JUMP_S or (late.size and usual >= 1.0):
        unit, scale = unit_of_stamps(usual)
        raise InputError(
            f"{table.header}: rows are {usual:g} s apart, {time_s[-1] - time_s[0]:g} s in all; is time_s in "
            f"{unit}? (scale = {scale:g}); give it as the column's scale under [columns] in dataset.toml"
        )
    if far.size:
        row = int(far[0]) + 1
        raise InputError(
            f"{table.where(row)}: time_s jumps from {time_s[row - 1]!s} to {time_s[row]!s} s, by more than "
            f"{_LONGEST_JUMP_S:g} s; split the run there, or correct the stamp"
        )
    if late.size:
        row = int(late[0])
        raise InputError(
            f"{table.where(row)}: time_s = {time_s[row]!s} is {time_s[row] - time_s[0]:g} s after the first "
            f"stamp, must be at most {_LONGEST_RUN_S:g} s; split the run, or correct stamps that are not in "
            "seconds"
        )


def _read_csv(path: Path, ignored: Collection[str]) -> Table:
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
        values = _walk_cells(path, text, names, ignored)
    if values.shape[1] != len(names):
        values = _walk_cells(path, text, names, ignored)
    lines = np.arange(2, len(values) + 2)
    if body.rstrip("\n").count("\n") + 1 != len(values):  # blank lines were skipped
        lines = np.array([i for i, line in enumerate(text.split("\n"), 1) if line.strip()][1:])
    return Table(path, names, values, lines)


def read_text(path: Path) -> str:
    """Return the text without byte order mark and with bare newlines."""
    data = read_bytes(path, _SPLIT, _MOST_BYTES)
    try:
        if path.name.lower().endswith(".gz"):
            with gzip.open(io.BytesIO(data)) as packed:
                # A file of a megabyte can hold a thousand times as much.
                parts, size = [], 0
                while size <= _MOST_BYTES and (part := packed.read(1 << 20)):
                    parts.append(part)
                    size += len(part)
                data = b"".join(parts)
    except (gzip.BadGzipFile, EOFError, zlib.error) as error:
        raise InputError(f"{path}: not a whole gzip file ({error}); compress it again with gzip") from error
    if len(data) > _MOST_BYTES:
        raise InputError(f"{path}: more than {_MOST_BYTES} bytes unpacked; {_SPLIT}")
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
    where = f"{path}, line 1"
    try:
        names = tuple(name.strip() for name in next(csv.reader([line]), []))
    except csv.Error as error:
        raise InputError(f"{where}: not CSV ({error}); the first line must name the columns") from error
    if names and all(_number(name) is not None for name in names):
        raise InputError(f"{where}: {line[:60]!r} is a row of numbers; the first line must name the columns")
    for index, name in enumerate(names):
        if not name:
            raise InputError(f"{where}: column {index + 1} has no name; name it or remove it")
    _require_names(where, names)
    return names


def _require_names(where: str, names: tuple[str, ...]) -> None:
    """Refuse names of columns that are too many, too long or there twice."""
    if len(names) > _MOST_COLUMNS:
        raise InputError(f"{where}: {len(names)} columns, must be at most {_MOST_COLUMNS}")
    seen = set()
    for name in names:
        if len(name) > _LONGEST_NAME:
            raise InputError(
                f"{where}: column {name[:40]!r}... has a name of {len(name)} characters, must be at most "
                f"{_LONGEST_NAME}; the first line must name the columns"
            )
        if name in seen:
            raise InputError(f"{where}: column {name!r} appears twice; remove one")
        seen.add(name)


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


def _walk_cells(path: Path, text: str, names: tuple[str, ...], ignored: Collection[str]) -> FloatArray:
    """Parse cell by cell, which is slow, and raise an error at the first wrong cell that is not `ignored`."""
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
                value = math.nan if name in ignored else _number(cell)
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


def _read_parquet(path: Path, ignored: Collection[str]) -> Table:
    try:
        import pyarrow as pa
        import pyarrow.parquet as pq
    except ImportError as error:
        raise InputError(
            f"{path}: reading Parquet needs pyarrow; convert the log to CSV, or install it with "
            f"{install_command('parquet')}"
        ) from error
    data = read_bytes(path, _SPLIT, _MOST_BYTES)
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        about = file.metadata
        if about.num_rows * about.num_columns > _MOST_CELLS:
            raise InputError(
                f"{path}: {about.num_rows} rows of {about.num_columns} columns, must be at most "
                f"{_MOST_CELLS} cells; {_SPLIT}"
            )
        _require_names(str(path), tuple(file.schema_arrow.names))
        table = file.read()
    except InputError:
        raise
    except (pa.ArrowException, OSError, ValueError, KeyError, MemoryError, UnicodeError) as error:
        said = " ".join(str(error).split())[:200]
        raise InputError(f"{path}: not a Parquet file ({said})") from error
    names = tuple(table.column_names)
    for index, name in enumerate(names):
        if name in ignored:
            table = table.set_column(index, name, pa.nulls(table.num_rows, pa.float64()))
        kind = table.schema.field(index).type
        if not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_null(kind)):
            raise InputError(f"{path}: column {name!r} holds {kind}, must be numbers")
    if table.num_rows == 0:
        raise InputError(f"{path}: has columns but no rows; a run needs at least 2")
    columns = [_in_double_precision(path, name, table.column(i)) for i, name in enumerate(names)]
    return Table(path, names, np.column_stack(columns), None)


def _in_double_precision(path: Path, name: str, column: Any) -> FloatArray:
    """Return an Arrow column of numbers as an array, shape (rows,); NaN where one is missing."""
    import pyarrow as pa
    import pyarrow.compute as pc

    if pa.types.is_integer(column.type):
        ends = pc.min_max(column).as_py()
        for value in (ends["min"], ends["max"]):
            if value is not None and abs(value) > _EXACT:
                row = int(pc.index(column, value).as_py())
                raise InputError(
                    f"{path}, row {row + 1}: {name} = {value}, must be at most 2^53 to be exact in double "
                    "precision; subtract the first stamp, or write seconds as a floating-point number"
                )
    return np.asarray(column.cast(pa.float64()).to_numpy(), float)
