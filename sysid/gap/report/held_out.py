"""Errors before and after a study adds its effects, and the evidence for each set of effects.

Errors are those of test runs, which take no part in the search; without any, those of the runs that do.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import POSE
from mecanum_env.model import Model
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import ResidualProblem, at_likeliest_phase
from sysid.compare.measured import observe
from sysid.compare.predicted import SimulationSettings, Simulator, planar_part, predict
from sysid.compare.search_space import EffectSet
from sysid.gap.report.samples import Samples, samples_of
from sysid.gap.result import Difference, Evidence, Overlay
from sysid.gap.search.chance import Floor, enough, expected
from sysid.gap.search.decision import Decision
from sysid.gap.search.scores import ScoredSet, fitted_rms, raw_rms
from sysid.logs import Dataset, Run, Split
from sysid.logs.noise import noise_from_repeats
from sysid.logs.runs import UNITS

_OVERLAYS: Final = 6
"""Number of worst runs and channels that are drawn."""
_MOST_SETS: Final = 12
"""Sets of effects in the evidence, besides the model as it is and the law fitted again."""
_HELD_OUT: Final[tuple[Split, ...]] = ("test", "validation", "fit")
"""Splits that the errors may be of, in order of preference."""
Channels = Mapping[str, FloatArray]
"""Channel -> values at the rows of a run, shape (n,)."""


@dataclass(frozen=True)
class Comparison:
    """Some runs, measured and simulated before and after."""

    split: Split
    samples: tuple[Samples, ...]

    def by_channel(self) -> dict[str, list[Samples]]:
        """Return the samples of each channel that has a finite error, in the order of a log's columns."""
        known = [part for part in self.samples if np.any(np.isfinite(part.errors()[0]))]
        found = {name: [part for part in known if part.channel == name] for name in UNITS}
        return {name: parts for name, parts in found.items() if parts}


def held_out(dataset: Dataset) -> tuple[Split, tuple[Run, ...]]:
    """Return the test runs; if there are none, the validation runs, else the fit runs."""
    split = next(split for split in _HELD_OUT if dataset.split(split))
    return split, dataset.split(split)


def predicted(model: Model, runs: Sequence[Run], settings: SimulationSettings) -> list[dict[str, FloatArray]]:
    """Return what a model predicts for each run: channel -> values at its rows, shape (n,).

    An effect that follows the wheel's angle has the phase that leaves least of the run.
    """
    return [predict(at_likeliest_phase(model, run, settings), run, settings=settings) for run in runs]


def without_scatter(
    problem: ResidualProblem,
    effects: Sequence[str],
    models: tuple[Model, Model],
    runs: Sequence[Run],
    predictions: tuple[Sequence[Channels], Sequence[Channels]],
) -> Sequence[Channels]:
    """Return what the second of two `models` predicts for each run, with no more scatter than the first does.

    Two simulations on rollers differ by where the rollers come to lie, too, which may be more than a right
    effect changes. So what the `effects` of the second model change is taken from the planar plant, where
    that shows it. `predictions` are those of the two models on the plant of the `problem`.
    """
    before, after = predictions
    if not effects or not problem.surrogate_covers(effects):
        return after
    planar = replace(problem.settings, plant="planar")
    here, there = (predicted(planar_part(model), runs, planar) for model in models)
    return [
        {name: values + changed[name] - unchanged[name] for name, values in one.items()}
        for one, unchanged, changed in zip(before, here, there, strict=True)
    ]


def compare(
    split: Split, runs: Sequence[Run], before: Sequence[Channels], after: Sequence[Channels]
) -> Comparison:
    """Return runs of a split beside their simulations before and after, one mapping per run."""
    repeats: dict[str, int] = {}
    samples: list[Samples] = []
    for run, b, a in zip(runs, before, after, strict=True):
        repeat = repeats.get(run.group, 0)
        repeats[run.group] = repeat + 1
        samples += samples_of(run, b, a, repeat)
    return Comparison(split, tuple(samples))


def differences(
    dataset: Dataset,
    comparison: Comparison,
    noise: Mapping[str, float],
    fitted_on: Dataset | None = None,
    noise_factor: float = 1.0,
) -> tuple[Difference, dict[str, Difference]]:
    """Return the gap over all channels, and that of each channel that has samples.

    With several channels the gap is in standard deviations of their noise. The noise floor is from repeats of
    all runs of the dataset, test runs included; of a channel without repeats there, from those of the logs of
    the fit. Without any it is not known, and the channel is scaled by the `noise` that the study took, its
    standard deviation. The noise in the comparison may be larger than theirs by a factor.
    """
    of_fit = {} if fitted_on is None else noise_from_repeats(fitted_on.runs) or {}
    repeats = {**of_fit, **(noise_from_repeats(dataset.runs) or {})}
    channels = {}
    for name, parts in comparison.by_channel().items():
        before, after = (np.concatenate(errors) for errors in zip(*(p.errors() for p in parts), strict=True))
        floor = noise_factor * repeats[name].std if name in repeats else None
        motion = rms(np.concatenate([_motion(part) for part in parts]))
        channels[name] = Difference(UNITS[name], rms(before), rms(after), floor, motion)
    if len(channels) == 1:
        return next(iter(channels.values())), channels
    known = all(channel.noise_floor is not None for channel in channels.values())
    scaled = [
        (c.before / s, c.after / s, (c.motion or 0.0) / s)
        for name, c in channels.items()
        if (s := c.noise_floor or noise_factor * noise.get(name, 0.0)) > 0.0
    ]
    if not scaled:
        return Difference("sigma", 0.0, 0.0, None), channels
    before_all, after_all, motion_all = (rms(np.array(values)) for values in zip(*scaled, strict=True))
    return Difference("sigma", before_all, after_all, 1.0 if known else None, motion_all), channels


def _motion(part: Samples) -> FloatArray:
    """Return the measured values that move: a pose counts from the run's first sample."""
    values = part.measured[np.isfinite(part.measured)]
    return values - values[0] if part.channel in POSE else values


def overlays(comparison: Comparison) -> tuple[Overlay, ...]:
    """Return the channels and runs with the largest error before, relative to that of the whole channel."""
    ranked = []
    for name, parts in comparison.by_channel().items():
        scale = max(rms(np.concatenate([p.errors()[0] for p in parts])), 1e-12)
        ranked += [(-rms(p.errors()[0]) / scale, p.run, name, p) for p in parts if p.repeat == 0]
    worst = sorted(ranked, key=lambda entry: entry[:3])[:_OVERLAYS]
    return tuple(
        Overlay(
            file=part.run,
            split=comparison.split,
            channel=name,
            unit=UNITS[name],
            time_s=part.time_s,
            measured=part.measured,
            before=part.before,
            after=part.after,
            command=part.command.at(part.time_s)[:, 0] if UNITS[name] == "rpm" else None,
        )
        for _, _, name, part in worst
    )


def evidence(
    dataset: Dataset, problem: ResidualProblem, decision: Decision, floor: Floor
) -> tuple[Evidence, ...]:
    """Return the sets of effects that matter, best score first.

    The test runs of the dataset are simulated here, after the decision.
    """
    base = next(judged for judged in decision.facts.judged if not judged.names)
    shown = [judged for judged in decision.facts.judged if judged.names][:_MOST_SETS]
    shown += [judged for judged in decision.facts.judged if not judged.names]
    shown += [] if decision.facts.law is None else [decision.facts.law]
    tests = dataset.split("test")
    test = Simulator(observe(replace(dataset, runs=tests)), problem.settings) if tests else None
    right = expected(problem, *(j.fitted for j in (base, decision.chosen) if j is not None))

    def row(judged: ScoredSet) -> Evidence:
        fitted = judged.fitted
        model = fitted.candidate.model(problem.base, fitted.place)
        parameter_count = fitted.candidate.parameter_count
        return Evidence(
            effects=judged.names,
            parameters=_parameters(judged, model),
            parameter_count=parameter_count,
            score=judged.score - base.score,
            misfit=fitted.cost / problem.size,
            adequate=enough(problem, base.fitted, fitted, floor, right),
            validation_rms=fitted_rms(problem, fitted, "validation"),
            test_rms=math.nan if test is None else _test_rms(problem, test, model),
            bic=fitted.cost / decision.facts.inflation + parameter_count * math.log(problem.size),
        )

    return tuple(problem.settings.map(row, sorted(shown, key=lambda judged: (judged.score, judged.names))))


def _parameters(judged: ScoredSet, model: Model) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {name: {} for name in judged.names}
    if isinstance(judged.fitted.candidate, EffectSet):
        for c in judged.fitted.candidate.coordinates:
            found[c.effect].update((name, model.effects[c.effect][name]) for name in c.names)
    else:
        found[judged.names[0]] = dict(zip("ABCDEF", model.wheel.law.coefficients.tolist(), strict=True))
    return found


def _test_rms(problem: ResidualProblem, test: Simulator, model: Model) -> float:
    try:
        predictions = test.predictions(model)
    except MecanumError:
        return math.nan
    blocks = test.observations.blocks
    parts = [block.value - p for block, p in zip(blocks, predictions, strict=True)]
    return raw_rms(problem, test.observations, parts, "test")
