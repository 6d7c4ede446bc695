"""Writing files whole or not at all, through a temporary file; strict JSON; where packaged files are."""

from __future__ import annotations

import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

from mecanum_env.errors import BackendError, InputError


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the target's folder, which is renamed to the target when the block succeeds.

    The temporary name keeps the target's suffix, by which video writers choose the format. If the block
    raises, the target is untouched and the temporary file is removed.

    Raises:
        InputError: the folder cannot be created or written, or the target is a folder.
    """
    target = Path(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
        os.close(handle)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror}); choose another folder") from error
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)  # there is no way to read it without setting it
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        try:
            temporary.replace(target)
        except OSError as error:
            raise InputError(
                f"{target}: cannot be written ({error.strerror}); choose another name"
            ) from error
    finally:
        temporary.unlink(missing_ok=True)


def require_writable(*targets: str | os.PathLike[str]) -> None:
    """Refuse targets that could not be written, before long work begins; nothing is created.

    Raises:
        InputError: a folder cannot be created or written, or a target is a folder.
    """
    for target in map(Path, targets):
        if target.is_dir():
            raise InputError(f"{target}: is a folder, must be a file; choose another name")
        folder = next(one for one in target.absolute().parents if os.path.lexists(one))
        try:
            with tempfile.TemporaryFile(dir=folder):
                pass
        except OSError as error:
            raise InputError(
                f"{target}: cannot be written ({error.strerror}); choose another folder"
            ) from error


def write_text(target: str | os.PathLike[str], text: str) -> None:
    """Write text to the target in UTF-8, whole or not at all."""
    with atomic_path(target) as path:
        path.write_text(text, encoding="utf-8")


def write_json(target: str | os.PathLike[str], value: Any) -> None:
    """Write a value to the target as strict JSON in full double precision, whole or not at all.

    Raises:
        InputError: the value holds NaN or an infinity, which JSON does not know, or as for `atomic_path`.
    """
    try:
        text = json.dumps(value, indent=1, allow_nan=False)
    except ValueError as error:
        raise InputError(
            f"{target}: not written, JSON knows no NaN or infinity; use null ({error})"
        ) from error
    write_text(target, text + "\n")


def plain_json(value: Any) -> Any:
    """Return a value in JSON's types: objects, lists, plain numbers, and null for NaN and infinity.

    Args:
        value: dataclasses, mappings, sequences and NumPy values, nested in any way.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain_json(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain_json(entry) for key, entry in value.items()}
    # NumPy's arrays and scalars, told without importing NumPy, which would make this module slow to import.
    if hasattr(value, "tolist"):
        return plain_json(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_json(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def asset_path(name: str = "") -> Path:
    """Return the path of a packaged file or folder by its name, such as ``"models/paper.json"``.

    Raises:
        BackendError: this installation has no such file.
    """
    package = Path(__file__).parent
    # An installed wheel has the assets inside the package, a checkout beside it (`examples` beside those).
    for root in (package / "assets", package.parent / "assets", package.parent):
        if (root / name).exists():
            return root / name
    raise BackendError(f"packaged file {name!r} not found; install the package again")
