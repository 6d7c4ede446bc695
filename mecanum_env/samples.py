"""Packaged inputs by name on any command line: ``@examples/logs`` is the folder of the bundled logs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import PurePosixPath
from typing import Final

from mecanum_env.errors import BackendError, InputError, did_you_mean
from mecanum_env.files import asset_path

MARK: Final = "@"
"""What such a name begins with."""
SAMPLES: Final = ("@examples/logs", "@examples/gap_logs", "@models/paper.json")
"""The ones worth naming in a message."""


def with_samples(args: Sequence[str]) -> list[str]:
    """Return arguments with each ``@NAME`` of a packaged file or folder, such as `SAMPLES`, as its path.

    Raises:
        InputError: there is none of that name; the message names some.
    """
    return [_path(word) if word.startswith(MARK) else word for word in args]


def _path(word: str) -> str:
    parts = PurePosixPath(word.removeprefix(MARK)).parts
    try:
        # Only what is packaged: neither the folder above nor all of it.
        if parts and not {"..", "/"} & set(parts):
            return str(asset_path("/".join(parts)))
    except BackendError:
        pass
    raise InputError(
        f"{word}: no packaged file or folder{did_you_mean(word, SAMPLES)}, must be {', '.join(SAMPLES)}; "
        f"a file of yours of that name is ./{word}"
    )
