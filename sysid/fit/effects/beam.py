"""The search for the set of effects that logs show: the best sets grow by one effect at a time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from sysid.fit.effects.reached import Reached
from sysid.fit.effects.search import EffectSearch
from sysid.progress import Progress

ROUNDS: Final = 6
"""Largest number of effects that are added. Assumed."""
BEAM: Final = 2
"""Sets that grow in each round. More than one, as two effects may explain what neither does alone."""
_PATIENCE: Final = 2
"""Rounds after which the search ends that found no set better on the fit runs and on the validation runs: the
second of a pair may be what helps."""


def searched(
    searches: Sequence[EffectSearch],
    began: Sequence[Reached],
    tell: Progress,
    rounds: int = ROUNDS,
    width: int = BEAM,
    pruned: int | None = None,
) -> list[Reached]:
    """Return the sets of effects that were the best ones while they grew from starts, the last one first.

    Where a dead zone subtracts, the same set with friction in its place comes first (`EffectSearch.rubbing`).
    Each start belongs to one of the searches, which differ in nothing else. There are at most so many
    `rounds`, in each of which `width` sets grow; `pruned` is as in `EffectSearch.pruned`. `tell` is called
    before each round.
    """
    beam, best, stale = list(began), began[0], 0
    bests = [best]
    for size in range(rounds):
        tell(f"effect {size + 1}")
        before, best = best, min([best, *beam], key=lambda one: one.price(best.inflation))
        better = best is not before and best.held_out < before.held_out
        stale = 0 if size == 0 or better else stale + 1
        bests += [best] if best is not before else []
        if stale == _PATIENCE:
            break
        grown = [more for one in beam for more in _search_of(one, searches).grown(one)]
        beam = _best_ones(grown, best.inflation)[:width]
        if not beam:
            break
    best = min([best, *beam], key=lambda one: one.price(best.inflation))
    found = (_search_of(best, searches).pruned(best, pruned), best, *reversed(bests))
    return list(
        dict.fromkeys(each for one in found for each in (_search_of(one, searches).rubbing(one), one))
    )


def _search_of(reached: Reached, searches: Sequence[EffectSearch]) -> EffectSearch:
    """Return the search that a set belongs to; one that changed a form began without it."""
    own = (search for search in searches if search.base is reached.base)
    return next(own, None) or searches[0].beside(reached)


def _best_ones(grown: Sequence[Reached], inflation: float) -> list[Reached]:
    """Return the best of some sets, each set of effects once."""
    found: dict[tuple[str, ...], Reached] = {}
    for one in sorted(grown, key=lambda one: one.price(inflation)):
        found.setdefault(tuple(sorted(one.fitted.candidate.effects.names)), one)
    return list(found.values())
