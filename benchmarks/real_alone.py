"""What the gap workflow says of single recordings without a model, as a Markdown page.

A law and effects are fitted to each recording at once; what is beyond the law is compared with what is known
of the recording from its source.

Example: python benchmarks/real_alone.py --markdown docs/results/real_alone.md

The recordings are not part of the repository: MECANUM_REAL_LOGS names their folder.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from time import process_time

from recordings import print_page, recordings, written

from mecanum_env.cli import run
from mecanum_env.markdown import markdown_table
from sysid.gap.alone import law_of
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.wording import set_name, sizes_in
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset

KNOWN = {
    "robotino/bench_with_integral": "loses 2.5 rpm at 15 rpm and 1.3 to 1.8 at 60 to 90; a ceiling at 104",
    "robotino/bench_without_integral": "loses 3.2 rpm at every speed up to 90 rpm; a ceiling at 104",
    "robotino/floor_table": "loses 0.7 rpm and 4 % of the command",
    "robotino/floor_gray": "loses 3.2 rpm and 5 % of the command",
    "husky": "limits on the speed and acceleration of the body, so that no effect of a wheel is right",
    "micromouse/duty": "a dead zone, and a ceiling that is reached gradually",
    "micromouse/closed_loop": "every file with other settings of the controller: no single law is right",
}
"""Folder of recordings, or the beginning of their names -> what their source tells."""
_MOST_SETS = 3


def main(only: str = "", jobs: int = 1, markdown: Path | None = None) -> None:
    """Study the recordings one by one and print the page; without recordings, say so and stop.

    Example: python benchmarks/real_alone.py --only robotino/floor_gray

    Args:
        only: Beginning of the names of the recordings to study; default: all of a wheel on the bench.
        jobs: Simulations at a time.
        markdown: Markdown file to write the page to.
    """
    folder = recordings("robotino", "husky", "micromouse")
    if folder is not None:
        print_page(page(folder, only, jobs), markdown)


def page(folder: Path, only: str, jobs: int) -> Iterator[str]:
    """Yield the paragraphs of the page."""
    yield "# Results of `python benchmarks/real_alone.py`"
    yield (
        f"{written()} Recordings of real drives, each studied alone and "
        "without a model (`python -m sysid.gap LOGS`): a law and effects are fitted to it at once, and what "
        "is beyond the law is told. Frictions are in rpm of droop. Test runs take part in neither. Times are "
        "of one processor."
    )
    rows = []
    for name in _names(folder, only):
        dataset, began = read_dataset(folder / name), process_time()
        law, options = law_of(dataset, GapOptions(jobs=jobs, next_experiment=False))
        report = analyse(dataset, law, options)
        known = next(told for start, told in KNOWN.items() if name.startswith(start))
        rows.append((name, known, *_found(report), f"{process_time() - began:.0f} s"))
        print(*rows[-1], sep=" | ", file=sys.stderr, flush=True)
    yield markdown_table(
        ("recording", "known of it", "verdict", "found beyond the law", "sizes", "test rms", "fit and study"),
        rows,
    )
    spoke = sum(row[2] in ("named", "ambiguous") for row in rows)
    yield f"Named or ambiguous: {spoke} of {len(rows)}."


def _names(folder: Path, only: str) -> list[str]:
    """Return the names of the recordings of a wheel on the bench, each a folder with a dataset.toml."""
    found = sorted(path.parent.relative_to(folder).as_posix() for path in folder.rglob("dataset.toml"))
    known = [name for name in found if any(name.startswith(start) for start in KNOWN)]
    return [name for name in known if name.startswith(only) and read_dataset(folder / name).level == "bench"]


def _found(report: GapReport) -> tuple[str, str, str, str]:
    """Return the verdict, the sets of effects, the sizes of the first, and the error before and after."""
    sets = [set_name(names) for names in report.candidates]
    more = [f"{len(sets) - _MOST_SETS} more"] if len(sets) > _MOST_SETS else []
    sizes = "; ".join(f"{set_name([e.name])} {sizes_in(report.model, e.name)}" for e in report.effects)
    change = f"{report.gap.before:.3g} -> {report.gap.after:.3g} rpm"
    return report.verdict, " or ".join([*sets[:_MOST_SETS], *more]) or "-", sizes or "-", change


if __name__ == "__main__":
    sys.exit(run(main, prog="python benchmarks/real_alone.py"))
