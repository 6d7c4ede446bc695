"""A fingerprint of the code that an outcome depends on, so that outcomes of two versions are never mixed."""

from __future__ import annotations

import hashlib
from importlib.metadata import version
from pathlib import Path
from typing import Final

import mecanum_env
import sysid
from mecanum_env.files import asset_path

_SUFFIXES: Final = (".py", ".c", ".h", ".json")
_LIBRARIES: Final = ("numpy", "scipy", "mujoco")
_WITHOUT_EFFECT: Final = (
    # In an installed package the assets are here, and the models among them are looked for by themselves.
    "mecanum_env/assets",
    "mecanum_env/rendering",
    "mecanum_env/tankendo",
    "sysid/online",
    *(f"sysid/studies/{name}" for name in ("gapbench", "paper_gap", "reproduce")),
    # What reads outcomes, and cannot change them.
    *(
        f"sysid/studies/zoo/{name}.py"
        for name in (
            *("__main__", "calibrate", "calibration", "page", "power", "seeds", "settled_table", "tables"),
        )
    ),
)
"""Folders and files that no outcome depends on."""


def sources() -> tuple[tuple[str, Path], ...]:
    """Return every source file that an outcome can depend on, with its name, in the order of the names."""
    found = []
    for folder in (Path(mecanum_env.__file__).parent, Path(sysid.__file__).parent, asset_path("models")):
        for path in folder.rglob("*"):
            name = f"{folder.name}/{path.relative_to(folder).as_posix()}"
            ignored = any(name == other or name.startswith(f"{other}/") for other in _WITHOUT_EFFECT)
            if path.suffix in _SUFFIXES and not ignored:
                found.append((name, path))
    return tuple(sorted(found))


def fingerprint() -> str:
    """Return a hash of twelve characters of the sources and of the versions of the numerical libraries."""
    digest = hashlib.sha256()
    for library in _LIBRARIES:
        digest.update(f"{library} {version(library)}\n".encode())
    for name, path in sources():
        digest.update(name.encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]
