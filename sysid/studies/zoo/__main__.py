"""The zoo: hidden effects in drives and robots drawn at random: `python -m sysid.studies.zoo`."""

from __future__ import annotations

import datetime
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError, install_command, require_at_least
from mecanum_env.parallel import Workers

if TYPE_CHECKING:
    from sysid.studies.zoo.cases.case import Level

_BENCH, _ROBOT = 600, 60
_QUICK_BENCH, _QUICK_ROBOT = 54, 6
_FILES: Final = ("zoo.json", "zoo.txt")


def main(
    quick: bool = False,
    bench: int | None = None,
    robot: int | None = None,
    first_seed: int | None = None,
    sealed: bool = False,
    workers: tyro.conf.OmitArgPrefixes[Workers] = Workers(),
    only: str = "*",
    settle: bool = False,
    out: Path = Path("out/zoo"),
    markdown: Path | None = None,
) -> None:
    """Draw cases, fit a model to the nominal logs of each, study its logs, and write zoo.json and zoo.txt.

    Finished cases are kept in the output folder: an interrupted run continues from there, unless the code has
    changed since.

    Example: python -m sysid.studies.zoo --quick

    Args:
        quick: A few cases, of seeds evenly spread over those for development.
        bench: Number of bench cases; default 600, or 54 with --quick.
        robot: Number of robot cases; default 60, or 6 with --quick.
        first_seed: Seed of the first case of each level; default 0.
        sealed: Spend sealed seeds, the next ones or from --first-seed on; the checkout records it.
        workers: Where the cases run; the result does not depend on it.
        only: Pattern of the cases' names, such as "bench-*-single-backlash".
        settle: Also drive the next experiments of ambiguous cases, on the same drives and robots.
        out: Folder to write.
        markdown: Also write the tables to this file, and the power curves beside it.
    """
    workers.require_usable()
    for option, value in (("bench", bench), ("robot", robot), ("first-seed", first_seed)):
        require_at_least(0, **{option: value or 0})
    if sealed and (quick or only != "*"):
        raise InputError("sealed: spends seeds on a whole run; leave out --quick and --only")
    if quick and first_seed is not None:
        raise InputError("first-seed: --quick spreads its seeds over all; leave out one of the two")
    if importlib.util.find_spec("numba") is None:
        raise InputError(f"the drives and robots of the zoo need numba: {install_command('zoo')}")
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.files import require_writable, write_json, write_text
    from mecanum_env.outputs import output_folder
    from sysid.studies.zoo.drives.families import FAMILIES
    from sysid.studies.zoo.page import page_markdown, provenance_of, run_json, short_text, summary_text
    from sysid.studies.zoo.power import write_power_plot
    from sysid.studies.zoo.sealed import claim_seeds, finish_seeds
    from sysid.studies.zoo.seeds import development_seeds, spread_seeds
    from sysid.studies.zoo.settle import settle_cases
    from sysid.studies.zoo.settled import settled_json
    from sysid.studies.zoo.settled_table import settle_table
    from sysid.studies.zoo.work import Task, run_tasks

    picture = None if markdown is None else markdown.with_name(f"{markdown.stem}_power.png")
    require_writable(*(out / name for name in _FILES), *filter(None, (markdown, picture)))
    counts: dict[Level, int] = {
        "bench": bench if bench is not None else _QUICK_BENCH if quick else _BENCH,
        "robot": robot if robot is not None else _QUICK_ROBOT if quick else _ROBOT,
    }
    if not any(counts.values()):
        raise InputError("bench and robot are both 0: give one of them cases")
    block = claim_seeds(counts, first_seed) if sealed else None
    seeds: dict[Level, Sequence[int]] = {}
    for level, count in counts.items():
        if block is not None:
            seeds[level] = range(block.first, block.first + count)
        else:
            seeds[level] = spread_seeds(count) if quick else development_seeds(count, first_seed or 0)
    tasks = [Task(level, seed) for level, numbers in seeds.items() for seed in numbers]
    # The folder is locked meanwhile: two runs would draw the same cases twice.
    with output_folder(out, "sysid.studies.zoo", _FILES) as staged:
        results = run_tasks(tasks, out, workers, only)
        outcomes, undrawn = results.outcomes, results.undrawn
        if not outcomes:
            raise InputError(
                f"only = {only}: no case of these seeds has such a name; try bench-*-single-*"
                if not undrawn
                else f"no case could be drawn; the first error: {undrawn[0]}"
            )
        driven = settle_cases(outcomes, out, workers) if settle else ()
        settled = settle_table(driven) if settle else ""
        options = {"bench": bench, "robot": robot, "first-seed": first_seed if block is None else block.first}
        command = _command({"quick": quick, "sealed": sealed, "settle": settle}, options, only)
        about = provenance_of(outcomes, command, datetime.date.today().isoformat(), block)
        record = {**run_json(outcomes, undrawn, about), "settled": [settled_json(one) for one in driven]}
        write_json(staged / _FILES[0], record)
        summary = "\n\n".join(filter(None, (summary_text(outcomes, undrawn), settled)))
        write_text(staged / _FILES[1], summary + "\n")
        if markdown is not None and picture is not None:
            write_power_plot(outcomes, picture)
            write_text(markdown, page_markdown(outcomes, undrawn, about, FAMILIES, picture.name, settled))
    if block is not None:
        finish_seeds(block)
    print(short_text(outcomes, undrawn))
    print(f"\nwrote {out / 'zoo.json'} and {out / 'zoo.txt'}{f' and {markdown}' if markdown else ''}")


def _command(flags: Mapping[str, bool], options: Mapping[str, int | None], only: str) -> str:
    """Return the command line of a run, for its page."""
    words = [f"--{name}" for name, given in flags.items() if given]
    words += [f"--{name} {value}" for name, value in options.items() if value is not None]
    return " ".join(["python -m sysid.studies.zoo", *words, *([] if only == "*" else [f"--only '{only}'"])])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.zoo"))
