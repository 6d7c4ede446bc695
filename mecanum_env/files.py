"""Writing files whole or not at all, through a temporary file; strict JSON; where packaged files are.

Whole folders of results go through `mecanum_env.outputs`.
"""

from __future__ import annotations

import errno
import json
import math
import os
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, Final

from mecanum_env.errors import BackendError, InputError, MecanumError, is_machine_error, write_error

STAGED: Final = ".mecanum-staged-"
"""Begins the name of a folder whose files are committed together (`mecanum_env.outputs`)."""


@contextmanager
def atomic_path(target: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a temporary path in the target's folder, which is renamed to the target when the block succeeds.

    The temporary name keeps the target's suffix, by which video writers choose the format. If the block
    raises, the target is untouched and the temporary file is removed.

    Raises:
        InputError: the folder cannot be created or written, or the target is a folder.
        MachineError: the disk is full or broken, also if an `OSError` of the block says so.
    """
    target = Path(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(
            dir=target.parent, prefix=f".{target.stem[:60]}-", suffix=target.suffix
        )
        os.close(handle)
    except (OSError, ValueError) as error:
        raise write_error(target, as_os_error(error)) from error
    temporary = Path(name)
    try:
        yield temporary
        umask = os.umask(0)  # there is no way to read it without setting it
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        # What is staged is forced to the disk when it is committed.
        staged = any(part.startswith(STAGED) for part in target.parts)
        if not staged:
            sync(temporary)
        try:
            temporary.replace(target)
        except OSError as error:
            raise write_error(target, error, "choose another name") from error
        if not staged:
            sync(target.parent)
    except OSError as error:
        if is_machine_error(error):
            raise write_error(target, error) from error
        raise
    finally:
        temporary.unlink(missing_ok=True)


@contextmanager
def errors_name(targets: Mapping[Path, Path]) -> Iterator[None]:
    """Let errors on purpose name the targets (values) where they name temporary paths (keys)."""
    try:
        yield
    except MecanumError as error:
        text = str(error)
        for temporary, target in targets.items():
            text = text.replace(str(temporary), str(target))
        error.args = (text, *error.args[1:])
        raise


def as_os_error(error: OSError | ValueError) -> OSError:
    """Return an `error` of a path as the operating system's: a path with a zero byte is a `ValueError`."""
    return error if isinstance(error, OSError) else OSError(errno.EINVAL, "not a path")


def sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, have reached the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        # Some file systems cannot do this for folders, and do not need it.
        with suppress(OSError) if path.is_dir() else nullcontext():
            os.fsync(handle)
    finally:
        os.close(handle)


def require_writable(*targets: str | os.PathLike[str]) -> None:
    """Refuse targets that could not be written, before long work begins; nothing is created.

    Raises:
        InputError: a folder cannot be created or written, or a target is a folder.
        MachineError: the disk is full or broken.
    """
    for target in map(Path, targets):
        if os.path.isdir(target):
            raise InputError(f"{target}: is a folder, must be a file; choose another name")
        try:
            folder = next(one for one in target.absolute().parents if os.path.lexists(one))
            with tempfile.TemporaryFile(dir=folder):
                pass
        except (OSError, ValueError) as error:
            raise begin_error(target, as_os_error(error)) from error


def begin_error(target: str | os.PathLike[str], error: OSError) -> MecanumError:
    """Return what to raise when, before any work, an `error` says that a target is not writable.

    A read-only file system is then the user's choice of a folder, and no failure of the machine.
    """
    if error.errno == errno.EROFS:
        return InputError(f"{target}: cannot be written ({error.strerror}); choose another folder")
    return write_error(target, error)


def write_text(target: str | os.PathLike[str], text: str) -> None:
    """Write text to the target in UTF-8, whole or not at all.

    Bytes of a file name that are no text are written as escapes.
    """
    with atomic_path(target) as path:
        path.write_text(text, encoding="utf-8", errors="backslashreplace")


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
