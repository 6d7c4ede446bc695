"""How far model and measurement differ before and after, on runs that no decision has seen.

The evidence behind a verdict: each set of effects with its parameters and its errors.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant
from mecanum_env.units import FloatArray
from sysid.compare.correction import correction_of
from sysid.compare.observations import observe
from sysid.compare.prediction import predict
from sysid.compare.problem import ResidualProblem
from sysid.compare.samples import Samples, samples_of
from sysid.compare.simulator import Simulator
from sysid.gap.result import Difference, Evidence, FoundEffect, Interval, Overlay
from sysid.gap.search.adequacy import Floor, enough, expected
from sysid.gap.search.coordinates import EffectSet
from sysid.gap.search.decision import Decision
from sysid.gap.search.scores import ScoredSet, fitted_rms, interval_ends, raw_rms
from sysid.logs import Dataset, Run, Split
from sysid.logs.noise import noise_from_repeats
from sysid.logs.runs import UNITS

_OVERLAYS: Final = 6
_HELD_OUT: Final[tuple[Split, ...]] = ("test", "validation", "fit")
Channels = Mapping[str, FloatArray]
"""Channel -> values at the rows of a run."""


@dataclass(frozen=True)
class Comparison:
    """Some runs, measured and simulated before and after."""

    split: Split
    """Of the runs."""
    runs: tuple[Run, ...]
    samples: tuple[Samples, ...]

    def by_channel(self) -> dict[str, list[Samples]]:
        """Return the samples of each channel, in the order of a log's columns."""
        found: dict[str, list[Samples]] = {}
        for name in UNITS:
            parts = [part for part in self.samples if part.channel == name]
            if parts:
                found[name] = parts
        return found


def held_out(dataset: Dataset) -> tuple[Split, tuple[Run, ...]]:
    """Return the test runs; where there are none, the validation runs, else the fit runs."""
    split = next(split for split in _HELD_OUT if dataset.split(split))
    return split, dataset.split(split)


def predicted(
    model: Model, runs: Sequence[Run], plant: RobotPlant = "rollers"
) -> list[dict[str, FloatArray]]:
    """Return what a model predicts for each run: channel -> values at its rows, (n,).

    Args:
        model: wheel, robot and effects.
        runs: bench or robot logs.
        plant: of the robot.
    """
    shown = [predict(model, run, plant=plant) for run in runs]
    correction = correction_of(model)
    return (
        shown
        if correction is None
        else [correction.added_to(run, one) for run, one in zip(runs, shown, strict=True)]
    )


def compare(
    split: Split, runs: Sequence[Run], before: Sequence[Channels], after: Sequence[Channels]
) -> Comparison:
    """Return runs beside their simulations.

    Args:
        split: of the runs.
        runs: bench or robot logs.
        before: one a run, of the model as given.
        after: one a run, of the improved model.
    """
    seen: dict[str, int] = {}
    samples: list[Samples] = []
    for run, b, a in zip(runs, before, after, strict=True):
        repeat = seen.get(run.group, 0)
        seen[run.group] = repeat + 1
        samples += samples_of(run, b, a, repeat)
    return Comparison(split, tuple(runs), tuple(samples))


def differences(dataset: Dataset, comparison: Comparison) -> tuple[Difference, dict[str, Difference]]:
    """Return the gap over all channels, and that of each channel.

    With several channels the gap is in units of their noise: from repeats, else what is left after.

    Args:
        dataset: all its repeats give the noise.
        comparison: of the runs that count.
    """
    repeats = noise_from_repeats(dataset.runs) or {}
    channels = {}
    for name, parts in comparison.by_channel().items():
        before, after = (np.concatenate(errors) for errors in zip(*(p.errors() for p in parts), strict=True))
        floor = repeats[name].std if name in repeats else None
        channels[name] = Difference(UNITS[name], _rms(before), _rms(after), floor)
    if len(channels) == 1:
        return next(iter(channels.values())), channels
    known = all(channel.noise_floor is not None for channel in channels.values())
    scaled = [(c.before / s, c.after / s) for c in channels.values() if (s := c.noise_floor or c.after) > 0.0]
    if not scaled:
        return Difference("sigma", 0.0, 0.0, None), channels
    before_all, after_all = (math.sqrt(float(np.mean(np.square(x)))) for x in zip(*scaled, strict=True))
    return Difference("sigma", before_all, after_all, 1.0 if known else None), channels


def overlays(comparison: Comparison) -> tuple[Overlay, ...]:
    """Return the channels and runs that were worst before, against the spread of all of that channel."""
    scale = {name: max(_rms(np.concatenate([p.errors()[0] for p in parts])), 1e-12)
             for name, parts in comparison.by_channel().items()}  # fmt: skip
    first = [part for part in comparison.samples if part.repeat == 0]
    worst = sorted(first, key=lambda p: (-_rms(p.errors()[0]) / scale[p.channel], p.run, p.channel))
    return tuple(_overlay(comparison.split, part) for part in worst[:_OVERLAYS])


def _overlay(split: Split, part: Samples) -> Overlay:
    command = part.command.at(part.time_s)
    return Overlay(
        file=part.run,
        split=split,
        channel=part.channel,
        unit=UNITS[part.channel],
        time_s=part.time_s,
        measured=part.measured,
        before=part.before,
        after=part.after,
        command=command[:, 0] if UNITS[part.channel] == "rpm" else None,
    )


def _rms(values: FloatArray) -> float:
    finite = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(finite**2))) if finite.size else 0.0


MOST: Final = 12
"""Sets in the table, beside the model as it is and the law fitted again."""


def found_effects(problem: ResidualProblem, decision: Decision) -> tuple[FoundEffect, ...]:
    """Return the effects of the chosen set with 90 % intervals; none for a verdict without one.

    Args:
        problem: the model and the runs that decided.
        decision: the verdict and what it rests on.
    """
    if decision.chosen is None:
        return ()
    fitted = decision.chosen.fitted
    candidate: EffectSet = fitted.candidate
    low, high = interval_ends(problem, fitted, decision.inflation)
    intervals: dict[str, dict[str, Interval]] = {name: {} for name in candidate.names}
    for coordinate, *ends in zip(candidate.coordinates, fitted.place, low, high, strict=True):
        if coordinate.effect:
            value, first, last = (coordinate.value(float(np.clip(end, 0.0, 1.0))) for end in ends)
            intervals[coordinate.effect][coordinate.parameter] = Interval(value, first, last)
    return tuple(
        FoundEffect(name, parameters, decision.frequency.get(name, 0.0))
        for name, parameters in intervals.items()
    )


def evidence(
    dataset: Dataset, problem: ResidualProblem, decision: Decision, floor: Floor
) -> tuple[Evidence, ...]:
    """Return the sets that matter, best score first.

    Args:
        dataset: its test runs are simulated for the first time here.
        problem: the model and the runs that decided.
        decision: the verdict and what it rests on.
        floor: what is known of the noise.
    """
    listed = [j for j in decision.judged if j.names][:MOST]
    listed += [j for j in decision.judged if not j.names]
    if decision.law is not None:
        listed.append(decision.law)
    tests = dataset.split("test")
    test = Simulator(observe(replace(dataset, runs=tests)), problem.study) if tests else None
    base = next(j for j in decision.judged if not j.names)
    right = expected(problem, *(j.fitted for j in (base, decision.chosen) if j is not None))

    def row(judged: ScoredSet) -> Evidence:
        fitted = judged.fitted
        model = fitted.candidate.model(problem.base, fitted.place)
        p = fitted.candidate.parameter_count
        return Evidence(
            effects=judged.names,
            parameters=_parameters(judged, model),
            parameter_count=p,
            score=judged.score - base.score,
            misfit=fitted.cost / problem.size,
            adequate=enough(problem, base.fitted, fitted, floor, right),
            validation_rms=fitted_rms(problem, fitted, "validation"),
            test_rms=math.nan if test is None else _test_rms(problem, test, model),
            bic=fitted.cost / decision.inflation + p * math.log(problem.size),
        )

    return tuple(problem.map(row, sorted(listed, key=lambda j: (j.score, j.names))))


def _parameters(judged: ScoredSet, model: Model) -> dict[str, dict[str, float]]:
    found: dict[str, dict[str, float]] = {name: {} for name in judged.names}
    if isinstance(judged.fitted.candidate, EffectSet):
        for c in judged.fitted.candidate.coordinates:
            section = (
                model.effects[c.effect] if c.effect else {c.parameter: model.robot.servo_integral_n_m_rad}
            )
            found.setdefault(c.effect or "robot", {})[c.parameter] = section[c.parameter]
    else:
        law = model.wheel.law
        found[judged.names[0]] = dict(zip("ABCDEF", law.coefficients.tolist(), strict=True))
    return found


def _test_rms(problem: ResidualProblem, test: Simulator, model: Model) -> float:
    try:
        predictions = test.predictions(model)
    except MecanumError:
        return math.nan
    blocks = test.observations.blocks
    parts = [block.value - p for block, p in zip(blocks, predictions, strict=True)]
    return raw_rms(problem, test.observations, parts, "test")
