"""Whether a worker has the same package, plugin and libraries as the program that asks it."""

from __future__ import annotations

import functools
import hashlib
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Final

from mecanum_env.errors import InputError

_PACKAGES: Final = ("mecanum_env", "sysid", "training")
"""The packages of this project, which are installed beside each other."""
_SUFFIXES: Final = (".py", ".so", ".dylib", ".json", ".npz")
_LIBRARIES: Final = ("numpy", "scipy", "mujoco")


@functools.cache
def code_fingerprint() -> str:
    """Return a hash of twelve characters of everything in an installation that may change a result."""
    parts = [f"python {platform.python_version()}", *(f"{name} {version(name)}" for name in _LIBRARIES)]
    digest = hashlib.sha256("\n".join(parts).encode())
    root = Path(__file__).parents[2]
    for package in _PACKAGES:
        for path in sorted((root / package).rglob("*")):
            if path.suffix in _SUFFIXES:
                digest.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def require_same_code(asked: str) -> None:
    """Refuse to work for a program whose `code_fingerprint` differs from the one of this process.

    Args:
        asked: the fingerprint of the program.

    Raises:
        InputError: they differ.
    """
    if (here := code_fingerprint()) != asked:
        raise InputError(
            f"the worker on {platform.node()} has other code or libraries ({here}) than the program that "
            f"asks it ({asked}); install the same wheel and constraints on every node, and edit no code "
            "during a run"
        )
