"""The next experiment: the command sequence that separates tied candidates best, within the robot's limits.

A set of effects is dropped when its score is worse than the best one's by more than a limit L
(`sysid.gap.search.decision`). Where a sequence puts truth and rival a squared distance S apart
(`sysid.gap.design.trial`), their scores come to differ by about N(S, 4 S) more than they do now:
the truth, now g behind, is left alone with probability Phi(z),

    z = (S - g - L) / (2 sqrt(S)),    L = tie_sigmas^2 + formula_error^2 E,

E being what the effects explain, in the logs so far and in the new ones. The sequence of the largest z of the
worst pair is sought: a T-optimal design (Atkinson and Fedorov, Biometrika 62:57, 1975; for several models
62:289) against the limit of this decision. What refitting could hide is no distance.
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

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.prediction import POSE
from sysid.gap.design.direct_checks import what_to_measure
from sysid.gap.design.sequences import Limits
from sysid.gap.design.trial import (
    EFFORT,
    ExperimentConditions,
    JudgedSequence,
    Trial,
    Worth,
    command_of,
    search,
)
from sysid.gap.report.wording import amount, listed, set_name
from sysid.gap.result import Experiment
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.logs.runs import UNITS, Level

_LEAST_POWER: Final = 0.1
"""A pair that no sequence separates with this probability counts as one that no command separates."""
_NEVER_TOLD: Final = -50.0
"""z of predictions that are one."""

Pairs = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Rival:
    """A candidate, as fitted to the logs so far."""

    names: tuple[str, ...]
    model: Model
    plausible: tuple[Model, ...] = ()
    """The same with its parameters one standard deviation off, along each axis of their covariance."""
    score: float = 0.0
    """On the logs so far; lower is better."""
    explained: float = 0.0
    """Square sum on the logs so far that it explains beyond what all candidates have in common."""


@dataclass(frozen=True)
class Design:
    """An experiment, or none, and why."""

    experiment: Experiment | None
    why: str


def design(
    base: Model,
    candidates: Sequence[Rival],
    setting: ExperimentConditions,
    limits: Limits,
    *,
    common: Model | None = None,
    seed: int = 0,
    jobs: int = 1,
) -> Design:
    """Return the experiment that tells candidates apart best; none where no command can.

    Args:
        base: the model under study.
        candidates: at least two.
        setting: how the experiment will be recorded.
        limits: of the robot.
        common: the base model with what all candidates share; the base model itself by default.
        seed: of the random sequences and changes.
        jobs: sequences simulated at a time; changes the time taken, not the result.
    """
    shared = base if common is None else common
    told = np.zeros(len(candidates) * (len(candidates) - 1), bool)

    def judge(rows: FloatArray, thorough: bool) -> JudgedSequence | None:
        trial = Trial(base, rows, setting, rough=not thorough)
        z = separation(trial, shared, candidates, thorough=thorough)
        return None if z is None else JudgedSequence(rows, z)

    def worth_of(found: Sequence[JudgedSequence]) -> Worth | None:
        told[:] = _told(np.max([j.z for j in found], axis=0), len(candidates))
        return (lambda j: float(np.min(j.z[told]))) if np.any(told) else None

    best = search(limits, judge, worth_of, EFFORT[level_of(setting)], seed=seed, jobs=jobs)
    tied = _tied([c.names for c in candidates], told, setting)
    if best is None:
        return Design(None, tied or _only_spinning([c.names for c in candidates], setting))
    why = " ".join(filter(None, (_separates(base, best.rows, candidates, setting), tied)))
    names = tuple(c.names for c in candidates)
    chance = power(best.z, told, len(candidates))
    return Design(experiment_of(base, best.rows, candidates, setting, names, chance, why), why)


def separation(
    trial: Trial, common: Model, candidates: Sequence[Rival], *, thorough: bool
) -> FloatArray | None:
    """Return z (p,) for each ordered pair of truth and rival; None where one is not predictable.

    Args:
        trial: of the sequence.
        common: the base model with what all candidates share.
        candidates: the pairs are `itertools.permutations` of them.
        thorough: whether what the law's and the candidates' own parameters could hide is taken off.
    """
    without = trial.whitened(common)
    if without is None or not trial.predictable(common, without):
        return None
    shown = []
    for candidate in candidates:
        prediction = trial.whitened(candidate.model)
        if prediction is None or (thorough and not trial.predictable(candidate.model, prediction)):
            return None
        shown.append(prediction)
    if thorough:
        own = without if common is trial.base else trial.whitened(trial.base)
        trial.with_law(without if own is None else own)
    moved = [
        trial.columns(p, c.plausible if thorough else ()) for p, c in zip(shown, candidates, strict=True)
    ]
    explained = [c.explained + trial.square(p - without) for p, c in zip(shown, candidates, strict=True)]
    z = []
    for i, j in permutations(range(len(candidates)), 2):
        square = trial.square(shown[i] - shown[j], moved[i], moved[j])
        tolerance = THRESHOLDS.tie_sigmas**2 + THRESHOLDS.formula_error**2 * explained[i]
        needed = tolerance + candidates[i].score - candidates[j].score
        z.append(max(_NEVER_TOLD, (square - needed) / (2.0 * math.sqrt(max(square, 1e-9)))))
    return np.array(z)


def power(z: FloatArray, told: Pairs, count: int) -> float:
    """Return at least how likely the truth stays alone, whichever it is, among those it can be told from.

    Each pair errs with 1 - Phi(z), all rivals of a truth together with no more than the sum.

    Args:
        z: (p,), as `separation` gives it.
        told: (p,), the pairs that count.
        count: of the candidates.
    """
    errors = np.zeros(count)
    for index, (truth, _) in enumerate(permutations(range(count), 2)):
        errors[truth] += norm.sf(z[index]) if told[index] else 0.0
    return float(max(0.0, 1.0 - np.max(errors)))


def level_of(setting: ExperimentConditions) -> Level:
    """Return the level of the logs of a setting."""
    return "bench" if setting.kind == "bench" else "robot"


def experiment_of(
    base: Model,
    rows: FloatArray,
    shown: Sequence[Rival],
    setting: ExperimentConditions,
    names: tuple[tuple[str, ...], ...],
    chance: float,
    why: str,
) -> Experiment:
    """Return the record of an experiment.

    Args:
        base: the model under study.
        rows: the sequence.
        shown: whose predictions to draw.
        setting: how it will be recorded.
        names: of the candidates that it separates; none where it shows effects that the logs could not.
        chance: its power.
        why: what it is for.
    """
    trial = Trial(base, rows, setting)
    predicted = {set_name(rival.names): trial.channels_of(rival.model) for rival in shown}
    period = base.wheel.command_period_s
    return Experiment(
        why=why,
        candidates=names,
        time_s=np.round(np.arange(len(rows)) * period, 9),
        columns=command_of(rows, base, setting.kind).columns(),
        duration_s=round(len(rows) * period, 9),
        power=chance,
        predicted={name: values for name, values in predicted.items() if values is not None},
        predicted_time_s=trial.run.time_s,
    )


def _told(best: FloatArray, count: int) -> Pairs:
    """Return which ordered pairs the best sequence of each separates, either way round."""
    pairs = list(permutations(range(count), 2))
    back = [pairs.index((j, i)) for i, j in pairs]
    return np.asarray(np.maximum(best, best[back]) >= norm.ppf(_LEAST_POWER))


def _tied(names: Sequence[tuple[str, ...]], told: Pairs, setting: ExperimentConditions) -> str:
    """Return what no command separates and what would, in a sentence; empty where there is none."""
    together: list[set[int]] = []
    for (i, j), separable in zip(permutations(range(len(names)), 2), told, strict=True):
        if not separable:
            joined = [group for group in together if group & {i, j}]
            together = [group for group in together if not group & {i, j}]
            together.append({i, j}.union(*joined))
    sentences = []
    for group in together:
        sets = [names[i] for i in sorted(group)]
        which = listed([set_name(one) for one in sets], "or")
        sentences.append(
            f"No command within the robot's limits tells {which} apart by {listed(setting.channels)}: "
            f"{what_to_measure(sets, setting.channels)}."
        )
    return " ".join(sentences)


def _only_spinning(names: Sequence[tuple[str, ...]], setting: ExperimentConditions) -> str:
    which = listed([set_name(one) for one in names])
    return (
        f"{which} part only on commands that make wheels spin, where no model can be trusted: "
        f"{what_to_measure(names, setting.channels)}."
    )


def _separates(
    base: Model, rows: FloatArray, candidates: Sequence[Rival], setting: ExperimentConditions
) -> str:
    """Return where the candidates' predictions of a sequence part most, in a sentence."""
    trial = Trial(base, rows, setting)
    shown = [s for s in (trial.channels_of(c.model) for c in candidates) if s is not None]
    sigma = setting.noise.sigma
    spread = {
        name: float(np.max(np.ptp([s[name] for s in shown], axis=0)))
        for name in setting.channels
        if name not in POSE
    } or {name: float(np.max(np.ptp([s[name] for s in shown], axis=0))) for name in setting.channels}
    name = max(spread, key=lambda channel: spread[channel] / sigma[channel])
    which = listed([set_name(c.names) for c in candidates])
    return (
        f"On these commands the predictions of {which} part by up to {amount(spread[name], UNITS[name])} in "
        f"{name}, where noise has {amount(sigma[name], UNITS[name])}."
    )
