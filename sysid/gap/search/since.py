"""Whether an effect is new since the model was fitted: a comparison with the logs of the fit.

Two things are no new effects. A model may fit the logs of its fit and predict others badly, because these did
not determine it: then one model of the same kind, fitted to both, leaves no gap. And an effect that the fit
left out is in the logs of the fit, too: these then also fit better with it than without it, whatever the law.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model
from sysid.compare.coordinates import effect_set
from sysid.compare.fitted import RefittedLaw, fit
from sysid.compare.joint import LawWithEffects
from sysid.compare.learned import Learned
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.prediction import Study
from sysid.compare.problem import ResidualProblem
from sysid.compare.subset import select_runs
from sysid.compare.whitening import Whitener
from sysid.gap.result import Since
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.thresholds import EFFORT, THRESHOLDS
from sysid.logs import Dataset, Run


def since_of(learned: Learned, model: Model, chosen: ScoredSet) -> Since:
    """Return whether the effects of a set were there already when the `model` was fitted."""
    with_it = chosen.fitted.candidate.model(model, chosen.fitted.place)
    without, there = (_best_cost(learned, one) for one in (model, with_it))
    if without is None or there is None:
        return "unknown"
    needed = THRESHOLDS.tie_sigmas**2
    if there < without - needed:
        return "already there"
    return "new" if there > without + needed else "unknown"


def _best_cost(learned: Learned, model: Model) -> float | None:
    """Return the cost of a model in the logs of the fit, with its law fitted again."""
    problem = ResidualProblem(
        model, learned.whitener, learned.simulators.full.study, learned.simulators, learned.before()
    )
    rival = RefittedLaw(model)
    found = fit(problem, rival, rival.start(), most=8)
    return None if found is None else found.cost


def fitted_to_both(
    model: Model, learned: Learned, fitted_on: Dataset, runs: Sequence[Run], study: Study
) -> Model | None:
    """Return the model with its law and effects fitted to the logs of its fit and to `runs` together.

    None if that fits the logs of its fit worse than the model does.
    """
    seconds = EFFORT[fitted_on.level].log_s
    before = select_runs(
        fitted_on.split("fit") + fitted_on.split("validation"), seconds, model.wheel.command_period_s
    )
    both = [replace(run, group=f"fit: {run.group}", file=f"fit: {run.file}") for run in before]
    dataset = replace(fitted_on, runs=(*both, *runs), sha256="")
    observations = observe(dataset)
    whitener = Whitener(observations, measure_noise(dataset, observations), learned.error)
    alone = replace(model, uncertainty={})
    problem = ResidualProblem(alone, whitener, study)
    names = [name for name in model.effects if name in CATALOGUE and CATALOGUE[name].acts_in("bench")]
    candidate = LawWithEffects(RefittedLaw(alone), effect_set(alone, names, scale=problem.study.scale))
    found = fit(problem, candidate, candidate.start(), most=20)
    if found is None:
        return None
    common: Model = candidate.model(model, found.place)
    costs = [_cost(learned, one) for one in (model, common)]
    if costs[0] is None or costs[1] is None or costs[1] > costs[0] + THRESHOLDS.tie_sigmas**2:
        return None
    return common


def _cost(learned: Learned, model: Model) -> float | None:
    problem = ResidualProblem(
        learned.model, learned.whitener, learned.simulators.full.study, learned.simulators, learned.before()
    )
    residual = problem.residual(model)
    if residual is None:
        return None
    marginal = problem.marginal(residual)
    return float(marginal @ marginal)
