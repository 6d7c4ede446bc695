"""Looking for the command sequence that tells most: the library first, then random changes of its best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from mecanum_env.units import FloatArray
from sysid.gap.sequences import Limits, changed, library
from sysid.logs.records import Level


@dataclass(frozen=True)
class Effort:
    """How much is simulated."""

    thorough: int
    """Sequences of the library that are judged with everything that could hide a difference."""
    rounds: int
    changes: int
    """Random changes a round."""


PLENTY: Final = 4.0
"""A sequence worth this much is not improved: its power is 1 but for a few in 100,000."""
EFFORT: Final[dict[Level, Effort]] = {"bench": Effort(16, 8, 6), "robot": Effort(4, 2, 4)}


@dataclass(frozen=True, eq=False)
class Judged:
    """A sequence and how well it tells."""

    rows: FloatArray
    z: FloatArray
    """(p,), one a question: the answer is right with probability Phi(z)."""


Judge: TypeAlias = Callable[[FloatArray, bool], Judged | None]
"""Judges a sequence, thoroughly or not; None where its outcome cannot be predicted."""
Worth: TypeAlias = Callable[[Judged], float]
"""What a sequence is worth, on the scale of z."""


def search(
    limits: Limits,
    judge: Judge,
    worth_of: Callable[[Sequence[Judged]], Worth | None],
    effort: Effort,
    *,
    seed: int = 0,
    jobs: int = 1,
) -> Judged | None:
    """Return the best sequence found; None where none is worth anything.

    Args:
        limits: of the robot.
        judge: of sequences; called from `jobs` threads.
        worth_of: says, from the library's best, what a sequence is worth; None if nothing is.
        effort: how much to simulate.
        seed: of the random sequences and changes.
        jobs: sequences judged at a time; changes the time taken, not the result.
    """
    rng = np.random.default_rng(seed)
    quick = _all(judge, library(limits, rng), False, jobs)
    if not quick or worth_of(quick) is None:
        return None
    promising, found = _promising(quick), list[Judged]()
    while promising and 2 * len(found) < effort.thorough:
        found += _all(judge, promising[: effort.thorough], True, jobs)
        del promising[: effort.thorough]
    worth = worth_of(found) if found else None
    if worth is None:
        return None
    best = max(found, key=worth)
    for _ in range(effort.rounds):
        if worth(best) >= PLENTY:
            break
        tried = [changed(best.rows, limits, rng) for _ in range(effort.changes)]
        new = _all(judge, [rows for rows in tried if rows is not None], True, jobs)
        best = max([best, *new], key=worth)
    return best


def _promising(found: Sequence[Judged]) -> list[FloatArray]:
    """Return the sequences in order: in turn, the best for the worst question and for each question."""
    every = np.array([j.z for j in found])
    orders = [np.argsort(-values, kind="stable") for values in (every.min(axis=1), *every.T)]
    chosen = dict.fromkeys(int(order[rank]) for rank in range(len(found)) for order in orders)
    return [found[i].rows for i in chosen]


def _all(judge: Judge, sequences: Sequence[FloatArray], thorough: bool, jobs: int) -> list[Judged]:
    if jobs == 1:
        found = [judge(rows, thorough) for rows in sequences]
    else:
        # Threads: MuJoCo lets go of the interpreter while it steps.
        with ThreadPoolExecutor(jobs) as pool:
            found = list(pool.map(lambda rows: judge(rows, thorough), sequences))
    return [judged for judged in found if judged is not None]
