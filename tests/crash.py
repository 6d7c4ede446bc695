"""Death of a process at a chosen point of what it does to the disk, played inside this process."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest

CHANGES = ("replace", "rename", "unlink", "remove", "rmdir", "mkdir", "fsync", "truncate", "link", "symlink")
"""What a crash may come before or after; nothing of it happens once the process is "dead"."""


class Killed(BaseException):
    """Stands for the end of the process."""


class Disk:
    """Counts the changes of the disk; may look at it before and after each, and end the process at one."""

    def __init__(self, at: int | None, look: Callable[[], Any] | None) -> None:
        self.at, self.look, self.count, self.dead = at, look, 0, False
        self.looking = False
        self.trace: list[tuple[str, str, int]] = []

    def _point(self) -> None:
        self.count += 1
        if self.look is not None:
            self.looking = True
            self.look()
            self.looking = False
        if self.at is not None and self.count > self.at:
            self.dead = True
            raise Killed

    def around(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        """Return a change of the disk with a point before and a point after it."""

        def change(*args: Any, **kwargs: Any) -> Any:
            if self.looking:
                return real(*args, **kwargs)
            # The dead clean nothing up.
            if self.dead:
                raise Killed
            self._point()
            about = os.readlink(f"/proc/self/fd/{args[0]}") if name == "fsync" else str(args[0])
            result = real(*args, **kwargs)
            self._point()
            self.trace.append((name, about, self.count))
            return result

        return change


@contextmanager
def disk_of(at: int | None = None, look: Callable[[], Any] | None = None) -> Iterator[Disk]:
    """Count the changes of the disk in the block, before and after each; end it at the count `at`.

    `look` is called at each count.
    """
    disk = Disk(at, look)
    with pytest.MonkeyPatch.context() as patch:
        for name in CHANGES:
            patch.setattr(os, name, disk.around(name, getattr(os, name)))
        yield disk


def crash_everywhere(work: Callable[[], Any], check: Callable[[int], Any], folder: Path) -> int:
    """Work once, then check what each crash on the way would have left in a folder; return their number.

    `check` finds the folder as it was before or after a change of the disk, and is told how many there were
    until then. Changes that leave the folder as it was are not checked twice.
    """
    with TemporaryDirectory() as kept:
        states: list[tuple[int, Path]] = []
        seen: list[Any] = []

        def look() -> None:
            now = signature(folder)
            if not seen or now != seen[-1]:
                states.append((disk.count, Path(kept, str(disk.count))))
                if folder.exists():
                    shutil.copytree(folder, states[-1][1], symlinks=True)
            seen.append(now)

        with disk_of(look=look) as disk:
            work()
        for at, state in states:
            shutil.rmtree(folder, ignore_errors=True)
            if state.exists():
                shutil.copytree(state, folder, symlinks=True)
            check(at)
    return disk.count


def signature(folder: Path) -> Any:
    """Return what differs between two states of a folder."""
    about = ((str(path), path.lstat()) for path in sorted(folder.rglob("*")))
    return folder.exists(), [(name, one.st_ino, one.st_size, one.st_mtime_ns) for name, one in about]


def contents(folder: Path) -> dict[str, bytes]:
    """Return the visible files of a folder by name, without the manifest."""
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    names = {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}
    return {n: data for n, data in names.items() if "mecanum-output" not in n and ".mecanum" not in n}
