"""The experiment that separates tied candidate sets best, with commands like those of the logs.

A set of effects is dropped if its score is worse than the best one's by more than a limit L
(`sysid.gap.search.decision`). If a sequence puts truth and rival a squared distance S apart
(`sysid.gap.design.trial`), the difference of their scores grows by about N(S, 4 S). The truth, whose score is
now worse by g, remains as the only candidate with probability Phi(z),

    z = (S - g - L) / (2 sqrt(S)),    L = tie_sigmas^2 + formula_error^2 E,

where E is the sum of squares that the effects explain, in the logs so far and in the new ones. Sought is the
sequence with the largest z of the worst pair: a T-optimal design (Atkinson and Fedorov, Biometrika 62:57,
1975; for several models 62:289) for the limit of this decision.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import permutations
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.stats import norm

from mecanum_env.kinematics import POSE
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.design.limits import Limits
from sysid.gap.design.trial import (
    ExperimentConditions,
    JudgedSequence,
    Trial,
    Value,
    best_sequence,
    command_of,
)
from sysid.gap.result import Experiment
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.gap.wording import amount, listed, number, set_name, what_to_measure
from sysid.logs.runs import UNITS

_LEAST_Z: Final = -50.0
"""z of two identical predictions."""

Pairs = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Rival:
    """A candidate set of effects, as fitted to the logs so far."""

    names: tuple[str, ...]
    model: Model
    plausible: tuple[Model, ...] = ()
    """The model with its parameters one standard deviation off, along each axis of their covariance."""
    score: float = 0.0
    """Score on the logs so far; lower is better."""
    explained: float = 0.0
    """Sum of squares on the logs so far that it explains beyond what all candidates have in common."""


@dataclass(frozen=True)
class Design:
    """An experiment and what it is for, or why there is none."""

    experiment: Experiment | None
    why: str


def design_separating(
    base: Model,
    candidates: Sequence[Rival],
    conditions: ExperimentConditions,
    *,
    common: Model | None = None,
) -> Design:
    """Return the experiment that separates at least two candidates best.

    None if no command that the platform takes separates any with the probability `THRESHOLDS.least_power`.
    `common` is the base model with the effects that all candidates share; the base model by default.
    """
    names, count = tuple(c.names for c in candidates), len(candidates)
    without = base if common is None else common
    separable = np.zeros(count * (count - 1), bool)

    def judge(trial: Trial, thorough: bool) -> FloatArray | None:
        return separation(trial, without, candidates, thorough=thorough)

    def value_of(judged: Sequence[JudgedSequence]) -> Value | None:
        separable[:] = _separable(np.stack([one.z for one in judged]), count)
        return (lambda one: float(norm.isf(_failure(one.z, separable, count)))) if any(separable) else None

    best = best_sequence(base, conditions, judge, value_of)
    inseparable = _inseparable(names, separable, conditions)
    if best is None:
        only_slipping = (
            f"The predictions of {listed(map(set_name, names))} differ only on commands that make wheels "
            f"slip, where no model can be trusted: {what_to_measure(names, conditions.channels)}."
        )
        return Design(None, inseparable or only_slipping)
    why = " ".join(filter(None, (_difference(base, best.rows, candidates, conditions), inseparable)))
    least = power(best.z, separable, count)
    return Design(experiment_of(base, best.rows, candidates, conditions, names, least, why), why)


def separation(
    trial: Trial, common: Model, candidates: Sequence[Rival], *, thorough: bool
) -> FloatArray | None:
    """Return z of each ordered pair of truth and rival, shape (p,); None if a model cannot be predicted.

    Pairs are the `itertools.permutations` of the candidates; `common` is the base model with the effects that
    they all share. If `thorough`, differences that uncertain parameters could hide are taken off.
    """
    without = trial.whitened(common)
    if without is None or not trial.predictable(common, without):
        return None
    predictions = []
    for candidate in candidates:
        prediction = trial.whitened(candidate.model)
        if prediction is None or (thorough and not trial.predictable(candidate.model, prediction)):
            return None
        predictions.append(prediction)
    if thorough:
        of_base = without if common is trial.base else trial.whitened(trial.base)
        trial.add_law_columns(without if of_base is None else of_base)
    pairs = list(zip(predictions, candidates, strict=True))
    hidden = [trial.differences(p, c.plausible if thorough else ()) for p, c in pairs]
    explained = [c.explained + trial.squared_distance(p - without) for p, c in pairs]
    z = []
    for i, j in permutations(range(len(candidates)), 2):
        square = trial.squared_distance(predictions[i] - predictions[j], hidden[i], hidden[j])
        tolerance = THRESHOLDS.tie_sigmas**2 + trial.conditions.formula_error**2 * explained[i]
        needed = tolerance + candidates[i].score - candidates[j].score
        z.append(max(_LEAST_Z, (square - needed) / (2.0 * math.sqrt(max(square, 1e-9)))))
    return np.array(z)


def power(z: FloatArray, separable: Pairs, count: int) -> float:
    """Return a lower bound of the probability that the truth, whichever it is, remains alone.

    `z` (p,) is from `separation`, `separable` (p,) says which pairs of the `count` candidates matter.
    """
    return 1.0 - _failure(z, separable, count)


def _failure(z: FloatArray, separable: Pairs, count: int) -> float:
    """Return an upper bound of the probability that a rival of the truth remains.

    Each pair fails with probability 1 - Phi(z); all rivals of a truth together with at most the sum of these.
    """
    failure = np.where(separable, norm.sf(z), 0.0)
    # The pairs of one truth follow each other.
    return float(min(1.0, np.max(failure.reshape(count, count - 1).sum(axis=1))))


def experiment_of(
    base: Model,
    rows: FloatArray,
    drawn: Sequence[Rival],
    conditions: ExperimentConditions,
    candidates: tuple[tuple[str, ...], ...],
    least_power: float,
    why: str,
) -> Experiment:
    """Return the record of an experiment.

    Args:
        base: the model under study.
        rows: the command sequence.
        drawn: candidates whose predictions are drawn.
        conditions: how it will be recorded.
        candidates: names of the sets that it separates; none if it shows effects that the logs could not.
        least_power: its power, or a lower bound.
        why: what it is for.
    """
    trial = Trial(base, rows, conditions)
    predicted = {set_name(rival.names): trial.predict(rival.model) for rival in drawn}
    period = conditions.limits.period_s
    return Experiment(
        why=why,
        candidates=candidates,
        time_s=np.round(np.arange(len(rows)) * period, 9),
        columns=command_of(rows, conditions).columns(),
        duration_s=round(len(rows) * period, 9),
        power=least_power,
        predicted={name: values for name, values in predicted.items() if values is not None},
        predicted_time_s=trial.run.time_s,
    )


def _separable(z: FloatArray, count: int) -> Pairs:
    """Return which ordered pairs one of m sequences, with z (m, p), can be asked to separate.

    These are as many as it separates all together with the probability that is wanted, in either order; the
    pairs that are hardest to separate are given up first.
    """
    pairs = list(permutations(range(count), 2))
    best = np.max(z, axis=0)
    ease = np.minimum(best, best[[pairs.index((j, i)) for i, j in pairs]])
    for least in np.unique(ease):
        separable = ease >= least
        if max(power(one, separable, count) for one in z) >= THRESHOLDS.least_power:
            return np.asarray(separable)
    return np.zeros(len(pairs), bool)


def _inseparable(names: Sequence[tuple[str, ...]], separable: Pairs, conditions: ExperimentConditions) -> str:
    """Return which candidates no command separates and what would; empty if there are none."""
    groups: list[set[int]] = []
    for (i, j), told in zip(permutations(range(len(names)), 2), separable, strict=True):
        if not told:
            joined = [group for group in groups if group & {i, j}]
            groups = [group for group in groups if not group & {i, j}]
            groups.append({i, j}.union(*joined))
    sentences = []
    for group in groups:
        sets = [names[i] for i in sorted(group)]
        sentences.append(
            f"{no_command(conditions.limits)} tells {listed(map(set_name, sets), 'or')} apart by "
            f"{listed(conditions.channels)} with a probability of {THRESHOLDS.least_power:.0%}: "
            f"{what_to_measure(sets, conditions.channels)}."
        )
    return " ".join(sentences)


def no_command(limits: Limits) -> str:
    """Return the beginning of a sentence on what no command that a platform is known to take does."""
    largest = f"up to {number(limits.limit_rpm)} rpm"
    if limits.level == "robot":
        largest = f"V up to {number(limits.v_rpm)} rpm, VC up to {number(limits.vc_rpm)} rpm"
    return (
        f"No command like those of the logs ({largest}, each held for {number(limits.period_s)} s or longer)"
    )


def _difference(
    base: Model, rows: FloatArray, candidates: Sequence[Rival], conditions: ExperimentConditions
) -> str:
    """Return in which channel the candidates' predictions differ most, relative to its noise."""
    trial = Trial(base, rows, conditions)
    predicted = [p for p in (trial.predict(c.model) for c in candidates) if p is not None]
    sigma = conditions.noise.sigma
    # A difference of poses is the sum of all earlier ones: it is quoted only if nothing else is measured.
    channels = [name for name in conditions.channels if name not in POSE] or conditions.channels
    spread = {name: float(np.max(np.ptp([p[name] for p in predicted], axis=0))) for name in channels}
    name = max(spread, key=lambda channel: spread[channel] / sigma[channel])
    which = listed(set_name(c.names) for c in candidates)
    return (
        f"On these commands the predictions of {which} differ by up to {amount(spread[name], UNITS[name])} "
        f"in {name}, where the noise is {amount(sigma[name], UNITS[name])}."
    )
