"""Which seeds a run may use: those of development at will, sealed ones once, written down before the run."""

from __future__ import annotations

import datetime
import json
import subprocess
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Final

from mecanum_env import checkout
from mecanum_env.checkout import changed_files
from mecanum_env.errors import InputError
from mecanum_env.files import write_json
from sysid.logs.runs import Level
from sysid.studies.zoo.cases.case import Driven
from sysid.studies.zoo.sources import fingerprint

DEVELOPMENT: Final = range(1000)
"""Seeds on which anybody may look at causes and calibrate thresholds. All above are sealed."""
LEDGER: Final = Path("docs/results/zoo_sealed.json")
"""Where a checkout keeps the record of sealed runs."""
_FORMAT: Final = "mecanum-zoo-sealed/1"


@dataclass(frozen=True)
class Block:
    """Sealed seeds that one run has spent: `first` and those after it, for each level."""

    first: int
    bench: int
    """Number of bench cases, of seeds first, first + 1, ..."""
    robot: int
    """Number of robot cases, of seeds first, first + 1, ..."""
    commit: str
    """Commit of the code that ran."""
    fingerprint: str
    """Of the source files that ran (`sysid.studies.zoo.sources`)."""
    date: str
    """Day of the run, as 2027-01-31."""
    driven: Driven = "other"
    finished: bool = False

    @property
    def seeds(self) -> range:
        """All seeds that are spent."""
        return range(self.first, self.first + max(self.bench, self.robot))


def development_seeds(count: int, first: int) -> range:
    """Return a `count` of development seeds in a row from the `first`.

    Raises:
        InputError: some of them are sealed.
    """
    seeds = range(first, first + count)
    if count and seeds[-1] not in DEVELOPMENT:
        raise InputError(
            f"seeds {first} to {seeds[-1]} reach beyond {DEVELOPMENT[-1]}, the last one for development; ask "
            "for fewer cases, give a smaller --first-seed, or spend sealed seeds with --sealed"
        )
    return seeds


def spread_seeds(count: int) -> tuple[int, ...]:
    """Return a `count` of development seeds, evenly spread over all of them.

    Raises:
        InputError: there are not so many.
    """
    if count > len(DEVELOPMENT):
        raise InputError(f"{count} cases of a level, must be at most {len(DEVELOPMENT)} development seeds")
    return tuple(DEVELOPMENT[i * len(DEVELOPMENT) // count] for i in range(count))


def claim_seeds(counts: Mapping[Level, int], first_seed: int | None, driven: Driven = "other") -> Block:
    """Spend sealed seeds, and write that down before anything runs.

    Args:
        counts: number of cases of the levels bench and robot.
        first_seed: the first of them; None: the next unspent one.
        driven: what the logs of the run drive.

    Raises:
        InputError: an installation, files that differ from the commit, or seeds that are not sealed or spent.
    """
    wanted = Block(
        first=first_seed or 0,
        bench=counts["bench"],
        robot=counts["robot"],
        commit=checkout.commit() or "unknown",
        fingerprint=fingerprint(),
        date=datetime.date.today().isoformat(),
        driven=driven,
    )
    block = claim(_checkout(), wanted, first_seed)
    print(f"sealed seeds {block.seeds[0]} to {block.seeds[-1]} are spent on commit {block.commit[:12]}")
    return block


def finish_seeds(block: Block) -> None:
    """Write down that the run of a block is over."""
    finish(_checkout(), block)


def read_ledger(path: Path) -> tuple[Block, ...]:
    """Return the blocks of a ledger in the order of their runs; none where the file does not exist.

    Raises:
        InputError: the file is no ledger.
    """
    if not path.is_file():
        return ()
    try:
        return tuple(Block(**entry) for entry in json.loads(path.read_text(encoding="utf-8"))["blocks"])
    except (TypeError, KeyError, json.JSONDecodeError) as error:
        raise InputError(f"{path}: not a record of sealed runs ({error}); restore it from git") from error


def claim(root: Path, wanted: Block, first: int | None = None) -> Block:
    """Write down in the ledger of the checkout at `root` which seeds a run spends, and return its block.

    `wanted` states the numbers of cases and the code; its seeds begin at `first`, or, where that is None,
    after the last spent one. An unfinished run of the same code and the same numbers goes on instead.

    Raises:
        InputError: files differ from the commit, or the seeds are not sealed or spent.
    """
    path = root / LEDGER
    spent = read_ledger(path)
    for block in spent:
        if not block.finished and _same_run(block, wanted) and first in (None, block.first):
            return block
    require_clean(root)
    if first is None:
        first = max((block.seeds.stop for block in spent), default=DEVELOPMENT.stop)
    # Nothing but the ledger differs from the commit.
    claimed = replace(wanted, first=first, commit=wanted.commit.removesuffix("+"))
    if first in DEVELOPMENT:
        raise InputError(
            f"first seed {first}: is for development; sealed seeds begin at {DEVELOPMENT.stop}, and without "
            "--first-seed a sealed run takes the next unspent ones"
        )
    for block in spent:
        if set(block.seeds) & set(claimed.seeds):
            raise InputError(
                f"seeds {spans(claimed.seeds)}: seeds {spans(block.seeds)} were spent on {block.date} with "
                f"commit {block.commit[:12]}; leave --first-seed out to take the next unspent ones"
            )
    _write(path, (*spent, claimed))
    return claimed


def finish(root: Path, block: Block) -> None:
    """Write down in the ledger of the checkout at `root` that the run of a block is over."""
    path = root / LEDGER
    blocks = [replace(b, finished=True) if b.first == block.first else b for b in read_ledger(path)]
    _write(path, blocks)


def require_clean(root: Path) -> None:
    """Refuse a checkout whose files are not those of its commit, because the ledger names the commit.

    The ledger itself, at `root`, may differ: an earlier sealed run has written it.

    Raises:
        InputError: a file differs, or git cannot tell.
    """
    try:
        changed = [name for name in changed_files(root) if name != LEDGER.as_posix()]
    except (OSError, subprocess.CalledProcessError) as error:
        raise InputError(f"{root}: git cannot say whether files have changed ({error})") from error
    if changed:
        more = f" and {len(changed) - 1} more" if len(changed) > 1 else ""
        raise InputError(
            f"{changed[0]}{more}: not as in the commit; a sealed run is of one commit, so commit or remove "
            "the changes first"
        )


def spans(seeds: Iterable[int]) -> str:
    """Return seeds in words, runs of them shortened, such as "0-2, 7"."""
    parts: list[list[int]] = []
    for seed in sorted(seeds):
        if parts and seed == parts[-1][-1] + 1:
            parts[-1][1:] = [seed]
        else:
            parts.append([seed])
    return ", ".join("-".join(str(end) for end in part) for part in parts)


def _checkout() -> Path:
    root = checkout.checkout()
    if root is None:
        raise InputError("sealed: an installation keeps no record of spent seeds; run it in a checkout")
    return root


def _same_run(block: Block, wanted: Block) -> bool:
    known = (block.bench, block.robot, block.driven, block.fingerprint)
    return known == (wanted.bench, wanted.robot, wanted.driven, wanted.fingerprint)


def _write(path: Path, blocks: Sequence[Block]) -> None:
    write_json(path, {"format": _FORMAT, "blocks": [asdict(block) for block in blocks]})
