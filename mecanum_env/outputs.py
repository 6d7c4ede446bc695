"""The folder of a command's results: all of its files at once, or those that were there before.

    with output_folder("fit", "sysid.fit", ("model.json", "report.html"), seed=0) as staged:
        write_model(model, staged / "model.json")

The block writes into an empty folder inside the target. When it ends, everything in it is forced to the disk
with a manifest (`mecanum-output.json`), and one rename of that folder, to `.mecanum-commit`, decides: before
it the old results count, after it the new ones. The files then move to their places. Whoever opens the target
next, to read or to write, finishes a move that was cut off. Files of the user stay where they are.

The manifest names each file with its SHA-256 and the run that wrote it; `require_whole` refuses a file that
is not the one named. A lock on the folder keeps a second writer out; it ends with its process.
"""

from __future__ import annotations

import fcntl
import fnmatch
import functools
import hashlib
import json
import os
import platform
import shutil
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from mecanum_env.checkout import commit
from mecanum_env.errors import InputError, write_error
from mecanum_env.files import STAGED, as_os_error, atomic_path, begin_error, errors_name, sync, write_json
from mecanum_env.version import __version__

MANIFEST: Final = "mecanum-output.json"
"""What describes the files of a folder of results."""
FORMAT: Final = "mecanum-output/1"
_COMMIT: Final = ".mecanum-commit"
_PACKAGES: Final = ("mujoco", "numpy", "scipy", "gymnasium")


@contextmanager
def output_folder(
    target: str | os.PathLike[str],
    command: str,
    files: Sequence[str] = (),
    *,
    seed: int | None = None,
    locked: bool = False,
    shared: bool = False,
) -> Iterator[Path]:
    """Yield an empty folder; what the block writes there becomes the target's at its end, in one step.

    If the block raises, or the process dies, the target holds what it held before.

    Args:
        target: folder of the results, made if it does not exist; files that are not the command's stay.
        command: name of the program, for the manifest.
        files: names of all files that the command may write; those that it does not write this time are
            removed. A pattern such as "online_*.png" covers only files of an earlier run of the command.
        seed: of the run, for the manifest.
        locked: whether the caller holds the folder's lock already.
        shared: whether others may write other files there while the block works; the lock is then held only
            at its beginning and its end, and waited for.

    Raises:
        InputError: the target cannot be written, another program writes there, or a folder of the user has
            the name of a file.
        MachineError: the disk is full or broken.
    """
    folder = Path(target)
    made = _make(folder)
    try:
        with ExitStack() as stack:
            if not locked and not shared:
                stack.enter_context(lock_folder(folder))
            with _alone(folder) if shared else nullcontext():
                finish_interrupted(folder, locked=True)
                _refuse_obstacles(folder, files)
                _remove_left_behind(folder)
                try:
                    staged = Path(tempfile.mkdtemp(dir=folder, prefix=STAGED))
                except OSError as error:
                    raise begin_error(folder, error) from error
                stack.callback(shutil.rmtree, staged, ignore_errors=True)
                # Held as long as somebody works in it.
                stack.enter_context(lock_folder(staged))
            with errors_name({staged: folder}):
                yield staged
            with _alone(folder) if shared else nullcontext():
                finish_interrupted(folder, locked=True)
                try:
                    _commit(staged, folder, command, files, seed)
                except OSError as error:
                    raise write_error(folder, error) from error
    finally:
        for one in made:
            # Those that hold results stay.
            with suppress(OSError):
                one.rmdir()


@contextmanager
def output_files(
    command: str, *targets: str | os.PathLike[str], seed: int | None = None
) -> Iterator[list[Path]]:
    """Yield a temporary path for each of several files, which all appear at the end, or none.

    Those in the folder of the first target appear in one step, and a manifest there names them. Each in
    another folder, such as a page among documents, is renamed whole right after. Meanwhile other programs may
    write other files there.

    Args:
        command: name of the program, for the manifest.
        targets: the files, the most important one first.
        seed: of the run, for the manifest.

    Raises:
        InputError: a target cannot be written, or is a folder.
        MachineError: the disk is full or broken.
    """
    paths = [Path(target) for target in targets]
    folder = paths[0].parent
    here = [path for path in paths if path.parent.resolve() == folder.resolve()]
    with ExitStack() as stack:
        # What is entered first ends last.
        found = {path: stack.enter_context(atomic_path(path)) for path in paths if path not in here}
        stack.enter_context(errors_name({temporary: path for path, temporary in found.items()}))
        names = [path.name for path in here]
        staged = stack.enter_context(output_folder(folder, command, names, seed=seed, shared=True))
        yield [found.get(path, staged / path.name) for path in paths]


def _alone(folder: Path) -> AbstractContextManager[None]:
    """Return the lock of a folder that others use, too, but never for long."""
    return lock_folder(folder, wait=True)


def _remove_left_behind(folder: Path) -> None:
    """Remove what processes staged in a folder that ended since."""
    for stale in folder.glob(f"{STAGED}*"):
        with suppress(InputError, OSError), lock_folder(stale):
            shutil.rmtree(stale, ignore_errors=True)


@contextmanager
def lock_folder(folder: Path, *, wait: bool = False) -> Iterator[None]:
    """Hold the lock of a folder that exists; the system releases it when the process ends, however it ends.

    Raises:
        InputError: somebody else holds it, and this is not to `wait` for them.
    """
    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError as error:
            raise InputError(
                f"{folder}: another command is writing there; wait until it is done, or choose another folder"
            ) from error
        except OSError:
            pass  # a file system without locks
        yield
    finally:
        os.close(handle)


def require_whole(path: str | os.PathLike[str]) -> None:
    """Refuse a file that a manifest beside it names with another content; finish an interrupted write first.

    Raises:
        InputError: the file was changed, or belongs to another run than the manifest says.
    """
    path = Path(path)
    for last in (False, True):
        finish_interrupted(path.parent)
        entry = read_manifest(path.parent).get("files", {}).get(path.name)
        if entry is None or not os.path.isfile(path) or entry["sha256"] == _hash(path):
            return
        if last:  # once more, in case a writer has just replaced manifest and file
            raise InputError(
                f"{path}: is not the file that {MANIFEST} beside it names (changed by hand, or by another "
                "program); copy it to another name to use it as it is, or write the folder again"
            )


def finish_interrupted(folder: Path, *, locked: bool = False) -> None:
    """Finish the move of results into their places that an earlier command could not finish.

    Args:
        folder: folder of results; nothing happens if it has no interrupted move.
        locked: whether the caller holds the folder's lock.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        if not (folder / _COMMIT).is_dir() or (folder / _COMMIT).is_symlink():
            return
        if locked:
            _move_in(folder)
        else:
            with lock_folder(folder, wait=True):
                _move_in(folder)
    except InputError:
        raise
    except ValueError:  # a zero byte in the path: whoever opens it will say so
        return
    except OSError as error:
        raise InputError(
            f"{folder}: a command was interrupted when it wrote its results, and they cannot be finished "
            f"({error.strerror}); make the folder writable and try again"
        ) from error


def require_empty(folder: Path) -> None:
    """Refuse a folder of results that has something in it already; finish an interrupted write first.

    Raises:
        InputError: it is not empty, or no folder.
    """
    finish_interrupted(folder)
    if os.path.lexists(folder) and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(f"{folder}: is not an empty folder; choose another --out")


def read_manifest(folder: Path) -> Mapping[str, Any]:
    """Return the manifest in a folder; empty if it has none, or none of this project's."""
    try:
        value = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
        if value["format"] == FORMAT and all(isinstance(e["sha256"], str) for e in value["files"].values()):
            found: dict[str, Any] = value
            return found
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        pass
    return {}


def _make(folder: Path) -> list[Path]:
    """Make a folder; return the folders that did not exist, the innermost first."""
    try:
        above = (folder, *folder.parents)
        made = [one for one in above if not os.path.lexists(one)]
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        raise begin_error(folder, as_os_error(error)) from error
    return made


def _refuse_obstacles(folder: Path, names: Sequence[str]) -> None:
    """Refuse folders and files of the user that are where results are to be."""
    for name in (*names, MANIFEST):
        if (folder / name).is_dir():
            raise InputError(f"{folder / name}: is a folder, must be a file; choose another folder")
        for above in (folder / name).relative_to(folder).parents[:-1]:
            if os.path.lexists(folder / above) and not (folder / above).is_dir():
                raise InputError(f"{folder / above}: is a file, must be a folder; choose another folder")
    if os.path.lexists(folder / MANIFEST) and not read_manifest(folder):
        raise InputError(f"{folder / MANIFEST}: not written by this project; choose another folder")


def _commit(staged: Path, folder: Path, command: str, known: Sequence[str], seed: int | None) -> None:
    """Make what is staged the results of a folder."""
    inside = sorted(staged.rglob("*"))
    names = [path.relative_to(staged).as_posix() for path in inside if path.is_file()]
    _refuse_obstacles(folder, names)
    write_json(staged / MANIFEST, _manifest(staged, folder, names, command, known, seed))
    for path in (*inside, staged / MANIFEST, staged):
        sync(path)
    umask = os.umask(0)
    os.umask(umask)
    os.chmod(staged, 0o777 & ~umask)
    # The one step that decides.
    os.replace(staged, folder / _COMMIT)
    sync(folder)
    _move_in(folder)


def _manifest(
    staged: Path, folder: Path, names: Sequence[str], command: str, known: Sequence[str], seed: int | None
) -> dict[str, Any]:
    """Return the manifest after a run: its files, those of other runs that stay, and what is to go."""
    old = read_manifest(folder)
    run: dict[str, Any] = {"command": command, "seed": seed, **_code()}
    hashes = {name: _hash(staged / name) for name in names}
    # Of the content, so that equal runs have equal names.
    identity = hashlib.sha256(json.dumps([run, hashes], sort_keys=True).encode()).hexdigest()[:16]
    earlier = {name: entry for name, entry in old.get("files", {}).items() if name not in hashes}
    absent = [name for name in known if "*" not in name and name not in hashes]
    absent += [one for one in earlier if one not in absent and any(fnmatch.fnmatch(one, p) for p in known)]
    files = {name: entry for name, entry in earlier.items() if name not in absent}
    files |= {name: {"sha256": value, "run": identity} for name, value in hashes.items()}
    used = {entry.get("run") for entry in files.values()}
    runs = {name: about for name, about in old.get("runs", {}).items() if name in used} | {identity: run}
    return {"format": FORMAT, "files": files, "runs": runs, "absent": absent}


def _move_in(folder: Path) -> None:
    """Move committed files to their places; harmless if some, or all, have been moved before."""
    source = folder / _COMMIT
    manifest = read_manifest(source)
    if manifest:
        touched = {folder}
        for name in manifest["files"]:
            target = _inside(folder, name)
            if (source / name).exists():
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(source / name, target)
                touched.add(target.parent)
        for name in manifest.get("absent", ()):
            _inside(folder, name).unlink(missing_ok=True)
        for one in touched:
            sync(one)
        os.replace(source / MANIFEST, folder / MANIFEST)
        sync(folder)
    shutil.rmtree(source, ignore_errors=True)


def _inside(folder: Path, name: str) -> Path:
    """Return the path of a file of a folder; refuse a name, or a link, that leads out of it.

    A folder from elsewhere may hold an interrupted write that was made up.
    """
    path = folder / name
    if not path.parent.resolve().is_relative_to(folder.resolve()) or path.name in ("", ".", ".."):
        raise InputError(f"{folder / _COMMIT}: names {name!r}, which is outside of {folder}; remove it")
    return path


def _hash(path: Path) -> str | None:
    """Return the SHA-256 of a file in hexadecimal digits; None if it cannot be read."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except (OSError, ValueError):
        return None


@functools.cache
def _code() -> Mapping[str, Any]:
    """Return the versions of the packages and the commit of the checkout that this process runs."""
    found = {"mecanum-tankendo": __version__, "python": platform.python_version()}
    for package in _PACKAGES:
        with suppress(PackageNotFoundError):
            found[package] = version(package)
    return {"versions": found, "commit": commit()}
