"""The experiment that shows as many as can be of the effects that the logs so far could not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from scipy.stats import norm

from mecanum_env.effects import CATALOGUE, Effect, Plant
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.gap.coordinates import coordinate
from sysid.gap.experiment import Design, Rival, experiment_of, level_of
from sysid.gap.sequence_search import EFFORT, Judged, Worth, search
from sysid.gap.sequences import Limits
from sysid.gap.trial import Setting, Trial
from sysid.gap.verdict import listed
from sysid.logs.records import Level

_TYPICAL: Final = 0.3
"""Size that should show, as the part of the way from neutral to the further bound of a search."""
_MOST: Final[dict[Level, int]] = {"bench": 8, "robot": 4}
"""Effects that one experiment is designed for, the first in the chain: each costs simulations."""
_LEAST_POWER: Final = 0.5
"""With which an effect must show to be worth an experiment."""


def design_for_untestable(
    model: Model,
    effects: Sequence[str],
    setting: Setting,
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
        scale: of bounds in rpm and rpm/s, from `sysid.gap.scale`.
        seed: of the random sequences and changes.
        jobs: sequences simulated at a time; changes the time taken, not the result.
    """
    plant: Plant = "bench" if setting.kind == "bench" else "rollers"
    there = [CATALOGUE[name] for name in effects if CATALOGUE[name].acts_in(plant)]
    rivals = [_typical(model, effect, scale) for effect in there[: _MOST[level_of(setting)]]]
    if not rivals:
        return Design(None, "")
    shown: list[int] = []

    def judge(rows: FloatArray, thorough: bool) -> Judged | None:
        z = visibility(Trial(model, rows, setting, rough=not thorough), rivals, threshold, thorough=thorough)
        return None if z is None else Judged(rows, z)

    def worth_of(found: Sequence[Judged]) -> Worth | None:
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
