"""The experiment's tables as Markdown, to be included in the documentation as they are."""

from __future__ import annotations

from sysid.reproduce.chapters import chapters
from sysid.reproduce.experiment import Reproduction
from sysid.reproduce.tables import Table, verdict


def reproduction_markdown(found: Reproduction, pictures: str) -> str:
    """Return the whole of the results as Markdown.

    Args:
        found: the experiment.
        pictures: folder of the PNG files, relative to the Markdown file.
    """
    parts = [
        "# Results of `python -m sysid.reproduce`",
        f"Written by the command itself (seed {found.seed}, {found.effort.starts} starts); do not edit. "
        "What it does: [Reproducing the paper](../reproduce.md).",
        verdict(found),
    ]
    for chapter in chapters(found):
        parts += [f"## {chapter.title}", chapter.text]
        parts += [f"![{name}]({pictures}/{name}.png)" for name in chapter.charts]
        for table in chapter.tables:
            parts += [f"### {table.title}", markdown_table(table), table.note]
    return "\n\n".join(part for part in parts if part) + "\n"


def markdown_table(table: Table) -> str:
    """Return one table; bars in cells are escaped."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in table.rows]
    return "\n".join([lines[0], "|" + "---|" * len(table.rows[0]), *lines[1:]])
