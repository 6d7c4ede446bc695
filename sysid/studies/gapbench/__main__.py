"""GapBench: `python -m sysid.studies.gapbench make --out DIR`, `... run --cases DIR`, `... leaderboard`."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from mecanum_env.errors import require_at_least
from mecanum_env.programs import Done, run_one_of

_FIRST_SEED: Final = 400


def make(
    out: Path,
    bench: int = 40,
    first_seed: int | None = None,
    sealed: bool = False,
    parquet: bool = False,
    real: tuple[Path, ...] = (),
    jobs: int = 1,
) -> Done:
    """Write a benchmark's folder: cases as plain CSV, their truths apart, a scorer, an example and a page.

    Cases that the folder has already are kept: an interrupted run continues from there.

    Example: python -m sysid.studies.gapbench make --out out/gapbench --bench 40

    Args:
        out: Folder to write.
        bench: Number of cases of simulated drives.
        first_seed: Seed of the first of them; default 400, or the next sealed one with --sealed.
        sealed: Spend sealed seeds of the zoo; the checkout records it.
        parquet: Also write the logs as Parquet tables.
        real: Folders of recordings with a pairs.toml, or known ones such as robotino.
        jobs: Number of worker processes; the result does not depend on it.
    """
    require_at_least(1, jobs=jobs)
    require_at_least(0, bench=bench)
    # Imported here, so that --help does not wait for the library.
    from sysid.studies.gapbench.bench import MANIFEST, make_bench
    from sysid.studies.zoo.seeds import claim_seeds, development_seeds, finish_seeds

    block = claim_seeds({"bench": bench, "robot": 0}, first_seed) if sealed else None
    if block is None:
        seeds = development_seeds(bench, _FIRST_SEED if first_seed is None else first_seed)
    else:
        seeds = block.seeds
    failed = make_bench(out, seeds, real, sealed=sealed, parquet=parquet, jobs=jobs)
    if block is not None:
        finish_seeds(block)
    for error in failed:
        print(f"not made: {error}", file=sys.stderr)
    cases = sorted(path.name for path in (out / "cases").glob("*"))
    print(f"wrote {out}: {len(cases)} cases; its README.md says how to use it")
    return Done(wrote=[out / MANIFEST], found={"cases": cases, "not_made": list(failed)})


def run(cases: Path, out: Path, adapters: tuple[str, ...] = ("all",), jobs: int = 1) -> Done:
    """Let methods answer the cases of a benchmark; print the seconds per case that each takes.

    Answers that a method has given already are kept; remove its folder to have it answer again.

    Example: python -m sysid.studies.gapbench run --cases out/gapbench/cases --out out/gapbench/answers

    Args:
        cases: The folder of cases; the truth lies elsewhere, and no method sees it.
        out: Folder that receives one folder of answers per method.
        adapters: Methods to run, or all.
        jobs: Number of worker processes; the result does not depend on it.
    """
    require_at_least(1, jobs=jobs)
    from sysid.studies.gapbench.run import ANSWERS, run_adapters

    taken = run_adapters(cases, out, adapters, jobs)
    for name, seconds in taken.items():
        print(f"{name}: {seconds:.1f} s per case in the median; {out / name / ANSWERS}")
    return Done(wrote=[out / name / ANSWERS for name in taken], found={"seconds": taken})


def leaderboard(bench: Path, answers: Path, markdown: Path | None = None) -> Done:
    """Score all answers and print the leaderboard.

    Example: python -m sysid.studies.gapbench leaderboard --bench out/gapbench --answers out/gapbench/answers

    Args:
        bench: The benchmark's folder, with its truth.
        answers: Folder with one folder of answers per method.
        markdown: Also write the leaderboard's page to this file.
    """
    from mecanum_env.files import write_text
    from sysid.studies.gapbench.leaderboard import leaderboard_page, leaderboard_table, read_boards

    boards = read_boards(bench, answers)
    print(leaderboard_table(boards))
    if markdown is not None:
        write_text(markdown, leaderboard_page(boards, bench))
        print(f"\nwrote {markdown}")
    found = {one.name: {metric.name: asdict(metric) for metric in one.metrics.values()} for one in boards}
    return Done(wrote=[] if markdown is None else [markdown], found=found)


COMMANDS: Final[Mapping[str, Callable[..., Any]]] = {"make": make, "run": run, "leaderboard": leaderboard}


def main(args: list[str]) -> int:
    """Run the command of `COMMANDS` that `args` names; return the exit code."""
    return run_one_of(COMMANDS, args, "python -m sysid.studies.gapbench")


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
