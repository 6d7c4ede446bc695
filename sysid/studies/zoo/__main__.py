"""The zoo: hidden effects in drives and robots drawn at random: `python -m sysid.studies.zoo`."""

from __future__ import annotations

import datetime
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import tyro

from mecanum_env.cli import run
from mecanum_env.errors import InputError, install_command, require_at_least
from mecanum_env.parallel import Workers

if TYPE_CHECKING:
    from sysid.logs.runs import Level
    from sysid.studies.zoo.seeds import Block

_BENCH, _ROBOT = 600, 60
_QUICK_BENCH, _QUICK_ROBOT = 54, 6


def main(
    quick: bool = False,
    bench: int | None = None,
    robot: int | None = None,
    first_seed: int | None = None,
    sealed: bool = False,
    driven: Literal["other", "same"] = "other",
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
        driven: After a change: other commands than for the fit, or the same ones.
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
    from mecanum_env.files import require_writable
    from mecanum_env.outputs import output_folder
    from sysid.studies.zoo.page import provenance_of, short_text
    from sysid.studies.zoo.run import JSON, TEXT, run_zoo
    from sysid.studies.zoo.seeds import claim_seeds, finish_seeds

    picture = None if markdown is None else markdown.with_name(f"{markdown.stem}_power.png")
    require_writable(out / JSON, out / TEXT, *filter(None, (markdown, picture)))
    counts: dict[Level, int] = {
        "bench": bench if bench is not None else _QUICK_BENCH if quick else _BENCH,
        "robot": robot if robot is not None else _QUICK_ROBOT if quick else _ROBOT,
    }
    if not any(counts.values()):
        raise InputError("bench and robot are both 0: give one of them cases")
    block = claim_seeds(counts, first_seed, driven) if sealed else None
    options: dict[str, int | str | None] = {"driven": None if driven == "other" else driven}
    options |= {"bench": bench, "robot": robot, "first-seed": first_seed if block is None else block.first}
    command = _command({"quick": quick, "sealed": sealed, "settle": settle}, options, only)
    seeds = _seeds(counts, block, quick, first_seed or 0)
    # The folder is locked meanwhile: two runs would draw the same cases twice.
    with output_folder(out, "sysid.studies.zoo", (JSON, TEXT)) as staged:
        found = run_zoo(seeds, out, workers, driven=driven, only=only, settle=settle)
        about = provenance_of(found.outcomes, command, datetime.date.today().isoformat(), block)
        found.write(staged, about)
        if markdown is not None and picture is not None:
            found.write_page(markdown, picture, about)
    if block is not None:
        finish_seeds(block)
    print(short_text(found.outcomes, found.undrawn))
    print(f"\nwrote {out / JSON} and {out / TEXT}{f' and {markdown}' if markdown else ''}")


def _seeds(
    counts: Mapping[Level, int], block: Block | None, quick: bool, first: int
) -> dict[Level, Sequence[int]]:
    """Return the seeds of each level: those of a sealed block, or so many for development."""
    from sysid.studies.zoo.seeds import development_seeds, spread_seeds

    if block is not None:
        return {level: range(block.first, block.first + count) for level, count in counts.items()}
    return {
        level: spread_seeds(count) if quick else development_seeds(count, first)
        for level, count in counts.items()
    }


def _command(flags: Mapping[str, bool], options: Mapping[str, int | str | None], only: str) -> str:
    """Return the command line of a run, for its page."""
    words = [f"--{name}" for name, given in flags.items() if given]
    words += [f"--{name} {value}" for name, value in options.items() if value is not None]
    return " ".join(["python -m sysid.studies.zoo", *words, *([] if only == "*" else [f"--only '{only}'"])])


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.zoo"))
