"""Spending sealed seeds of the zoo for one run of the running checkout, and writing that down."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from pathlib import Path

from mecanum_env import checkout
from mecanum_env.errors import InputError
from sysid.studies.zoo.cases.case import Level
from sysid.studies.zoo.seeds import Block, claim, finish
from sysid.studies.zoo.sources import fingerprint


def claim_seeds(counts: Mapping[Level, int], first_seed: int | None) -> Block:
    """Spend sealed seeds, and write that down before anything runs.

    Args:
        counts: number of cases of the levels bench and robot.
        first_seed: the first of them; None: the next unspent one.

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
    )
    block = claim(_checkout(), wanted, first_seed)
    print(f"sealed seeds {block.seeds[0]} to {block.seeds[-1]} are spent on commit {block.commit[:12]}")
    return block


def finish_seeds(block: Block) -> None:
    """Write down that the run of a block is over."""
    finish(_checkout(), block)


def _checkout() -> Path:
    root = checkout.checkout()
    if root is None:
        raise InputError("sealed: an installation keeps no record of spent seeds; run it in a checkout")
    return root
