"""Fights as logs of our own format, a CSV file each, which `sysid.gap` reads.

Rows are written as they come: a log that ends with the process that wrote it is worth the most.
"""

from __future__ import annotations

from pathlib import Path
from types import TracebackType
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.kinematics import BODY_COMMAND
from training.drivers.interface import CHANNELS, Sample

COLUMNS: Final = ("time_s", *BODY_COMMAND, *CHANNELS)
_FEWEST: Final = 2
"""Rows of the shortest log that can be read."""


class FightLog:
    """The log of one fight.

    A row is a sample of the robot, with the command that it held from then on. Use it in a `with` statement;
    a file of fewer than two rows, which nobody could read, is removed at its end.

    Raises:
        InputError: the file cannot be written.
    """

    def __init__(self, path: Path) -> None:
        self._path, self._rows = path, 0
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            # Unbuffered: each row is one write, so that none is torn if this process is killed.
            self._file = path.open("wb", buffering=0)
        except OSError as error:
            raise InputError(
                f"{path}: cannot be written ({error.strerror}); choose another folder"
            ) from error
        self._file.write((",".join(COLUMNS) + "\n").encode())
        self._last_s = -1e-9

    def __enter__(self) -> FightLog:
        """Return the log."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the file."""
        self._file.close()
        if self._rows < _FEWEST:
            self._path.unlink()

    def add(self, samples: tuple[Sample, ...]) -> None:
        """Write those samples that are newer than the last row, each with the command held then."""
        for sample in samples:
            if sample.time_s <= self._last_s:
                continue
            cells = [f"{sample.time_s:.6f}", *map(str, sample.command)]
            cells += ["" if value != value else f"{value:.6g}" for value in sample.values]
            self._file.write((",".join(cells) + "\n").encode())
            self._last_s, self._rows = sample.time_s, self._rows + 1
