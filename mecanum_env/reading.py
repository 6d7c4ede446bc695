"""Reading files that come from elsewhere: plain files of a sane size, JSON, TOML and arrays within bounds.

Whatever is in the file, it is read or refused in one sentence (`InputError`) that begins with its path.
"""

from __future__ import annotations

import json
import math
import os
import re
import stat
import tokenize
import tomllib
import zipfile
import zlib
from typing import Any, BinaryIO, Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.files import as_os_error

_MOST_TEXT: Final = 64 << 20
"""Largest text file that is read whole [bytes]; a model or a certificate has less than a hundredth of it."""
_DEEPEST: Final = 60
"""Most levels of brackets, and most dots in one key."""
_LONGEST_NUMBER: Final = 320
"""Most digits of a whole number; double precision ends below."""
_MOST_TOML: Final = 4 << 20
"""Largest TOML file [bytes]."""
_MOST_ARRAYS: Final = 1 << 28
"""Largest size of all arrays of an archive [bytes], unless told otherwise."""
_TORN_ARRAYS: Final = (
    OSError, EOFError, TypeError, ValueError, KeyError, MemoryError, RuntimeError, SyntaxError,
    tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip
"""Errors that NumPy raises for a file that is no archive of arrays or is torn."""
_STRING: Final = re.compile(r""""(?:[^"\\\n]|\\.)*(?:"|\\?$)|'[^'\n]*'?""", re.MULTILINE)
"""A string in one line, or the rest of the line where it is not closed."""
_BETWEEN: Final = re.compile(r"[=,\[\]{}\n#]")
"""What a key of TOML does not contain outside of strings."""


def read_bytes(path: str | os.PathLike[str], hint: str = "", most: int = _MOST_TEXT) -> bytes:
    """Return the bytes of a plain file.

    Args:
        path: of the file.
        hint: what to do if it cannot be read; ends the sentence.
        most: size beyond which it is refused [bytes].

    Raises:
        InputError: there is no such file, it is a folder, a pipe or a device, or it is too large.
    """
    advice = f"; {hint}" if hint else ""
    try:
        # Without O_NONBLOCK, opening a named pipe would wait for somebody to write into it.
        handle = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        with os.fdopen(handle, "rb") as file:
            about = os.fstat(handle)
            if not stat.S_ISREG(about.st_mode):
                raise InputError(f"{path}: not a plain file{advice}")
            if about.st_size > most:
                raise InputError(f"{path}: {about.st_size} bytes, must be at most {most}{advice}")
            return file.read()
    except InputError:
        raise
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: cannot be read ({as_os_error(error).strerror}){advice}") from error


def read_json(path: str | os.PathLike[str], hint: str = "") -> Any:
    """Return what the JSON file at `path` holds; the `hint` ends the sentence if it cannot be read.

    Raises:
        InputError: no plain file, not UTF-8, not JSON, NaN or an infinity, a number beyond double precision,
            or brackets that are nested too deep.
    """
    try:
        text = read_bytes(path, hint).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not a text file, must be JSON{f'; {hint}' if hint else ''}") from error
    return parse_json(text, str(path))


def parse_json(text: str, where: str) -> Any:
    """Return the value of a JSON text; `where` begins the sentence if it has none.

    Raises:
        InputError: as for `read_json`.
    """
    try:
        return json.loads(text, parse_constant=_refuse_constant, parse_int=_whole_number, parse_float=_number)
    except json.JSONDecodeError as error:
        raise InputError(f"{where}, line {error.lineno}: not valid JSON ({error.msg})") from error
    except RecursionError as error:
        raise InputError(f"{where}: not valid JSON, brackets are nested too deep") from error
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def read_toml(path: str | os.PathLike[str]) -> tuple[dict[str, Any], str]:
    """Return what the TOML file at `path` holds, and its text.

    Raises:
        InputError: no plain file, not UTF-8, not TOML, numbers beyond double precision, or brackets or keys
            that are nested too deep.
    """
    try:
        text = read_bytes(path, most=_MOST_TOML).decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text") from error
    # The parser needs memory by the square of the dots.
    if any(word.count(".") > _DEEPEST for word in _BETWEEN.split(_STRING.sub("", text))):
        raise InputError(f"{path}: not valid TOML: a key has more than {_DEEPEST} dots")
    try:
        value = tomllib.loads(text, parse_float=_number)
        _refuse_long_numbers(value)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error
    except RecursionError as error:
        raise InputError(f"{path}: not valid TOML: brackets are nested too deep") from error
    except ValueError as error:
        said = str(error) if isinstance(error, InputError) else "a number has too many digits"
        raise InputError(f"{path}: not valid TOML: {said}") from error
    return value, text


def parse_arrays(file: BinaryIO, most: float = _MOST_ARRAYS) -> dict[str, Any]:
    """Return the arrays of an `.npz` archive by name; none of them may hold Python objects.

    Args:
        file: open for reading, and seekable.
        most: size of all arrays beyond which they are refused [bytes].

    Raises:
        ValueError: it is no such archive, it is torn, or its arrays are too large.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            # A small archive can hold a thousand times as much.
            if sum(one.file_size for one in archive.infolist()) > most:
                raise ValueError("its arrays are too large")
        file.seek(0)
        with np.load(file, allow_pickle=False) as stored:
            return {name: stored[name] for name in stored.files}
    except _TORN_ARRAYS as error:
        raise ValueError(f"no archive of arrays, or a torn one ({error})") from error


def _refuse_long_numbers(value: Any) -> None:
    if isinstance(value, dict):
        for item in value.values():
            _refuse_long_numbers(item)
    elif isinstance(value, list):
        for item in value:
            _refuse_long_numbers(item)
    elif isinstance(value, int) and not isinstance(value, bool):
        _number(value)


def _refuse_constant(name: str) -> float:
    raise InputError(f"{name} is not valid JSON; an absent limit is null")


def _whole_number(text: str) -> int:
    if len(text) > _LONGEST_NUMBER:
        raise InputError(f"a number has {len(text)} digits, must be within double precision")
    _number(int(text))
    return int(text)


def _number(value: str | int) -> float:
    """Return a number in double precision; an infinity spelt as such passes, to be judged where it stands."""
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if math.isinf(number) and "inf" not in str(value)[:5]:
        raise InputError(f"{str(value)[:12]}... is beyond double precision")
    return number
