"""Reproduce the paper's experiments: `python -m sysid.studies.reproduce`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Final

import tyro

from mecanum_env.cli import run
from mecanum_env.parallel import Workers
from mecanum_env.programs import Done

_RESULT: Final = "reproduce.json"
_PAGE: Final = "report.html"


def main(
    out: Path = Path("reproduce"),
    quick: bool = False,
    seed: int = 0,
    workers: tyro.conf.OmitArgPrefixes[Workers] = Workers(),
    markdown: Path | None = None,
) -> Done:
    """Run every method of the paper on a target system and write reproduce.json, report.html and pictures.

    Example: python -m sysid.studies.reproduce --out out/reproduce

    Args:
        out: Folder to write.
        quick: 20 starts, few iterations, a coarse search: to see that it runs, not for its results.
        seed: Seed of the recordings and of the random starts.
        workers: Where the fits run; times and memory are measured in this process, alone.
        markdown: Also write all tables to this file, with the pictures in a folder beside it.
    """
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.errors import require_at_least
    from mecanum_env.files import require_writable, write_json, write_text
    from mecanum_env.outputs import output_folder
    from sysid.progress import stage_bar
    from sysid.studies.reproduce.charts import write_reproduction_plots
    from sysid.studies.reproduce.contenders import QUICK, ExperimentEffort
    from sysid.studies.reproduce.experiment import STAGES, reproduce
    from sysid.studies.reproduce.pages import (
        reproduction_json,
        reproduction_markdown,
        write_reproduction_page,
    )
    from sysid.studies.reproduce.tables import verdict

    pages = [] if markdown is None else [markdown, markdown.parent / markdown.stem / _RESULT]
    require_at_least(0, seed=seed)
    workers.require_usable()
    require_writable(out / _RESULT, out / _PAGE, *pages)
    files = output_folder(out, "sysid.studies.reproduce", (_RESULT, _PAGE, "*.png"), seed=seed)
    with files as staged, stage_bar(len(STAGES) + 1) as progress:
        found = reproduce(seed, QUICK if quick else ExperimentEffort(), progress, workers)
        progress("page and pictures")
        write_json(staged / _RESULT, reproduction_json(found))
        write_reproduction_plots(found, staged)
        write_reproduction_page(found, staged / _PAGE)
        if markdown is not None:
            write_reproduction_plots(found, markdown.parent / markdown.stem)
            write_text(markdown, reproduction_markdown(found, markdown.stem))
    print(verdict(found))
    print(f"\nwrote {out / _RESULT}, pictures", end="")
    print(f" and {out / _PAGE}")
    return Done(wrote=[out / _RESULT, out / _PAGE])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.reproduce"))
