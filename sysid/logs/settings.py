"""`dataset.toml`: name of the dataset, mapping of its columns, groups and splits of its runs."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NoReturn

from mecanum_env.errors import InputError, did_you_mean
from mecanum_env.reading import read_toml
from sysid.logs.runs import KNOWN, SPLITS, Split

FILE_NAME: Final = "dataset.toml"


@dataclass(frozen=True)
class ColumnRule:
    """Origin of one of the log columns: `scale` * (column `source` of the file) + `offset`."""

    source: str
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class RunEntry:
    """What `dataset.toml` states about one run; None where it states nothing."""

    file: str
    group: str | None = None
    split: Split | None = None


@dataclass(frozen=True)
class Settings:
    """Contents of a `dataset.toml`; the defaults are those of a folder without one."""

    path: Path | None = None
    name: str | None = None
    ignore_columns: tuple[str, ...] = ()
    """Columns of the files that are not read."""
    columns: Mapping[str, ColumnRule] = field(default_factory=dict)
    runs: Mapping[str, RunEntry] = field(default_factory=dict)
    """Stated runs by file name."""


def read_settings(folder: Path) -> Settings:
    """Read the folder's `dataset.toml`, or return the defaults if there is none.

    Raises:
        InputError: invalid TOML, an unknown key, a value of the wrong type, or a run listed twice.
    """
    path = folder / FILE_NAME
    if not os.path.lexists(path):
        return Settings()
    value, text = read_toml(path)
    return _Parser(path, text).settings(value)


class _Parser:
    """Checks every key and value; keeps the text, so that errors can name the line."""

    def __init__(self, path: Path, text: str) -> None:
        self.path = path
        self.lines = text.splitlines()

    def settings(self, value: Mapping[str, Any]) -> Settings:
        self.keys(value, ("dataset", "columns", "runs"), "")
        dataset = self.table(value.get("dataset", {}), "[dataset]")
        self.keys(dataset, ("name", "ignore_columns"), "[dataset] ")
        ignored = dataset.get("ignore_columns", [])
        if not isinstance(ignored, list) or not all(isinstance(item, str) for item in ignored):
            self.fail("ignore_columns", f"ignore_columns = {ignored!r}, must be a list of column names")
        return Settings(
            path=self.path,
            name=self.string(dataset, "name"),
            ignore_columns=tuple(ignored),
            columns=self.columns(self.table(value.get("columns", {}), "[columns]")),
            runs=self.runs(value.get("runs", [])),
        )

    def columns(self, value: Mapping[str, Any]) -> dict[str, ColumnRule]:
        self.keys(value, KNOWN, "[columns] ")
        rules = {}
        for name, entry in value.items():
            if not isinstance(entry, dict):
                example = '{ from = "omega", scale = 9.55 }'
                self.fail(name, f"{name} = {entry!r}, must be a table such as {example}")
            self.keys(entry, ("from", "scale", "offset"), f"{name}: ")
            source = self.string(entry, "from")
            if source is None:
                self.fail(name, f'{name} lacks "from", the column\'s name in the files')
            scale, offset = self.number(entry, "scale", name, 1.0), self.number(entry, "offset", name, 0.0)
            if scale == 0.0:
                self.fail(name, f"{name}: scale = 0, must not be 0")
            rules[name] = ColumnRule(source, scale, offset)
        return rules

    def runs(self, value: Any) -> dict[str, RunEntry]:
        if not isinstance(value, list):
            self.fail("runs", "runs must be an array of tables: [[runs]]")
        entries: dict[str, RunEntry] = {}
        for entry in value:
            entry = self.table(entry, "[[runs]]")
            self.keys(entry, ("file", "group", "split"), "[[runs]] ")
            file = self.string(entry, "file")
            if not file:
                self.fail("runs", 'a [[runs]] entry lacks "file"')
            if Path(file).name != file:
                self.fail(file, f'file = "{file}", must be a file name in the same folder, without a path')
            if file in entries:
                self.fail(file, f'run "{file}" is listed twice; remove one entry', last=True)
            stated = self.string(entry, "split")
            split = next((known for known in SPLITS if known == stated), None)
            if stated and not split:
                hint = did_you_mean(stated, SPLITS)
                self.fail(stated, f'split = "{stated}"{hint}, must be one of {", ".join(SPLITS)}')
            entries[file] = RunEntry(file, self.string(entry, "group"), split)
        return entries

    def fail(self, token: str, message: str, *, last: bool = False) -> NoReturn:
        """Raise an `InputError` that names the first (or last) line on which the token stands."""
        word = re.compile(rf"(?<![\w.]){re.escape(token)}(?![\w.])")
        found = [number for number, line in enumerate(self.lines, 1) if word.search(line.split("#")[0])]
        line = f", line {found[-1 if last else 0]}" if found else ""
        raise InputError(f"{self.path}{line}: {message}")

    def keys(self, value: Mapping[str, Any], known: Sequence[str], where: str) -> None:
        for key in value:
            if key not in known:
                hint = did_you_mean(key, known)
                self.fail(key, f'{where}unknown key "{key}"{hint}; known: {", ".join(known)}')

    def table(self, value: Any, where: str) -> Mapping[str, Any]:
        if not isinstance(value, dict):
            self.fail(where.strip("[]"), f"{where} must be a table, not {value!r}")
        return dict(value)

    def string(self, value: Mapping[str, Any], key: str) -> str | None:
        text = value.get(key)
        if text is None:
            return None
        if not isinstance(text, str) or not text.strip():
            self.fail(key, f"{key} = {text!r}, must be a non-empty string")
        return str(text)

    def number(self, value: Mapping[str, Any], key: str, name: str, default: float) -> float:
        number = value.get(key, default)
        if isinstance(number, bool) or not isinstance(number, int | float) or not math.isfinite(number):
            self.fail(name, f"{name}: {key} = {number!r}, must be a finite number")
        return float(number)
