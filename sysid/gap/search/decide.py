"""From fitted sets to a verdict: how many effects, which, what else would do, and is it enough.

1. Is there a gap? The best growth of the empty set, and the square sum itself, against what chance does.
2. How many effects? One more only if the square sum falls by more than the best of all effects would make
   it fall by chance, and each run is predicted better from the others (`sysid.gap.search.scores`).
3. Which? Every set of that size whose score is within `NEVER`^2 of the best is as good: if such a set is
   the truth, it is dropped with a probability below Phi(-NEVER), however far the predictions are apart.
   More is allowed where effects are large, since no formula is exact (4.).
4. Is it enough? What is left must be what chance allows, or small (`ENOUGH`) beside what the set explains:
   no formula is exact. And it must not raise the plain error on the validation runs.
5. Does it matter? A set that is sure but removes less than `MATTERS` of the squared difference above the
   noise is no better than the model's own error, and not worth a name.
6. The wheel law fitted again is a rival: where it does better than every set, no effect is missing but a fit.

All square sums are over `inflation`, what the best fit leaves over what is expected, at least 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from sysid.compare.fitted import Fitted, RefittedLaw, fit
from sysid.compare.problem import ResidualProblem
from sysid.gap.result import Verdict
from sysid.gap.search.adequacy import Floor, complete, enough, expected, misfit, rough
from sysid.gap.search.chance import FALSE_ALARM, NEVER, chance
from sysid.gap.search.coordinates import EffectSet
from sysid.gap.search.scores import FORMULA_ERROR, Mask, ScoredSet, doubtful, group_masks, group_scores, rises
from sysid.gap.search.sets import Search
from sysid.gap.search.ties import tied

VISIBLE: Final = 1.5
"""Square sum over expectation above which one more effect that leaves nothing counts in any case."""
MATTERS: Final = 0.1
"""Share of the squared difference above the noise that a set must remove to be named."""
FAR: Final = 4.0
"""Square sum over that of the noise that is no error of a model's own, even where none is stated."""
_SPARE: Final = (
    4.0  # a parameter within two standard deviations of neutral, and no worse without it, is left out
)
_RESAMPLES: Final = 500


@dataclass(frozen=True, eq=False)
class Decision:
    """The verdict and what it rests on."""

    verdict: Verdict
    chosen: ScoredSet | None
    """What is added to the model, if anything."""
    candidates: tuple[ScoredSet, ...]
    """As good as the chosen one, which comes first."""
    judged: tuple[ScoredSet, ...]
    """All sets that were fitted, the empty one too; best score first."""
    law: ScoredSet | None
    """The wheel law fitted again, where that was tried."""
    p_value: float
    inflation: float
    frequency: Mapping[str, float]
    """Effect of the chosen set -> share of resamples in which it is chosen."""
    notes: tuple[str, ...]


def decide(
    problem: ResidualProblem, search: Search, floor: Floor, most: int, rng: np.random.Generator
) -> Decision:
    """Search and decide; again, where it turns out that the logs' wheels started at other angles.

    Args:
        problem: the model and the runs that may be looked at.
        search: over the effects to consider; what it fits stays in it.
        floor: what is known of the noise.
        most: largest set.
        rng: of the simulated thresholds and the bootstrap.
    """
    found = _decide(problem, search, floor, most, rng)
    best = min(search.fitted.values(), key=lambda f: f.cost)
    if complete(problem, best, floor) or not problem.has_surrogate:
        return found
    model = best.candidate.model(problem.base, best.place)
    if not problem.update_angle_uncertainty(model, best.residual):
        return found
    again = _decide(problem, search, floor, most, rng)
    said = (
        "the wheels started at other angles than the simulated ones: what rollers do by chance is allowed for"
    )
    return replace(again, notes=(*again.notes, said))


def _decide(
    problem: ResidualProblem, search: Search, floor: Floor, most: int, rng: np.random.Generator
) -> Decision:
    masks = group_masks(problem)
    base = search.base
    by_chance = chance(base, search.library, rng, rough(problem, base))
    hope = max((base.cost - growth.expected for growth in search.growths(base)), default=0.0)
    if hope > 0.5 * by_chance.threshold():
        search.grow(1)
    best = min(search.fitted.values(), key=lambda f: f.cost)
    inflation = _inflation(problem, best)
    p_gain = by_chance.p_value((base.cost - best.cost) / inflation)
    p_misfit = misfit(problem, base, floor)
    p_value = min(1.0, 2.0 * min(p_gain, p_misfit))
    if p_value > FALSE_ALARM:
        judged = _judge(problem, search, masks, inflation)
        return Decision("no_gap", None, (), judged, None, p_value, inflation, {}, ())
    if not search.of_size(1):
        # What effects could gain is little, but the whole is more than chance allows.
        search.grow(1)
    if not search.of_size(1):
        judged = _judge(problem, search, masks, inflation)
        return Decision("unexplained", None, (), judged, None, p_value, inflation, {}, ())
    size = _grow(problem, search, masks, floor, most, rng)
    best = min(search.fitted.values(), key=lambda f: f.cost)
    inflation = _inflation(problem, best)
    chosen = _best(problem, search, size, masks, inflation)
    search.swap(chosen.fitted)
    _spare(problem, search, size, inflation)
    chosen = _best(problem, search, size, masks, inflation)
    while size > 1 and (doubtful(problem, chosen.fitted, inflation) or rises(problem, base, chosen.fitted)):
        # An effect that may as well be none, or that does harm, is no finding: the smaller set is.
        size -= 1
        chosen = _best(problem, search, size, masks, inflation)
    # Where nothing is left, no law can do better.
    done = complete(problem, chosen.fitted, floor)
    law = None if done else _law(problem, masks, inflation)
    judged = _judge(problem, search, masks, inflation)
    harmless = [j for j in judged if len(j.names) == size and not rises(problem, base, j.fitted)]
    alike = tied(search, chosen, harmless, inflation)
    frequency = _frequency(chosen, [j for j in judged if j.names], rng)
    notes: list[str] = []
    adequate = enough(problem, base, chosen.fitted, floor)
    removed = _removed(problem, base, chosen.fitted)
    apart = float(np.mean(problem.marginal_inverse(base.residual) ** 2)) > FAR
    if adequate and removed < MATTERS and apart and not floor.trusted:
        notes.append("model and measurement are far apart, and no set of effects removes a tenth of that")
        adequate = False
    if adequate and removed < MATTERS:
        notes.append(
            f"{' + '.join(chosen.names)} would be significant (p = {p_value:.2g}), but removes only "
            f"{max(removed, 0.0):.0%} of the difference above the noise: not told from the model's own error"
        )
        return Decision("no_gap", None, (), judged, law, p_value, inflation, {}, tuple(notes))
    if adequate and rises(problem, base, chosen.fitted):
        notes.append(
            f"{' + '.join(chosen.names)} would be significant (p = {p_value:.2g}), but raises the plain "
            "difference on the validation runs"
        )
        adequate = False
    if adequate and not floor.repeatable:
        notes.append(
            "repeats of one command differ far more than neighbouring samples: chance acts, not effects"
        )
        adequate = False
    if law is not None and law.score < chosen.score - NEVER**2:
        notes.append(
            "the wheel law fitted again explains these logs better than any set of effects: "
            "fit it anew (python -m sysid.fit) before looking for effects"
        )
        adequate = False
    unsure = doubtful(problem, chosen.fitted, inflation) if adequate else ()
    if unsure:
        notes.append(f"{' + '.join(unsure)}: the runs disagree about the size, which may as well be none")
        adequate = False
        if floor.trusted and p_misfit > FALSE_ALARM:
            return Decision("no_gap", None, (), judged, law, p_value, inflation, {}, tuple(notes))
    if not adequate:
        return Decision("unexplained", None, (), judged, law, p_value, inflation, {}, tuple(notes))
    verdict: Verdict = "ambiguous" if len(alike) > 1 else "named"
    return Decision(verdict, alike[0], alike, judged, law, p_value, inflation, frequency, tuple(notes))


def _inflation(problem: ResidualProblem, best: Fitted[Any]) -> float:
    freedom = max(1, problem.size - int(best.candidate.parameter_count))
    return max(1.0, best.cost / freedom)


def _grow(
    problem: ResidualProblem,
    search: Search,
    masks: Mapping[str, Mask],
    floor: Floor,
    most: int,
    rng: np.random.Generator,
) -> int:
    """Fit larger sets as long as one more effect pays; return the size that does."""
    size = 1
    while size < most:
        parent = _best(problem, search, size, masks, 1.0).fitted
        if not complete(problem, parent, floor):
            parent = search.polish(parent)
        nearest = search.of_size(size)[: search.effort.beam]
        promised = min((g.expected for p in nearest for g in search.growths(p)), default=parent.cost)
        inflation = max(1.0, promised / problem.size)
        needed = chance(parent, search.library, rng, rough(problem, parent)).threshold()
        if parent.cost - promised < needed * inflation:
            return size
        search.grow(size + 1)
        if not search.of_size(size + 1):
            return size
        inflation = _inflation(problem, search.of_size(size + 1)[0])
        larger = _best(problem, search, size + 1, masks, inflation)
        smaller = _best(problem, search, size, masks, inflation)
        gain = (smaller.fitted.cost - larger.fitted.cost) / inflation
        visible = smaller.fitted.cost > VISIBLE * expected(problem, smaller.fitted)
        if not (visible and complete(problem, larger.fitted, floor)):
            # What a formula that is right to so much leaves may look like one more effect.
            needed += FORMULA_ERROR**2 * (search.base.cost - smaller.fitted.cost) / inflation
        if gain < needed or larger.score > smaller.score - NEVER**2:
            return size
        if rises(problem, search.base, larger.fitted):
            return size
        size += 1
    return size


def _best(
    problem: ResidualProblem, search: Search, size: int, masks: Mapping[str, Mask], inflation: float
) -> ScoredSet:
    """Return the set of a size that predicts each group best from the others, a harmless one if there is."""
    judged = [_with_scores(problem, f, masks, inflation) for f in search.of_size(size)]
    return min(judged, key=lambda j: (rises(problem, search.base, j.fitted), j.score, j.names))


def _judge(
    problem: ResidualProblem, search: Search, masks: Mapping[str, Mask], inflation: float
) -> tuple[ScoredSet, ...]:
    judged = [_with_scores(problem, f, masks, inflation) for f in search.fitted.values()]
    return tuple(sorted(judged, key=lambda j: (j.score, j.names)))


def _with_scores(
    problem: ResidualProblem, fitted: Fitted[Any], masks: Mapping[str, Mask], inflation: float
) -> ScoredSet:
    return ScoredSet(fitted, group_scores(problem, fitted, masks, inflation))


def _spare(problem: ResidualProblem, search: Search, size: int, inflation: float) -> None:
    """Leave out the parameters that the best sets do not need."""
    near = search.of_size(size)
    limit = near[0].cost + 4.0 * NEVER**2 * inflation
    for fitted in [f for f in near if f.cost <= limit]:
        smaller = _spared(problem, fitted, inflation)
        del search.fitted[fitted.names, fitted.candidate.integral]
        key = smaller.names, smaller.candidate.integral
        if key not in search.fitted or smaller.cost < search.fitted[key].cost:
            search.fitted[key] = smaller


def _spared(problem: ResidualProblem, fitted: Fitted[EffectSet], inflation: float) -> Fitted[EffectSet]:
    while True:
        candidate, spread = fitted.candidate, np.sqrt(np.diag(fitted.covariance(inflation)))
        far = np.abs(fitted.place - candidate.start()) / np.maximum(spread, 1e-12)
        for index in np.argsort(far):
            effect = candidate.coordinates[index].effect
            others = sum(c.effect == effect for c in candidate.coordinates)
            if (effect and others < 2) or far[index] ** 2 > _SPARE:
                continue
            smaller = candidate.without(int(index))
            found = fit(problem, smaller, np.delete(fitted.place, index))
            if found is not None and found.cost <= fitted.cost + _SPARE * inflation:
                fitted = found
                break
        else:
            return fitted


def _law(problem: ResidualProblem, masks: Mapping[str, Mask], inflation: float) -> ScoredSet | None:
    rival = RefittedLaw(problem.base)
    found = fit(problem, rival, rival.start(), most=20)
    return None if found is None else _with_scores(problem, found, masks, inflation)


def _removed(problem: ResidualProblem, base: Fitted[Any], chosen: Fitted[Any]) -> float:
    """Return the share of the squared difference above the noise that a set removes, sample by sample."""
    noise = problem.whitener.noise.sigma
    blocks = problem.observations.blocks

    def above(fitted: Fitted[Any]) -> float:
        parts = problem.whitener.unwhiten(problem.marginal_inverse(fitted.residual))
        squares = [
            float(b.weight @ part**2) / noise[b.channel] ** 2 for b, part in zip(blocks, parts, strict=True)
        ]
        return sum(squares) - problem.size

    before = above(base)
    return (before - above(chosen)) / before if before > 0.0 else 0.0


def _frequency(chosen: ScoredSet, judged: Sequence[ScoredSet], rng: np.random.Generator) -> dict[str, float]:
    """Return how often each effect is in the best set of resampled groups.

    A larger set counts as better only by more than `NEVER`^2, as in the decision.
    """
    scores = np.array([j.scores for j in judged])
    penalty = NEVER**2 * np.array([len(j.names) for j in judged], float)
    picks = rng.integers(0, scores.shape[1], (_RESAMPLES, scores.shape[1]))
    totals = scores[:, picks].sum(axis=2) + penalty[:, None]
    winners = [judged[i].names for i in np.argmin(totals, axis=0)]
    return {name: float(np.mean([name in winner for winner in winners])) for name in chosen.names}
