"""Recordings of real robots, which are not part of the repository: MECANUM_REAL_LOGS names their folder."""

from __future__ import annotations

import datetime
import os
from collections.abc import Iterable
from pathlib import Path

from mecanum_env.checkout import commit
from mecanum_env.files import write_text

FOLDER = Path(os.environ.get("MECANUM_REAL_LOGS", Path(__file__).resolve().parents[2] / "shared" / "data"))
"""The folder that is named, or the one beside the checkout."""


def recordings(*names: str) -> Path | None:
    """Return the folder with recordings of some names; None, and say so, if there are none."""
    if (FOLDER / names[0]).is_dir():
        return FOLDER
    wanted = " and ".join(f"{name}/" for name in names)
    print(f"no recordings here; set MECANUM_REAL_LOGS to the folder that holds {wanted}")
    return None


def written() -> str:
    """Return the sentence with which a page of results begins: when, and with which commit it was made."""
    today = datetime.date.today().isoformat()
    made = (commit() or "unknown")[:12]
    return f"Written by the command itself on {today} with commit `{made}`; do not edit."


def print_page(paragraphs: Iterable[str], markdown: Path | None) -> None:
    """Print the paragraphs of a page as they come, and write them to a Markdown file, if one is given."""
    parts = []
    for part in paragraphs:
        print(part, end="\n\n", flush=True)
        parts.append(part)
    if markdown is not None:
        write_text(markdown, "\n\n".join(parts) + "\n")
