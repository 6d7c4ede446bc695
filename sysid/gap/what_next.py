"""What a study asks for next: from its decision to the experiment that would settle it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from mecanum_env.model import Model
from sysid.gap.decide import Decision
from sysid.gap.experiment import Design, Rival, design, level_of
from sysid.gap.fitted import Fitted
from sysid.gap.observations import Observations
from sysid.gap.problem import Problem
from sysid.gap.records import Untestable
from sysid.gap.scores import Judged
from sysid.gap.sequences import Limits
from sysid.gap.trial import CommandKind, Setting
from sysid.gap.untestable_experiment import design_for_untestable
from sysid.gap.verdict import listed, set_name
from sysid.logs import BenchCommand, BodyCommand, Run
from sysid.logs.records import Level
from sysid.prediction import POSE

_MOST: Final[dict[Level, int]] = {"bench": 6, "robot": 4}
"""Candidates that one experiment is designed for, the best ones: each costs simulations."""


def what_next(
    problem: Problem,
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
        scale=problem.scale,
        seed=seed,
        jobs=problem.jobs,
    )


def _separating(problem: Problem, decision: Decision, setting: Setting, limits: Limits, seed: int) -> Design:
    tied = decision.candidates[: _MOST[level_of(setting)]]
    base, shared = problem.base, [n for n in tied[0].names if all(n in judged.names for judged in tied)]
    common = base
    if shared:
        best = tied[0].fitted.candidate.model(base, tied[0].fitted.place)
        kept = {n: v for n, v in best.effects.items() if n in shared or n in base.effects}
        common = replace(best, effects=kept)
    without = min(j.fitted.cost for j in decision.judged if set(j.names) == set(shared) or not j.names)
    rivals = [_rival(base, judged, without, decision.inflation) for judged in tied]
    found = design(base, rivals, setting, limits, common=common, seed=seed, jobs=problem.jobs)
    left = [set_name(judged.names) for judged in decision.candidates[len(tied) :]]
    if found.experiment is None or not left:
        return found
    why = f"{found.why} {listed(left)} fit{'s' * (len(left) == 1)} as well and may remain."
    return Design(replace(found.experiment, why=why), why)


def _rival(base: Model, judged: Judged, without: float, inflation: float) -> Rival:
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


def _setting(problem: Problem, inflation: float) -> Setting:
    observations, whitener = problem.observations, problem.whitener
    runs = [run for situation in observations.situations for run in situation.runs]
    sigma = {
        name: value / math.sqrt(1.0 if name in POSE else _share(observations, name))
        for name, value in whitener.noise.sigma.items()
    }
    return Setting(
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
