"""Blind test of the gap workflow on logs of another simulator: `python -m sysid.studies.blind`."""

from __future__ import annotations

import datetime
import fnmatch
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mecanum_env.cli import run
from mecanum_env.errors import InputError, require_at_least

if TYPE_CHECKING:
    from sysid.studies.blind.cases import Case

_QUICK_BENCH, _QUICK_ROBOT = 16, 4


def main(
    quick: bool = False,
    bench: int | None = None,
    robot: int | None = None,
    jobs: int = 2,
    only: str = "*",
    out: Path = Path("out/blind"),
    seed: int = 0,
    markdown: Path | None = None,
    check: bool = False,
) -> None:
    """Run the blind tests of this checkout, print what was found and write blind.json.

    Finished cases are kept in the output folder: an interrupted run continues from there, unless the code has
    changed since.

    Example: python -m sysid.studies.blind --quick

    Args:
        quick: A few cases of every kind.
        bench: Largest number of bench cases, spread evenly over the list.
        robot: Largest number of robot cases, spread evenly over the list.
        jobs: Number of worker processes; the result does not depend on it.
        only: Pattern of the cases' names, such as "bench-pair-*".
        out: Folder to write.
        seed: Seed of sizes, commands and noise.
        markdown: Also write the tables to this file.
        check: Only replay each case with its true effects and print the residual; analyse nothing.
    """
    # Imported here, so that --help does not wait for the library.
    from mecanum_env.files import require_writable, write_json, write_text
    from sysid.studies.blind.cases import HEAD, blind_tests, check_case, fingerprint
    from sysid.studies.blind.outcome import metrics, summary_markdown, summary_text, to_json
    from sysid.studies.blind.work import nominal_model, run_cases

    require_at_least(0, seed=seed)
    require_at_least(1, jobs=jobs)
    most = {
        "bench": bench if bench is not None else _QUICK_BENCH if quick else None,
        "robot": robot if robot is not None else _QUICK_ROBOT if quick else None,
    }
    listed = [case for case in blind_tests().cases(seed) if fnmatch.fnmatch(case.name, only)]
    chosen = [
        case
        for level, count in most.items()
        for case in spread([case for case in listed if case.level == level], count)
    ]
    if not chosen:
        raise InputError(f"only = {only}: no case has such a name; try bench-single-* or robot-*")
    if check:
        print(HEAD)
        for case in chosen:
            model = nominal_model(case.plant, out / fingerprint())
            print(check_case(case, seed, model).row(), flush=True)
        return
    require_writable(out / "blind.json", out / "blind.txt", *([markdown] if markdown else []))
    outcomes = run_cases(chosen, seed, out / fingerprint(), jobs)
    write_json(
        out / "blind.json",
        {
            "format": "mecanum-blind/1",
            "seed": seed,
            "figures": {one.name: None if one.count == 0 else one.value for one in metrics(outcomes)},
            "cases": [to_json(outcome) for outcome in outcomes],
        },
    )
    text = summary_text(outcomes)
    write_text(out / "blind.txt", text + "\n")
    if markdown is not None:
        command = f"python -m sysid.studies.blind --seed {seed}" + (" --quick" if quick else "")
        for name, count in (("bench", bench), ("robot", robot)):
            command += "" if count is None else f" --{name} {count}"
        command += "" if only == "*" else f" --only '{only}'"
        write_text(markdown, summary_markdown(outcomes, command, datetime.date.today().isoformat()))
    print(text)
    print(f"\nwrote {out / 'blind.json'}")


def spread(cases: Sequence[Case], count: int | None) -> list[Case]:
    """Return a `count` of cases, evenly spread over a list; all when None."""
    if count is None or count >= len(cases):
        return list(cases)
    return [cases[i * len(cases) // count] for i in range(count)]


if __name__ == "__main__":
    sys.exit(run(main, prog="python -m sysid.studies.blind"))
