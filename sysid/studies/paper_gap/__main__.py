"""Which effects reproduce the paper's robot-level gap: `python -m sysid.studies.paper_gap`."""

from __future__ import annotations

import sys
from pathlib import Path

import tyro

from mecanum_env.cli import run
from mecanum_env.parallel import Workers


def main(
    out: Path = Path("paper_gap"),
    workers: tyro.conf.OmitArgPrefixes[Workers] = Workers(),
    markdown: Path | None = None,
) -> None:
    """Search for the effects that reproduce the six numbers of the paper's robot; write tables.

    Writes paper_gap.json and paper_gap.md.

    Example: python -m sysid.studies.paper_gap --out out/paper_gap

    Args:
        out: Folder to write.
        workers: Where the fits run.
        markdown: Also write the tables to this file.
    """
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.files import require_writable, write_json, write_text
    from mecanum_env.outputs import output_folder
    from sysid.progress import stage_bar
    from sysid.studies.paper_gap.study import STAGES, paper_gap
    from sysid.studies.paper_gap.tables import conclusion, paper_gap_json, paper_gap_markdown

    names = ("paper_gap.json", "paper_gap.md")
    written = [*(out / name for name in names), *([markdown] if markdown else [])]
    workers.require_usable()
    require_writable(*written)
    with output_folder(out, "sysid.studies.paper_gap", names) as staged, stage_bar(STAGES) as progress:
        found = paper_gap(progress, workers)
        write_json(staged / names[0], paper_gap_json(found))
        write_text(staged / names[1], paper_gap_markdown(found))
        if markdown:
            write_text(markdown, paper_gap_markdown(found))
    print(conclusion(found))
    print(f"\nwrote {', '.join(map(str, written))}")


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.paper_gap"))
