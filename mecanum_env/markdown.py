"""Markdown of the pages that programs write."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_MARKUP: Final = re.compile(r"<(?!br>)(?=[A-Za-z/!?])")
"""What would begin an element; line breaks are this project's own."""


def markdown_table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a Markdown table of a head and rows, without a last newline.

    Bars and HTML in cells, which may hold names from elsewhere, are escaped, and lines joined.
    """
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(map(_cell, line)) + " |" for line in lines)


def _cell(text: str) -> str:
    return _MARKUP.sub("&lt;", " ".join(text.splitlines())).replace("|", "\\|")
