"""Death of a process at a chosen point of what it does to the disk, played inside this process."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

CHANGES = ("replace", "rename", "unlink", "remove", "rmdir", "mkdir", "fsync", "truncate", "link", "symlink")
"""What a crash may come before or after; nothing of it happens once the process is "dead"."""


class Killed(BaseException):
    """Stands for the end of the process."""


class Disk:
    """Counts the changes of the disk and ends the process before or after one of them."""

    def __init__(self, at: int | None) -> None:
        self.at, self.count, self.dead = at, 0, False
        self.trace: list[tuple[str, str, int]] = []

    def _point(self) -> None:
        self.count += 1
        if self.at is not None and self.count > self.at:
            self.dead = True
            raise Killed

    def around(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        """Return a change of the disk with a point before and a point after it."""

        def change(*args: Any, **kwargs: Any) -> Any:
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
def disk_of(at: int | None = None) -> Iterator[Disk]:
    """Count the changes of the disk in the block, before and after each; end it at the count `at`."""
    disk = Disk(at)
    with pytest.MonkeyPatch.context() as patch:
        for name in CHANGES:
            patch.setattr(os, name, disk.around(name, getattr(os, name)))
        yield disk


def crash_everywhere(prepare: Callable[[], Any], work: Callable[[], Any], check: Callable[[int], Any]) -> int:
    """Prepare, work up to a crash, and check, for every point of the work; return their number."""
    prepare()
    with disk_of() as disk:
        work()
    for at in range(disk.count):
        prepare()
        with disk_of(at), suppress(Killed):
            work()
        check(at)
    return disk.count


def contents(folder: Path) -> dict[str, bytes]:
    """Return the visible files of a folder by name, without the manifest."""
    found = (path for path in sorted(folder.rglob("*")) if path.is_file())
    names = {path.relative_to(folder).as_posix(): path.read_bytes() for path in found}
    return {n: data for n, data in names.items() if "mecanum-output" not in n and ".mecanum" not in n}
