"""From logs to a verdict: how many effects, which, what else would do, and is it enough.

1. Is there a gap? The best growth of the empty set, and the cost itself, against what chance does.
2. How many effects? One more only if the cost falls by more than the best of all effects would make it fall
   by chance, and each run is predicted better from the others (`sysid.gap.search.scores`).
3. Which? Every set of that size whose score is within `tie_sigmas`^2 of the best is as good (`tied`).
4. What is the verdict? The first rule that applies gives it (`sysid.gap.search.rules`): is it enough, does it
   matter, does it do harm, would the wheel law fitted again do better?

All costs are divided by `inflation`, the residual variance of the best fit relative to the expected noise
variance (at least 1). All numbers are in `sysid.gap.search.thresholds`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import cause_of
from sysid.compare.least_squares import Fitted, ResidualProblem, fit
from sysid.compare.search_space import EffectSet, RefittedLaw
from sysid.gap.result import Verdict
from sysid.gap.search.chance import Floor, chance_gains, complete, enough, expected, misfit, odd_run
from sysid.gap.search.consequences import without_consequences
from sysid.gap.search.free_term import free_term
from sysid.gap.search.further import needed, residue, visible
from sysid.gap.search.one_sequence import OF_ONE, is_asked, is_of_one_sequence
from sysid.gap.search.plain_squares import noise_ratio, plainly_larger, removed, removed_of_all
from sysid.gap.search.rules import Facts, apply_rules
from sysid.gap.search.scores import ScoredSet, agreed_on, doubtful, rises, scored
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.search.ties import (
    friction_first,
    in_first_forms,
    is_description,
    tied,
    with_causes,
    with_fewer,
)

_MOST_SWAPS: Final = 3
"""Sets from which effects are swapped. Assumed."""
_CLEARLY: Final = 4.0
"""Ratio of a gain to the needed one above which a better fit of the smaller set would change nothing, and
above which a robot's logs differ from those of its fit for sure, whatever it is. Assumed."""


@dataclass(frozen=True, eq=False)
class Decision:
    """The verdict and what it rests on."""

    verdict: Verdict
    chosen: ScoredSet | None
    """What is added to the model, if anything."""
    candidates: tuple[ScoredSet, ...]
    """Sets that explain the logs as well as the chosen one, which comes first."""
    facts: Facts
    notes: tuple[str, ...]


def decide(search: Search, floor: Floor, max_effects: int, rng: np.random.Generator) -> Decision:
    """Search for sets of at most `max_effects` and decide; again, if the wheels started at other angles.

    What is fitted stays in the search; `rng` is that of the simulated thresholds and the bootstrap.
    """
    problem, notes = search.problem, []
    facts = collect(search, floor, max_effects, rng)
    best = search.best_fit
    if not complete(problem, best, floor) and problem.has_surrogate:
        model = best.candidate.model(problem.base, best.place)
        if problem.update_angle_uncertainty(model, best.residual):
            facts = collect(search, floor, max_effects, rng)
            notes.append("initial wheel angles are unknown: the ripple they can cause is counted as noise")
    outcome = apply_rules(facts)
    found = outcome.verdict in ("named", "ambiguous")
    told = facts.tied[0].fitted if found else search.base
    if outcome.verdict != "unexplained" and (file := odd_run(problem, told, floor)):
        notes.append(f"{file} differs from its repeats by more than noise, no other run does: look at it")
    return Decision(
        verdict=outcome.verdict,
        chosen=facts.tied[0] if found else None,
        candidates=facts.tied if found else (),
        facts=facts,
        notes=(*outcome.reasons, *(facts.consequences if found else ()), *notes),
    )


def collect(search: Search, floor: Floor, max_effects: int, rng: np.random.Generator) -> Facts:
    """Search for sets of at most `max_effects`, and return all facts that the rules need.

    What is fitted stays in the search; `rng` is that of the simulated thresholds and the bootstrap.
    """
    problem, base = search.problem, search.base
    facts = explore(search, floor, max_effects, rng)
    chosen, inflation = facts.chosen, facts.inflation
    # If nothing is left to explain, no law can do better.
    refit = chosen is not None and not complete(problem, chosen.fitted, floor)
    law = _law(problem, inflation) if refit else None
    if chosen is not None and is_description(chosen) and max_effects > 1 and not search.of_size(2):
        # Two causes may do as well as a curve of five numbers, although the second is worth little beside it.
        search.grow(2)
    every = [scored(problem, fitted, inflation) for fitted in search.fitted.values()]
    judged = tuple(sorted(every, key=lambda j: (j.score, j.names)))
    facts = replace(facts, judged=judged, law=law)
    if chosen is None:
        return facts
    same_size = [j for j in judged if len(j.names) == len(chosen.names)]
    harmless = [j for j in same_size if not rises(problem, base, j.fitted)]
    chosen = in_first_forms(chosen, harmless, inflation)
    rival = free_term(problem, base.residual, inflation) if problem.bench else None
    lacking = 0.0 if rival is None else max(0.0, chosen.score - rival.score)
    as_good = tied(search, floor, chosen, harmless, inflation, lacking)
    as_good = friction_first(with_causes(search, floor, as_good, judged, inflation, lacking) or as_good)
    # The chosen one was found to be needed before (`_holds`); it stays if the causes beside it are not.
    as_good = tuple(
        one for one in as_good if one is chosen or needed(search, floor, one.fitted, inflation, rng)
    ) or (chosen,)
    # The runs may disagree about the size of the best one, and agree about that of another one as good.
    sure = next((one for one in as_good if not doubtful(problem, one.fitted, inflation)), None)
    if sure is not None:
        as_good = (sure, *(one for one in as_good if one is not sure))
    chosen = as_good[0] if as_good else chosen
    as_good = with_fewer(search, floor, as_good, judged, inflation)
    as_good, consequences = without_consequences(problem.base, base.cost, as_good, judged)
    return replace(
        facts,
        chosen=chosen,
        tied=as_good,
        consequences=consequences,
        free=rival,
        allowed=THRESHOLDS.free_sigmas**2
        + _formula_residue(search, chosen.fitted, THRESHOLDS.formula_error) / inflation,
        law_allowed=THRESHOLDS.tie_sigmas**2
        + _formula_residue(search, chosen.fitted, THRESHOLDS.exact_formula) / inflation,
        adequate=enough(problem, base, chosen.fitted, floor),
        removed=removed(problem, base, chosen.fitted),
        removed_of_all=removed_of_all(problem, base, chosen.fitted),
        gain=1.0 - chosen.fitted.cost / base.cost,
        raises_rms=rises(problem, base, chosen.fitted),
        doubtful=doubtful(problem, chosen.fitted, inflation),
        systematic=facts.is_clear and _is_systematic(search, chosen.fitted),
        frequency=_frequency(chosen, [j for j in judged if j.names], rng),
        fall=(base.cost - chosen.fitted.cost) / expected(problem, base),
        of_one_sequence=is_of_one_sequence(problem, base, chosen.fitted, facts.by_chance, facts.by_one),
    )


def explore(search: Search, floor: Floor, max_effects: int, rng: np.random.Generator) -> Facts:
    """Fit sets of effects, up to a size of `max_effects`, as far as the logs support them.

    Returns the facts up to the best such set.
    """
    problem, base = search.problem, search.base
    by_chance = chance_gains(problem, base, search.library, rng, floor.false_alarm)
    hope = max((base.cost - growth.expected for growth in search.growths(base)), default=0.0)
    if hope > 0.5 * by_chance.threshold():
        search.grow(1)
    inflation = _inflation(problem, floor, search.best_fit)
    p_gain = by_chance.p_value((base.cost - search.best_fit.cost) / inflation)
    p_misfit = misfit(problem, base, floor)
    p_value = min(1.0, 2.0 * min(p_gain, p_misfit))
    is_plain = visible(problem, base) or (problem.bench and plainly_larger(problem, base))
    facts = Facts(floor, noise_ratio(problem, base), p_value, p_misfit, is_plain, inflation)
    if p_value > floor.false_alarm:
        return facts
    if not search.of_size(1):
        # Effects could gain little, but the whole residual is more than chance allows.
        search.grow(1)
    if not search.of_size(1):
        return facts
    size = max(_grow(search, floor, max_effects, rng), search.fit_given())
    inflation = _inflation(problem, floor, search.best_fit)
    best = _swapped(search, size, inflation)
    tie = best.cost + THRESHOLDS.tie_sigmas**2 * inflation
    for near in [f for f in search.of_size(size) if f is best or f.cost <= tie]:
        _polished(search, floor, near)
    search.leave_out_needless(size, inflation)
    chosen = _best(search, size, inflation)
    while size > 1 and not _holds(search, floor, chosen, rng):
        size -= 1
        chosen = _best(search, size, inflation)
    facts = replace(facts, inflation=inflation, chosen=chosen)
    if not floor.knows_all:
        return facts
    of_few = of_one = of_all = inflation * by_chance.threshold()
    if is_asked(problem):
        of_few, of_one = (
            inflation * chance_gains(problem, base, search.library, rng, floor.false_alarm, count).threshold()
            for count in (problem.difference_counts.shared, OF_ONE)
        )
    is_clear = base.cost - chosen.fitted.cost > max(of_few, _CLEARLY * of_all)
    return replace(facts, is_clear=is_clear, by_chance=of_all, by_one=of_one)


def _swapped(search: Search, size: int, inflation: float) -> Fitted[EffectSet]:
    """Return the best set of a size after swaps of single effects, from every set that became the best one.

    Where one effect has found its form, another may turn out to be but an imitation beside the first form.
    """
    best = _best(search, size, inflation).fitted
    for _ in range(_MOST_SWAPS):
        search.swap(best)
        before, best = best, _best(search, size, inflation).fitted
        if best is before:
            break
    return best


def _grow(search: Search, floor: Floor, max_effects: int, rng: np.random.Generator) -> int:
    """Fit larger sets as long as one more effect pays; return the size that does."""
    problem, size = search.problem, 1
    while size < max_effects:
        parent = _best(search, size, 1.0).fitted
        nearest = search.of_size(size)[: search.effort.beam]
        promised = min((g.expected for p in nearest for g in search.growths(p)), default=parent.cost)
        inflation, gain = max(floor.slack, promised / problem.size), parent.cost - promised
        by_chance = _by_chance_beside(search, parent, floor, rng)
        if gain < by_chance * inflation:
            return size
        if not visible(problem, parent):
            least = by_chance * inflation + _formula_residue(search, parent, THRESHOLDS.exact_formula)
            if search.may_gain(gain) < least:
                return size
        search.grow(size + 1)
        if not search.of_size(size + 1):
            return size
        if not _pays(search, floor, size + 1, by_chance):
            return size
        size += 1
    return size


def _by_chance_beside(
    search: Search, fitted: Fitted[EffectSet], floor: Floor, rng: np.random.Generator
) -> float:
    """Return what one more effect gains beside a set by chance.

    Of what a robot does by chance where something changed, repeats of other commands tell little.
    """
    shared = search.problem.difference_counts.shared
    return chance_gains(search.problem, fitted, search.library, rng, floor.false_alarm, shared).threshold()


def _pays(search: Search, floor: Floor, size: int, by_chance: float) -> bool:
    """Return whether the best set of a size gains enough over the smaller ones, `by_chance` being nothing."""
    problem = search.problem
    inflation = _inflation(problem, floor, search.of_size(size)[0])
    larger, smaller = (_best(search, each, inflation) for each in (size, size - 1))
    residual = residue(problem, floor, search.base, smaller.fitted, larger.fitted)
    gain, least = (smaller.fitted.cost - larger.fitted.cost) / inflation, by_chance + residual / inflation
    if residual and least <= gain < _CLEARLY * least:
        smaller = scored(problem, _polished(search, floor, smaller.fitted), inflation)
        gain = (smaller.fitted.cost - larger.fitted.cost) / inflation
    # An effect that only takes back the harm that another one does on the validation runs is no finding.
    lowest = min(scored(problem, one, inflation).score for one in search.of_size(size - 1))
    if gain < least or larger.score > min(smaller.score, lowest) - THRESHOLDS.tie_sigmas**2:
        return False
    return not rises(problem, search.base, larger.fitted)


def _holds(search: Search, floor: Floor, chosen: ScoredSet, rng: np.random.Generator) -> bool:
    """Return whether each effect of a set is a finding; if not, a smaller set is.

    None may as well be none or do harm, and the last one must still pay: smaller sets may fit better by now
    than when it was added. So it must where the others move a robot (`sysid.gap.search.further`).
    """
    problem, size = search.problem, len(chosen.names)
    inflation = _inflation(problem, floor, search.best_fit)
    if doubtful(problem, chosen.fitted, inflation) or rises(problem, search.base, chosen.fitted):
        return False
    smaller = _best(search, size - 1, inflation).fitted
    by_chance = _by_chance_beside(search, smaller, floor, rng)
    if not _pays(search, floor, size, by_chance):
        return False
    return needed(search, floor, chosen.fitted, inflation, rng)


def _polished(search: Search, floor: Floor, fitted: Fitted[EffectSet]) -> Fitted[EffectSet]:
    """Return a fitted set, improved by `Search.polish` if it leaves more than a right model would."""
    return fitted if complete(search.problem, fitted, floor) else search.polish(fitted)


def _formula_residue(search: Search, fitted: Fitted[EffectSet], share: float) -> float:
    """Return the cost that the formulas of a set may leave of what they explain, `share` being the rms."""
    return share**2 * (search.base.cost - fitted.cost)


def _inflation(problem: ResidualProblem, floor: Floor, best: Fitted[EffectSet]) -> float:
    """Return the variance that is left, relative to what is expected: at least what other commands allow."""
    return max(floor.slack, best.cost / max(1, problem.size - best.candidate.parameter_count))


def _is_systematic(search: Search, fitted: Fitted[EffectSet]) -> bool:
    """Return whether every command sequence shows each effect of a set alike.

    The interval by their spread is so wide that of all effects that are considered one would miss "none" as
    seldom as a false alarm may happen (Bonferroni).
    """
    tried = len({response.effect for response in search.library})
    return agreed_on(search.problem, fitted, 1.0 - THRESHOLDS.false_alarm / max(1, tried))


def _best(search: Search, size: int, inflation: float) -> ScoredSet:
    """Return the set of a size that predicts each group best from the others, a harmless one if there is."""
    judged = [scored(search.problem, fitted, inflation) for fitted in search.of_size(size)]
    return min(judged, key=lambda j: (rises(search.problem, search.base, j.fitted), j.score, j.names))


def _law(problem: ResidualProblem, inflation: float) -> ScoredSet | None:
    rival = RefittedLaw(problem.base)
    found = fit(problem, rival, rival.start(), most=20)
    return None if found is None else scored(problem, found, inflation)


def _frequency(chosen: ScoredSet, judged: Sequence[ScoredSet], rng: np.random.Generator) -> dict[str, float]:
    """Return how often the cause of each effect is in the best set of resampled groups, in whatever form.

    A larger set counts as better only by more than a tie, as in the decision.
    """
    scores = np.array([j.scores for j in judged])
    penalty = THRESHOLDS.tie_sigmas**2 * np.array([len(j.names) for j in judged], float)
    picks = rng.integers(0, scores.shape[1], (THRESHOLDS.resamples, scores.shape[1]))
    totals = scores[:, picks].sum(axis=2) + penalty[:, None]
    winners = [judged[i].causes for i in np.argmin(totals, axis=0)]
    return {name: float(np.mean([cause_of(name) in winner for winner in winners])) for name in chosen.names}
