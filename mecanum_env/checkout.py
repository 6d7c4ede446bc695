"""The state of the checkout that a program runs from, for the records that it writes."""

from __future__ import annotations

import subprocess
from pathlib import Path


def checkout() -> Path | None:
    """Return the root folder of the running checkout; None in an installation."""
    root = Path(__file__).parents[1]
    return root if (root / ".git").exists() else None


def commit() -> str | None:
    """Return the commit of the running checkout, with "+" if files differ from it; None outside of one."""
    root = checkout()
    if root is None:
        return None
    try:
        head = _git(root, "rev-parse", "HEAD").strip()
        return head + ("+" if _git(root, "status", "--porcelain", "--untracked-files=no").strip() else "")
    except (OSError, subprocess.CalledProcessError):
        return None


def changed_files(root: Path) -> tuple[str, ...]:
    """Return the files of a checkout at `root` that differ from its commit, new ones included.

    Ignored files are not counted.

    Raises:
        OSError, subprocess.CalledProcessError: git is missing, or `root` is no checkout.
    """
    status = _git(root, "status", "--porcelain", "--untracked-files=all", "--no-renames", "-z")
    return tuple(entry[3:] for entry in status.split("\0") if entry)


def _git(root: Path, *arguments: str) -> str:
    done = subprocess.run(["git", *arguments], cwd=root, capture_output=True, text=True, check=True)
    return done.stdout
