"""Which sets of effects explain the logs best: singles, pairs, triples, each grown from smaller ones.

Growing a set by one effect is judged twice: cheaply (`sysid.gap.search.responses`), and, for the most
promising ones, by full simulation. A larger set contains the smaller one at its neutral value and so never
fits worse: where a descent ends higher than the set it grew from, it is started again from there. And where
a smaller set fits better as a part of a larger one, it is fitted again from that place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Final

import numpy as np

from mecanum_env.effects import CATALOGUE
from mecanum_env.effects.integral_action import rings
from mecanum_env.model import cause_of
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import (
    Fitted,
    Minimum,
    ResidualProblem,
    base_fit,
    compass_search,
    fit,
    marginal_function,
)
from sysid.compare.search_space import EffectSet, excludes_itself
from sysid.gap.search.chance import roller_scatter
from sysid.gap.search.given_set import GivenSet, set_at
from sysid.gap.search.responses import Growth, Library, Response, growths, responses
from sysid.gap.search.thresholds import THRESHOLDS, SearchEffort
from sysid.progress import Progress, silent

EMPTY: Final = EffectSet((), ())
_ROUNDING: Final = 1e-6
"""Relative rise of a cost that is no more than rounding."""
_WORTH_FITTING: Final = 0.5
"""A growth is simulated if the linear screening expects this share of the best growth's gain: the screening
may be off by as much."""
_MUCH_LEFT: Final = 4.0
"""Mean squared residual behind a delay above which the other effects' responses are measured again there."""
_SLACK: Final = 4.0
"""A fit is given up if it would stay so many times as far above the best one as a tied set may be."""
_UNDERRATED: Final = 4.0
"""Most times that the screening underrates a gain: by 2.6 at most in studies of robots. It spares fits on
rollers; a wheel on the bench is simulated so fast that its fits decide."""
_RESTARTS: Final = 2
"""Descents of a set on the bench after the first one. In three studies of drawn drives (bench seeds 305, 337
and 354) the first of them lowered the cost of a ceiling with a soft knee to a sixth, and the second one
gained .6 % at most."""
_NEXT_TO_NOTHING: Final = 0.01
"""Relative gain of a descent below which no other one follows."""
_SWAP: Final = 0.2
"""Share of an effect's gain by which the screening may underrate another effect that could replace it."""
_ELSEWHERE: Final = 0.8
"""Share of its cost that a set must be expected to reach from another place to be fitted again. Assumed."""


class Search:
    """All sets fitted so far, the empty one first."""

    def __init__(self, problem: ResidualProblem, considered: Library, effort: SearchEffort) -> None:
        self.problem, self.considered, self.effort = problem, considered, effort
        self.library = considered.searched
        self.base = base_fit(problem, EMPTY)
        self.tell: Progress = silent
        """Called before each fit with the set."""
        self.told_before: frozenset[tuple[str, ...]] = frozenset()
        """Sets that an earlier search of the same logs, with another weight of each sample, found as good."""
        self.given: GivenSet = {}
        """A set of effects, with values, that `fit_given` fits."""
        self._fitted: dict[tuple[str, ...], Fitted[EffectSet]] = {(): self.base}
        self._behind: dict[tuple[str, ...], list[Response]] = {}

    @property
    def fitted(self) -> Mapping[tuple[str, ...], Fitted[EffectSet]]:
        """The fitted sets by the names of their effects; read-only."""
        return MappingProxyType(self._fitted)

    @property
    def best_fit(self) -> Fitted[EffectSet]:
        """The set with the lowest cost, whatever its size."""
        return min(self._fitted.values(), key=lambda fitted: fitted.cost)

    def of_size(self, size: int) -> list[Fitted[EffectSet]]:
        """Return the fitted sets of a size, the best fit first."""
        found = [fitted for fitted in self._fitted.values() if len(fitted.names) == size]
        return sorted(found, key=lambda f: (f.cost, f.names))

    def grow(self, size: int) -> None:
        """Fit the most promising sets of a size, from the best sets that are smaller by one.

        On the bench these are then fitted again from where they are in the larger ones, if that is better: a
        descent that ended too early would make any further effect look needed.
        """
        parents = self.of_size(size - 1)[: self.effort.beam]
        self.fit_best([g for p in parents for g in self.growths(p)], self.effort.of_size(size))
        if not self.problem.has_surrogate:
            for larger in self.of_size(size):
                self._improve_parts(larger)

    def fit_given(self) -> int:
        """Fit the given set, and what is left as the least useful effects go one by one; return its size.

        That is 0 where no set is given or none of them can be simulated.
        """
        if not self.given:
            return 0
        candidate, place = set_at(self.problem.base, self.given, self.problem.settings.scale)
        found = fit(self.problem, candidate, place)
        if found is None or self._rings(found):
            return 0
        before, found = self._fitted.get(found.names, found), self._to_the_end(found)
        self._fitted[found.names] = min(before, found, key=lambda one: one.cost)
        smaller: Fitted[EffectSet] | None = self._fitted[found.names]
        while smaller is not None and len(smaller.names) > 1:
            rests = [self._rest(smaller, name) for name in smaller.names]
            smaller = min((one for one in rests if one), key=lambda one: one.cost, default=None)
        return len(found.names)

    def _improve_parts(self, larger: Fitted[EffectSet]) -> None:
        """Fit each set that a `larger` one may have grown from again, if it fits better at its place there.

        One that was not fitted before is, if the larger set is about the best one.
        """
        is_near = larger.cost <= self._limit(larger.names)
        for name in larger.names:
            names = tuple(other for other in larger.names if other != name)
            known = self._fitted.get(names)
            if not names or (known is None and not is_near):
                continue
            smaller = larger.candidate.only(names)
            place = larger.place[[c.effect != name for c in larger.candidate.coordinates]]
            residual = marginal_function(self.problem, smaller)(place)
            least = math.inf if known is None else (1.0 - _NEXT_TO_NOTHING) * known.cost
            if residual is None or float(residual @ residual) > least:
                continue
            found = fit(self.problem, smaller, place)
            if found is not None and found.cost < least and not self._rings(found):
                self._fitted[names] = self._to_the_end(found)

    def growths(self, parent: Fitted[EffectSet]) -> list[Growth]:
        """Return a fitted set's growths by one effect each, the most promising first.

        Left out are an effect that does what one of the set does already, whatever the command, and another
        form of a cause that the set has.
        """
        found = growths(
            self.problem.base,
            parent,
            self._library_at(parent),
            self.problem.settings.scale,
            wary=self.problem.knows_all,
        )
        return [g for g in found if not self._excluded(g.candidate.names)]

    def swap(self, chosen: Fitted[EffectSet]) -> None:
        """Fit the sets that differ from a `chosen` one in one effect and may explain as much.

        The linear screening is inaccurate where an effect is large. Tried is therefore what may explain most
        of what the chosen effect explains, or what the screening rates as high as the chosen effect.
        """
        near: list[Growth] = []
        for name in chosen.names:
            parent = self._rest(chosen, name)
            if parent is not None:
                grown = self.growths(parent)
                screened = min((g.expected for g in grown if name in g.candidate.names), default=chosen.cost)
                best = max(chosen.cost, screened)
                limit = best + _SWAP * max(0.0, parent.cost - best)
                near += [g for g in grown if g.expected <= limit]
        self.fit_best(near, self.effort.swaps)

    def polish(self, fitted: Fitted[EffectSet]) -> Fitted[EffectSet]:
        """Return a fitted set, improved by a search without derivatives where only the rollers respond.

        Their response is rough, so that slopes mislead there.
        """
        only_rollers = ~self.problem.surrogate_mask(fitted.candidate.owners)
        if not self.problem.has_surrogate or not np.any(only_rollers):
            return fitted
        function = marginal_function(self.problem, fitted.candidate)
        here = Minimum(fitted.place, fitted.residual, fitted.jacobian, 0)
        improved = compass_search(function, here, only_rollers)
        if improved.cost < fitted.cost:
            known = _columns(fitted.candidate, fitted)
            again = fit(self.problem, fitted.candidate, improved.place, most=4, known=known)
            if again is not None and again.cost < fitted.cost:
                fitted = again
                self._fitted[fitted.names] = fitted
        return fitted

    def fit_best(self, candidates: Sequence[Growth], most: int) -> None:
        """Fit up to `most` different `candidates` by full simulation, those that promise enough."""
        ordered = sorted(candidates, key=lambda g: (g.expected, g.names))
        chosen: dict[tuple[str, ...], Growth] = {}
        for growth in ordered:
            gain, best = (self.base.cost - g.expected for g in (growth, ordered[0]))
            promises = gain >= _WORTH_FITTING * best or self._is_always_fitted(growth)
            if promises and self._is_unfitted(growth) and len(chosen) < most:
                chosen.setdefault(growth.names, growth)
        # The most promising one shows what the others have to reach.
        ranked = list(chosen.values())
        self._fit_hopeful(ranked[:1])
        self._fit_hopeful(ranked[1:])

    def _is_unfitted(self, growth: Growth) -> bool:
        """Return whether a set was not fitted yet, or, on the bench, from a place that led elsewhere.

        Beside other forms or sizes of its other effects an effect may promise far less than its set reached.
        """
        before = self._fitted.get(growth.names)
        return before is None or (
            not self.problem.has_surrogate and growth.expected < _ELSEWHERE * before.cost
        )

    def _is_always_fitted(self, growth: Growth) -> bool:
        """Return whether a growth is fitted whatever the screening promises: a single effect without rollers.

        That takes a second, and a threshold between two of the sizes that were screened may promise a fifth
        of what it gains.
        """
        problem = self.problem
        quick = not problem.has_surrogate or (problem.knows_all and problem.surrogate_covers(growth.names))
        return len(growth.names) == 1 and quick

    def _fit_hopeful(self, growths: Sequence[Growth]) -> None:
        limits = [self._limit(growth.candidate.names) for growth in growths]
        pairs = [
            (growth, limit)
            for growth, limit in zip(growths, limits, strict=True)
            if self._is_always_fitted(growth) or self._may_reach(growth, limit)
        ]
        fits = self.problem.settings.map(self._fit, pairs)
        found = {g.names: one for (g, _), one in zip(pairs, fits, strict=True) if one is not None}
        for names, one in found.items():
            before = self._fitted.get(names)
            if not self._rings(one) and (before is None or one.cost < before.cost):
                self._fitted[names] = one

    def _rings(self, fitted: Fitted[EffectSet]) -> bool:
        """Return whether a set makes its drive ring under a load, which would pass for any swing.

        A drive that damps its loads so little would ring after each change of command, too.
        """
        model = fitted.candidate.model(self.problem.base, fitted.place)
        return rings(model.effects.values()) and not rings(self.problem.base.effects.values())

    def may_gain(self, promised: float) -> float:
        """Return the most that a set may gain from which the screening `promised` so much."""
        return _UNDERRATED * promised if self.problem.has_surrogate else math.inf

    def shared(self, one: Sequence[str], other: Sequence[str]) -> Fitted[EffectSet]:
        """Return the fit of the effects that `one` set shares with an `other`; of none if there is none."""
        names = tuple(name for name in one if name in other)
        return self._fitted.get(names) or self.base

    def _may_reach(self, growth: Growth, limit: float) -> bool:
        parent = growth.parent.cost
        return parent - self.may_gain(parent - growth.expected) <= limit

    def leave_out_needless(self, size: int, inflation: float) -> None:
        """Replace the best sets of a size by what they are without the parameters that they do not need.

        `inflation` is the residual variance of the best fit relative to the expected one.
        """
        near = self.of_size(size)
        limit = near[0].cost + 4.0 * THRESHOLDS.tie_sigmas**2 * inflation
        for fitted in [f for f in near if f.cost <= limit]:
            self._fitted[fitted.names] = self._without_needless(fitted, inflation)

    def _without_needless(self, fitted: Fitted[EffectSet], inflation: float) -> Fitted[EffectSet]:
        while True:
            candidate, spread = fitted.candidate, np.sqrt(np.diag(fitted.covariance(inflation)))
            sigmas = np.abs(fitted.place - candidate.needless_at(fitted.place)) / np.maximum(spread, 1e-12)
            for index in np.argsort(sigmas):
                one = candidate.coordinates[index]
                # Either component of a vector may well be 0.
                alone = bool(one.axis) or candidate.owners.count(one.effect) < 2
                if alone or sigmas[index] ** 2 > THRESHOLDS.needless_square:
                    continue
                smaller = candidate.without(int(index))
                known = _columns(smaller, fitted)
                found = fit(self.problem, smaller, np.delete(fitted.place, index), known=known)
                if found is not None and found.cost <= fitted.cost + THRESHOLDS.needless_square * inflation:
                    fitted = found
                    break
            else:
                return fitted

    def _limit(self, names: Sequence[str]) -> float:
        """Return the cost above which a set of effects is neither best of its size nor tied with the best."""
        fitted = self.of_size(len(names))
        if not fitted:
            return math.inf
        best = fitted[0].cost
        rest = self.shared(names, fitted[0].names)
        inflation, gain = max(1.0, best / self.problem.size), max(0.0, rest.cost - best)
        share = THRESHOLDS.formula(beside_fit_of_robot=self.problem.knows_all)
        tie = THRESHOLDS.tie_sigmas**2 * inflation + share**2 * gain
        return best + _SLACK * tie + float(np.sum(roller_scatter(self.problem, self.base) ** 2))

    def _fit(self, work: tuple[Growth, float]) -> Fitted[EffectSet] | None:
        (growth, limit), known = work, _columns(work[0].candidate, work[0].parent)
        self.tell(" + ".join(growth.candidate.names))
        contains = not self._changes_base(growth.candidate)
        stepwise = any(c.stepwise for i, c in enumerate(growth.candidate.coordinates) if i not in known)
        if stepwise or self.problem.knows_all:
            # A derivative promises nothing there, or a whole fit on the planar plant takes hardly longer.
            limit = math.inf
        found = fit(self.problem, growth.candidate, growth.place, limit=limit, known=known)
        for cost, place in () if self.problem.has_surrogate else growth.elsewhere:
            if found is None or cost < found.cost:
                other = fit(self.problem, growth.candidate, place, limit=limit)
                found = min((one for one in (found, other) if one), key=lambda one: one.cost, default=None)
        if found is None or (contains and found.cost > growth.parent.cost * (1.0 + _ROUNDING)):
            if found is not None and found.given_up:
                return replace(found, place=growth.parent_place, residual=growth.parent.residual)
            again = fit(self.problem, growth.candidate, growth.parent_place, limit=limit, known=known)
            found = again if again is not None and (found is None or again.cost < found.cost) else found
        if found is not None and not self.problem.has_surrogate:
            found = self._to_the_end(found)
        if contains and found is not None and found.cost > growth.parent.cost * (1.0 + _ROUNDING):
            raise AssertionError(f"{growth.names} fits worse than {growth.parent.names}, which it contains")
        return found

    def _to_the_end(self, found: Fitted[EffectSet]) -> Fitted[EffectSet]:
        """Return a fitted set after descents from where the last one ended, until one gains next to nothing.

        A descent whose Jacobian has aged, or that was given up, ends early; a further effect would then look
        needed.
        """
        for _ in range(_RESTARTS):
            again = fit(self.problem, found.candidate, found.place)
            if again is None or again.cost >= found.cost:
                return found
            gain, found = found.cost - again.cost, again
            if gain < _NEXT_TO_NOTHING * found.cost:
                return found
        return found

    def _changes_base(self, candidate: EffectSet) -> bool:
        """Return whether a set takes a form of an effect out of the base model, or sets a number of one.

        It takes out a form for another one, and sets how often a ripple swings per turn. Such a set does not
        contain the smaller ones, and may fit worse than they do.
        """
        present = set(self.problem.base.effects)
        causes = {cause_of(name) for name in candidate.names if name not in present}
        sets = any(effect in present for effect, _, _ in candidate.fixed)
        return sets or any(cause_of(name) in causes for name in present)

    def _excluded(self, names: Sequence[str]) -> bool:
        return excludes_itself(names, bench=self.problem.bench)

    def _library_at(self, parent: Fitted[EffectSet]) -> Sequence[Response]:
        """Return the responses to grow a set by, measured at the set itself if it has a delay.

        What an effect does before a delay is another response, and tells nothing of what the set leaves.
        """
        shifted = any(CATALOGUE[name].shifts_time for name in parent.names)
        if parent.cost < _MUCH_LEFT * self.problem.size or not shifted:
            return self.library
        if self.problem.has_surrogate and parent.cost > self._limit(parent.names):
            # On rollers that takes too long for a set that is far from the best one.
            return self.library
        if parent.names not in self._behind:
            others = {response.effect for response in self.library} - set(parent.names)
            names = [name for name in others if not self._excluded((*parent.names, name))]
            at = parent.candidate.model(self.problem.base, parent.place)
            self._behind[parent.names] = responses(self.problem, names, at)
        return self._behind[parent.names]

    def _rest(self, chosen: Fitted[EffectSet], name: str) -> Fitted[EffectSet] | None:
        """Return the fit of a set without one of its effects, made now if there is none."""
        names = tuple(other for other in chosen.names if other != name)
        if names in self._fitted:
            return self._fitted[names]
        kept = [i for i, c in enumerate(chosen.candidate.coordinates) if c.effect in names]
        smaller = chosen.candidate.only(names)
        found = fit(self.problem, smaller, chosen.place[kept], known=_columns(smaller, chosen))
        if found is not None:
            self._fitted[names] = found
        return found


def _columns(candidate: EffectSet, like: Fitted[EffectSet]) -> dict[int, FloatArray]:
    """Return the columns (N,) of the Jacobian that a set shares with another, fitted one, by their number."""
    at = dict(zip(like.candidate.coordinates, like.jacobian.T, strict=True))
    return {i: at[c] for i, c in enumerate(candidate.coordinates) if c in at}
