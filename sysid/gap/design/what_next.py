"""The experiment that shows as many as can be of the effects that the logs so far could not.

What a study asks for next: from its decision to the experiment that would settle it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE, Effect, PlantKind
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.fitted import Fitted
from sysid.compare.observations import Observations
from sysid.compare.prediction import POSE
from sysid.compare.problem import ResidualProblem
from sysid.gap.design.experiment import Design, Rival, design, experiment_of, level_of
from sysid.gap.design.sequences import Limits
from sysid.gap.design.trial import (
    EFFORT,
    CommandKind,
    ExperimentConditions,
    JudgedSequence,
    Trial,
    Worth,
    search,
)
from sysid.gap.report.wording import listed, set_name
from sysid.gap.result import Untestable
from sysid.gap.search.coordinates import coordinate
from sysid.gap.search.decision import Decision
from sysid.gap.search.scores import ScoredSet
from sysid.logs import BenchCommand, BodyCommand, Run
from sysid.logs.runs import Level

_TYPICAL: Final = 0.3
"""Size that should show, as the part of the way from neutral to the further bound of a search."""
_MOST_UNTESTABLE: Final[dict[Level, int]] = {"bench": 8, "robot": 4}
"""Effects that one experiment is designed for, the first in the chain: each costs simulations."""
_LEAST_POWER: Final = 0.5
"""With which an effect must show to be worth an experiment."""


def design_for_untestable(
    model: Model,
    effects: Sequence[str],
    setting: ExperimentConditions,
    limits: Limits,
    *,
    threshold: float,
    scale: float = 1.0,
    seed: int = 0,
    jobs: int = 1,
) -> Design:
    """Return the experiment on which most of some effects, were they there, would be expected to show.

    Args:
        model: with what was found.
        effects: names of those that the logs could not show.
        setting: how the experiment will be recorded.
        limits: of the robot.
        threshold: gain of square sum that counts as seen.
        scale: of bounds in rpm and rpm/s, from `sysid.compare.study`.
        seed: of the random sequences and changes.
        jobs: sequences simulated at a time; changes the time taken, not the result.
    """
    plant: PlantKind = "bench" if setting.kind == "bench" else "rollers"
    there = [CATALOGUE[name] for name in effects if CATALOGUE[name].acts_in(plant)]
    rivals = [_typical(model, effect, scale) for effect in there[: _MOST_UNTESTABLE[level_of(setting)]]]
    if not rivals:
        return Design(None, "")
    shown: list[int] = []

    def judge(rows: FloatArray, thorough: bool) -> JudgedSequence | None:
        z = visibility(Trial(model, rows, setting, rough=not thorough), rivals, threshold, thorough=thorough)
        return None if z is None else JudgedSequence(rows, z)

    def worth_of(found: Sequence[JudgedSequence]) -> Worth | None:
        best = np.max([j.z for j in found], axis=0)
        shown[:] = np.flatnonzero(best >= norm.ppf(_LEAST_POWER)).tolist()
        return (lambda j: float(norm.ppf(np.mean(norm.cdf(j.z[shown]))))) if shown else None

    best = search(limits, judge, worth_of, EFFORT[level_of(setting)], seed=seed, jobs=jobs)
    if best is None:
        which = listed([rival.names[0] for rival in rivals], "or")
        return Design(None, f"No command within the robot's limits would show {which} here.")
    seen = [i for i in shown if best.z[i] >= norm.ppf(_LEAST_POWER)]
    which = listed([rivals[i].names[0] for i in seen])
    why = f"These logs could not show {which}; these commands would, were they there in a size to matter."
    drawn = [Rival((), model), *(rivals[i] for i in seen)]
    power = float(norm.cdf(min(best.z[i] for i in seen)))
    return Design(experiment_of(model, best.rows, drawn, setting, (), power, why), why)


def visibility(
    trial: Trial, rivals: Sequence[Rival], threshold: float, *, thorough: bool
) -> FloatArray | None:
    """Return z (p,) for each effect, which shows with probability Phi(z); None if nothing can be predicted.

    An effect that cannot be predicted does not show.

    Args:
        trial: of the sequence.
        rivals: the model with each effect.
        threshold: gain of square sum that counts as seen.
        thorough: whether what the law's own parameters could hide is taken off.
    """
    without = trial.whitened(trial.base)
    if without is None or not trial.predictable(trial.base, without):
        return None
    if thorough:
        trial.with_law(without)
    z = []
    for rival in rivals:
        shown = trial.whitened(rival.model)
        hidden = shown is None or (thorough and not trial.predictable(rival.model, shown))
        square = 0.0 if shown is None or hidden else trial.square(shown - without)
        z.append(math.sqrt(square) - math.sqrt(threshold))
    return np.array(z)


def _typical(model: Model, effect: Effect, scale: float) -> Rival:
    """Return the model with an effect of a size that a user would care about."""
    values = dict(model.effects.get(effect.name, {}))
    for parameter in effect.parameters:
        if not parameter.simulated or parameter.neutral is None:
            continue
        one = coordinate(model, effect, parameter, scale)
        neutral = one.unit(one.neutral) if math.isfinite(one.neutral) else 1.0
        place = neutral + _TYPICAL * (1.0 - neutral if neutral < 0.5 else -neutral)
        values[parameter.name] = one.value(place)
    return Rival((effect.name,), model.with_effect(effect.name, **values))


_MOST: Final[dict[Level, int]] = {"bench": 6, "robot": 4}
"""Candidates that one experiment is designed for, the best ones: each costs simulations."""


def what_next(
    problem: ResidualProblem,
    decision: Decision,
    improved: Model,
    untestable: Sequence[Untestable],
    threshold: float,
    *,
    seed: int = 0,
) -> Design:
    """Return the experiment that tells tied candidates apart, or else shows what the logs could not.

    Args:
        problem: the model and the logs.
        decision: as taken.
        improved: the model with what was found.
        untestable: effects that the logs could not show.
        threshold: gain of square sum that counts as seen.
        seed: of the search.
    """
    setting = _setting(problem, decision.inflation)
    limits = _limits(problem.base, problem.observations)
    if decision.verdict == "ambiguous":
        return _separating(problem, decision, setting, limits, seed)
    names = [effect.name for effect in untestable] if decision.verdict in ("named", "no_gap") else []
    return design_for_untestable(
        improved,
        names,
        setting,
        limits,
        threshold=threshold,
        scale=problem.study.scale,
        seed=seed,
        jobs=problem.study.jobs,
    )


def _separating(
    problem: ResidualProblem, decision: Decision, setting: ExperimentConditions, limits: Limits, seed: int
) -> Design:
    tied = decision.candidates[: _MOST[level_of(setting)]]
    base, shared = problem.base, [n for n in tied[0].names if all(n in judged.names for judged in tied)]
    common = base
    if shared:
        best = tied[0].fitted.candidate.model(base, tied[0].fitted.place)
        kept = {n: v for n, v in best.effects.items() if n in shared or n in base.effects}
        common = replace(best, effects=kept)
    without = min(j.fitted.cost for j in decision.judged if set(j.names) == set(shared) or not j.names)
    rivals = [_rival(base, judged, without, decision.inflation) for judged in tied]
    found = design(base, rivals, setting, limits, common=common, seed=seed, jobs=problem.study.jobs)
    left = [set_name(judged.names) for judged in decision.candidates[len(tied) :]]
    if found.experiment is None or not left:
        return found
    why = f"{found.why} {listed(left)} fit{'s' * (len(left) == 1)} as well and may remain."
    return Design(replace(found.experiment, why=why), why)


def _rival(base: Model, judged: ScoredSet, without: float, inflation: float) -> Rival:
    fitted = judged.fitted
    explained = max(0.0, without - fitted.cost) / inflation
    model = fitted.candidate.model(base, fitted.place)
    return Rival(judged.names, model, _plausible(base, fitted, inflation), judged.score, explained)


def _plausible(base: Model, fitted: Fitted[Any], inflation: float) -> tuple[Model, ...]:
    """Return the candidate one standard deviation off along each axis of its covariance, in bounds."""
    values, vectors = np.linalg.eigh(fitted.covariance(inflation))
    found = []
    for step in (np.sqrt(np.maximum(values, 0.0)) * vectors).T:
        ways = [np.clip(fitted.place + sign * step, 0.0, 1.0) for sign in (1.0, -1.0)]
        place = max(ways, key=lambda way: float(np.linalg.norm(way - fitted.place)))
        found.append(fitted.candidate.model(base, place))
    return tuple(found)


def _setting(problem: ResidualProblem, inflation: float) -> ExperimentConditions:
    observations, whitener = problem.observations, problem.whitener
    runs = [run for situation in observations.situations for run in situation.runs]
    sigma = {
        name: value / math.sqrt(1.0 if name in POSE else _share(observations, name))
        for name, value in whitener.noise.sigma.items()
    }
    return ExperimentConditions(
        kind=_kind(runs[0]),
        channels=observations.channels,
        interval_s=float(np.median([run.median_interval_s for run in runs])),
        noise=replace(whitener.noise, sigma=sigma),
        error=whitener.error,
        inflation=inflation,
    )


def _share(observations: Observations, channel: str) -> float:
    """Return the part of the rows that hold a new sample of a channel: slow sensors repeat theirs."""
    blocks = [block for block in observations.blocks if block.channel == channel]
    rows = sum(run.time_s.size for b in blocks for run in observations.situations[b.situation].runs)
    return sum(float(block.weight.sum()) for block in blocks) / rows


def _kind(run: Run) -> CommandKind:
    if isinstance(run.command, BenchCommand):
        return "bench"
    return "body" if isinstance(run.command, BodyCommand) else "wheels"


def _limits(model: Model, observations: Observations) -> Limits:
    limit = model.wheel.saturation_rpm
    runs = [situation.runs[0] for situation in observations.situations]
    if not math.isfinite(limit):
        # Nothing says what the robot takes but what it was given.
        limit = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in runs)
    geometry = None if runs[0].level == "bench" else model.robot
    return Limits(limit, model.wheel.command_quantum_rpm, model.wheel.command_period_s, geometry)
