"""Which sets of effects explain the logs best: singles, pairs, triples, each grown from smaller ones.

Growing a set by one effect is judged twice: cheaply (`sysid.gap.search.responses`), and, for those that
promise most, by full simulation. A larger set contains the smaller one at its neutral value and so never
fits worse: where a descent ends higher than the set it grew from, it is started again from there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from sysid.compare.descent import Minimum, compass_search
from sysid.compare.fitted import Fitted, base_fit, fit, marginal_function
from sysid.compare.problem import ResidualProblem
from sysid.gap.search.coordinates import EffectSet, bench_twins
from sysid.gap.search.responses import Growth, Key, Response, growths, responses

EMPTY: Final = EffectSet((), ())
_ROUNDING: Final = 1e-6  # of a square sum
_HOPE: Final = 0.5
_FAR: Final = 4.0  # of what chance leaves: much is missing
_NEAR: Final = 0.2  # of what an effect explains: another may miss so much in the screen


@dataclass(frozen=True)
class SearchEffort:
    """How many sets are fitted by full simulation."""

    singles: int = 12
    pairs: int = 12
    triples: int = 6
    swaps: int = 20
    """Sets that differ from the best one in one effect."""
    beam: int = 4
    """Sets of one size that the next size grows from."""

    def of_size(self, size: int) -> int:
        """Return how many sets of a size are fitted at a time."""
        return {1: self.singles, 2: self.pairs}.get(size, self.triples)


class Search:
    """All sets fitted so far, the empty one first.

    Args:
        problem: the model and the logs.
        library: responses of the effects to consider.
        effort: how much to simulate.
    """

    def __init__(self, problem: ResidualProblem, library: Sequence[Response], effort: SearchEffort) -> None:
        self.problem, self.library, self.effort = problem, tuple(library), effort
        self.base = base_fit(problem, EMPTY)
        self.fitted: dict[Key, Fitted[EffectSet]] = {((), False): self.base}
        self._behind: dict[Key, list[Response]] = {}

    def of_size(self, size: int) -> list[Fitted[EffectSet]]:
        """Return the fitted sets of a size, the best fit first."""
        found = [fitted for fitted in self.fitted.values() if len(fitted.names) == size]
        return sorted(found, key=lambda f: (f.cost, f.names))

    def grow(self, size: int) -> None:
        """Fit the most promising sets of a size, from the best sets that are smaller by one."""
        parents = self.of_size(size - 1)[: self.effort.beam]
        self.fit_best([g for p in parents for g in self.growths(p)], self.effort.of_size(size))

    def growths(self, parent: Fitted[EffectSet]) -> list[Growth]:
        """Return a fitted set's growths by one effect each, the most promising first.

        Not by one that does what an effect of the set does already, whatever the command.
        """
        found = growths(self.problem.base, parent, self._library_at(parent), self.problem.study.scale)
        return [g for g in found if not (self.problem.bench and bench_twins(g.candidate.names))]

    def swap(self, chosen: Fitted[EffectSet]) -> None:
        """Fit the sets that differ from a `chosen` one in one effect and may explain as much.

        The linear screen is rough where an effect is large, so what may explain most of what the chosen
        effect explains is tried, and what the screen takes for as good as the chosen effect.
        """
        near: list[Growth] = []
        for name in chosen.names:
            parent = self._rest(chosen, name)
            if parent is not None:
                grown = self.growths(parent)
                screened = min((g.expected for g in grown if name in g.candidate.names), default=chosen.cost)
                best = max(chosen.cost, screened)
                limit = best + _NEAR * max(0.0, parent.cost - best)
                near += [g for g in grown if g.expected <= limit]
        self.fit_best(near, self.effort.swaps)

    def polish(self, fitted: Fitted[EffectSet]) -> Fitted[EffectSet]:
        """Return a fitted set after a look about, where the simulation is rough and slopes mislead."""
        rough = ~self.problem.surrogate_mask(fitted.candidate.owners)
        if not self.problem.has_surrogate or not np.any(rough):
            return fitted
        function = marginal_function(self.problem, fitted.candidate)
        here = Minimum(fitted.place, fitted.residual, fitted.jacobian, 0)
        looked = compass_search(function, here, rough)
        if looked.cost < fitted.cost:
            again = fit(self.problem, fitted.candidate, looked.place, most=4)
            if again is not None and again.cost < fitted.cost:
                fitted = again
                self.fitted[fitted.names, fitted.candidate.integral] = fitted
        return fitted

    def fit_best(self, candidates: Sequence[Growth], most: int) -> None:
        """Fit up to `most` different `candidates` by full simulation, those that promise enough.

        The linear screen is rough: what is expected to gain less than `_HOPE` of the best one's gain is left.
        """
        ordered = sorted(candidates, key=lambda g: (g.expected, g.key))
        chosen: dict[Key, Growth] = {}
        for growth in ordered:
            gain, best = (self.base.cost - g.expected for g in (growth, ordered[0]))
            if gain >= _HOPE * best and growth.key not in self.fitted and len(chosen) < most:
                chosen.setdefault(growth.key, growth)
        for key, found in zip(chosen, self.problem.study.map(self._fit, chosen.values()), strict=True):
            if found is not None:
                self.fitted[key] = found

    def _fit(self, growth: Growth) -> Fitted[EffectSet] | None:
        found = fit(self.problem, growth.candidate, growth.place)
        if found is None or found.cost > growth.parent.cost * (1.0 + _ROUNDING):
            again = fit(self.problem, growth.candidate, growth.parent_place)
            found = again if again is not None and (found is None or again.cost < found.cost) else found
        if found is not None and found.cost > growth.parent.cost * (1.0 + _ROUNDING):
            raise AssertionError(f"{growth.key[0]} fits worse than {growth.parent.names}, which it contains")
        return found

    def _library_at(self, parent: Fitted[EffectSet]) -> Sequence[Response]:
        """Return the responses to grow a set by: measured where it stands, where that is behind a delay.

        What an effect does before a delay is another response, and tells nothing of what the set leaves.
        """
        shifted = any(CATALOGUE[name].shifts_time for name in parent.names)
        if parent.cost < _FAR * self.problem.size or not shifted:
            return self.library
        key = parent.names, parent.candidate.integral
        if key not in self._behind:
            names = {response.chosen.names[0] for response in self.library} - set(parent.names)
            at = parent.candidate.model(self.problem.base, parent.place)
            self._behind[key] = responses(self.problem, tuple(names), at)
        return self._behind[key]

    def _rest(self, chosen: Fitted[EffectSet], name: str) -> Fitted[EffectSet] | None:
        """Return the fit of a set without one of its effects, made now if there is none."""
        names = tuple(other for other in chosen.names if other != name)
        for integral in (False, True):
            if (names, integral) in self.fitted:
                return self.fitted[names, integral]
        kept = [i for i, c in enumerate(chosen.candidate.coordinates) if c.effect in names]
        smaller = EffectSet(names, tuple(chosen.candidate.coordinates[i] for i in kept))
        found = fit(self.problem, smaller, chosen.place[kept])
        if found is not None:
            self.fitted[names, False] = found
        return found
