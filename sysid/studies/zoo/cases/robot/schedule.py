"""Which kind of case a seed of robots gets, and which change is its turn.

Kinds have fixed shares in every block of seeds, and changes come round in turn, so that any long stretch of
seeds covers all of them alike.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from sysid.studies.zoo.cases.case import Kind

_COUNTS: Final[dict[Kind, int]] = {
    "quiet": 10,
    "single": 18,
    "pair": 4,
    "twin": 1,
    "untestable": 1,
    "near_outsider": 3,
    "far_outsider": 3,
}
"""Cases of each kind in a block of seeds."""
BLOCK: Final = sum(_COUNTS.values())
_KINDS: Final = tuple(kind for kind, count in _COUNTS.items() for _ in range(count))
_STREAM: Final = 4001


def kind_of(seed: int) -> tuple[Kind, int]:
    """Return the kind of a seed's case, and how many cases of that kind the seeds before it have."""
    block, place = divmod(seed, BLOCK)
    order = np.random.default_rng([_STREAM, block]).permutation(BLOCK)
    kinds = [_KINDS[k] for k in order]
    kind = kinds[place]
    return kind, block * _COUNTS[kind] + kinds[:place].count(kind)


def in_turn(count: int, turn: int, stream: int) -> list[int]:
    """Return the numbers below a count in the order in which a turn tries them.

    Args:
        count: of the things to choose from.
        turn: number of the choice; as many turns in a row as there are things begin with each of them once.
        stream: of the random numbers, one for each list of things.
    """
    cycle, place = divmod(turn, count)
    first = int(np.random.default_rng([_STREAM, stream, cycle]).permutation(count)[place])
    # In another order each time, so that what follows an impossible thing is not always the same.
    others = np.random.default_rng([_STREAM, stream, cycle, place]).permutation(count).tolist()
    return [first, *(k for k in others if k != first)]
