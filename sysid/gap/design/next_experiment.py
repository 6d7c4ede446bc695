"""What a study asks for next: an experiment to settle its decision, or to show what its logs could not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE, Effect, PlantKind
from mecanum_env.effects.scale import Scale
from mecanum_env.kinematics import POSE
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import Fitted, ResidualProblem
from sysid.compare.measured import Observations
from sysid.compare.search_space import coordinate
from sysid.gap.design.experiment import Design, Rival, design_separating, experiment_of, no_command
from sysid.gap.design.limits import limits_of
from sysid.gap.design.trial import (
    CommandKind,
    ExperimentConditions,
    JudgedSequence,
    Trial,
    Value,
    best_sequence,
)
from sysid.gap.result import Untestable
from sysid.gap.search.decision import Decision
from sysid.gap.search.scores import ScoredSet
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.wording import listed, set_name
from sysid.logs import BenchCommand, BodyCommand, Run
from sysid.logs.runs import Level

_TYPICAL: Final = 0.3
"""Size of an effect that should show, as a share of the way from its neutral value to the farther bound."""
_MOST_UNTESTABLE: Final[dict[Level, int]] = {"bench": 8, "robot": 4}
"""Effects that one experiment is designed for, the first in the chain: each costs simulations."""
_MOST_CANDIDATES: Final[dict[Level, int]] = {"bench": 6, "robot": 4}
"""Candidates that one experiment is designed for, those of best score: each costs simulations."""


def design_next_experiment(
    problem: ResidualProblem,
    runs: Sequence[Run],
    decision: Decision,
    improved: Model,
    untestable: Sequence[Untestable],
    threshold: float,
) -> Design:
    """Return the experiment that separates tied candidates or, without a gap, shows what the logs could not.

    Args:
        problem: what the study decided on.
        runs: all runs of the logs: the experiment stays within their commands.
        decision: the verdict.
        improved: the model with the effects found.
        untestable: effects that the logs could not show.
        threshold: fall of the cost that counts as seen.
    """
    if decision.verdict not in ("ambiguous", "no_gap"):
        return Design(None, "")
    conditions = conditions_of(problem, runs, decision.facts.inflation)
    if decision.verdict == "ambiguous":
        return _separating(problem.base, decision, conditions)
    # No command shows an effect that follows a column which was not logged, or did not change.
    names = [effect.name for effect in untestable if not CATALOGUE[effect.name].reads]
    return design_for_untestable(improved, names, conditions, threshold)


def design_for_untestable(
    model: Model, effects: Sequence[str], conditions: ExperimentConditions, threshold: float
) -> Design:
    """Return the experiment on which as many of the effects as possible would show, if they were there.

    An effect shows if it lowers the cost by more than a `threshold`.
    """
    settings, level = conditions.settings, conditions.level
    plant: PlantKind = "bench" if level == "bench" else settings.plant
    acting = [CATALOGUE[name] for name in effects if CATALOGUE[name].acts_in(plant)]
    rivals = [_typical(model, effect, settings.scale) for effect in acting[: _MOST_UNTESTABLE[level]]]
    if not rivals:
        return Design(None, "")
    visible: list[int] = []

    def judge(trial: Trial, thorough: bool) -> FloatArray | None:
        return _visibility(trial, rivals, threshold, thorough=thorough)

    def value_of(judged: Sequence[JudgedSequence]) -> Value | None:
        best_z = np.max([one.z for one in judged], axis=0)
        visible[:] = np.flatnonzero(best_z >= norm.ppf(THRESHOLDS.least_power)).tolist()
        return (lambda one: float(norm.ppf(np.mean(norm.cdf(one.z[visible]))))) if visible else None

    best = best_sequence(model, conditions, judge, value_of)
    least_z = norm.ppf(THRESHOLDS.least_power)
    seen = [] if best is None else [i for i in visible if best.z[i] >= least_z]
    if best is None or not seen:
        which = listed((rival.names[0] for rival in rivals), "or")
        return Design(None, f"{no_command(conditions.limits)} would show {which} here.")
    which = listed(rivals[i].names[0] for i in seen)
    why = f"These logs could not show {which}; these commands would, were they there in a size to matter."
    drawn = [Rival((), model), *(rivals[i] for i in seen)]
    power = float(norm.cdf(min(best.z[i] for i in seen)))
    return Design(experiment_of(model, best.rows, drawn, conditions, (), power, why), why)


def _visibility(
    trial: Trial, rivals: Sequence[Rival], threshold: float, *, thorough: bool
) -> FloatArray | None:
    """Return z (p,) of each effect, which shows with probability Phi(z); None if the model is unpredictable.

    `rivals` are the model with each of the effects, which show if they lower the cost by a `threshold`. If
    `thorough`, differences that uncertain parameters could hide are taken off, and an effect whose prediction
    depends on details does not show.
    """
    without = trial.whitened(trial.base)
    if without is None or not trial.predictable(trial.base, without):
        return None
    if thorough:
        trial.add_law_columns(without)
    z = []
    for rival in rivals:
        prediction, square = trial.whitened(rival.model), 0.0
        if prediction is not None and (not thorough or trial.predictable(rival.model, prediction)):
            square = trial.squared_distance(prediction - without)
        z.append(math.sqrt(square) - math.sqrt(threshold))
    return np.array(z)


def _typical(model: Model, effect: Effect, scale: Scale) -> Rival:
    """Return the model with an effect of a size that a user would care about."""
    values = dict(model.effects.get(effect.name, {}))
    for parameter in effect.parameters:
        if parameter.neutral is None:
            continue
        one = coordinate(model, effect, parameter, scale)
        neutral = one.unit(one.neutral) if math.isfinite(one.neutral) else 1.0
        place = neutral + _TYPICAL * (1.0 - neutral if neutral < 0.5 else -neutral)
        values[parameter.name] = one.value(place)
    return Rival((effect.name,), model.with_effect(effect.name, **values))


def _separating(base: Model, decision: Decision, conditions: ExperimentConditions) -> Design:
    tied = decision.candidates[: _MOST_CANDIDATES[conditions.level]]
    shared = [name for name in tied[0].names if all(name in judged.names for judged in tied)]
    common = base
    if shared:
        best = tied[0].fitted.candidate.model(base, tied[0].fitted.place)
        kept = {n: v for n, v in best.effects.items() if n in shared or n in base.effects}
        common = replace(best, effects=kept)
    without = min(j.fitted.cost for j in decision.facts.judged if set(j.names) == set(shared) or not j.names)
    rivals = [_rival(base, judged, without, decision.facts.inflation) for judged in tied]
    found = design_separating(base, rivals, conditions, common=common)
    others = [set_name(judged.names) for judged in decision.candidates[len(tied) :]]
    if found.experiment is None or not others:
        return found
    why = f"{found.why} {listed(others)} fit{'s' * (len(others) == 1)} as well and may remain."
    return Design(replace(found.experiment, why=why), why)


def _rival(base: Model, judged: ScoredSet, cost_without: float, inflation: float) -> Rival:
    fitted = judged.fitted
    explained = max(0.0, cost_without - fitted.cost) / inflation
    model = fitted.candidate.model(base, fitted.place)
    return Rival(judged.names, model, _plausible(base, fitted, inflation), judged.score, explained)


def _plausible(base: Model, fitted: Fitted[Any], inflation: float) -> tuple[Model, ...]:
    """Return the candidate one standard deviation off along each axis of its covariance, within bounds."""
    values, vectors = np.linalg.eigh(fitted.covariance(inflation))
    found = []
    for step in (np.sqrt(np.maximum(values, 0.0)) * vectors).T:
        ends = [np.clip(fitted.place + sign * step, 0.0, 1.0) for sign in (1.0, -1.0)]
        farther = max(ends, key=lambda end: float(np.linalg.norm(end - fitted.place)))
        found.append(fitted.candidate.model(base, farther))
    return tuple(found)


def conditions_of(problem: ResidualProblem, logs: Sequence[Run], inflation: float) -> ExperimentConditions:
    """Return conditions like those of the logs so far, simulated with the settings of the problem.

    `logs` are all runs, those of the test too, and `inflation` is the residual variance of the best fit
    relative to the expected one.
    """
    observations, whitener = problem.observations, problem.whitener
    runs = [run for situation in observations.situations for run in situation.runs]
    sigma = {
        name: value / math.sqrt(1.0 if name in POSE else _fresh_share(observations, name))
        for name, value in whitener.noise.sigma.items()
    }
    return ExperimentConditions(
        kind=_kind(runs[0]),
        channels=observations.channels,
        interval_s=float(np.median([run.median_interval_s for run in runs])),
        noise=replace(whitener.noise, sigma=sigma),
        error=whitener.error,
        limits=limits_of(problem.base, logs),
        inflation=inflation,
        settings=problem.settings,
        formula_error=THRESHOLDS.formula(beside_fit_of_robot=problem.knows_all),
    )


def _fresh_share(observations: Observations, channel: str) -> float:
    """Return the share of rows with a new sample of a channel: slow sensors repeat theirs."""
    blocks = [block for block in observations.blocks if block.channel == channel]
    rows = sum(run.time_s.size for b in blocks for run in observations.situations[b.situation].runs)
    return sum(float(block.weight.sum()) for block in blocks) / rows


def _kind(run: Run) -> CommandKind:
    if isinstance(run.command, BenchCommand):
        return "bench"
    return "body" if isinstance(run.command, BodyCommand) else "wheels"
