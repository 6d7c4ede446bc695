"""The evidence behind a verdict: each set of effects with its parameters and its errors."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from sysid.gap.adequacy import Floor, enough, expected
from sysid.gap.coordinates import EffectSet
from sysid.gap.decide import Decision
from sysid.gap.intervals import interval_ends
from sysid.gap.observations import observe
from sysid.gap.problem import Problem
from sysid.gap.raw_error import fitted_rms, raw_rms
from sysid.gap.records import Evidence, FoundEffect, Interval
from sysid.gap.scores import Judged
from sysid.gap.simulator import Simulator
from sysid.logs import Dataset

MOST: Final = 12
"""Sets in the table, beside the model as it is and the law fitted again."""


def found_effects(problem: Problem, decision: Decision) -> tuple[FoundEffect, ...]:
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


def evidence(dataset: Dataset, problem: Problem, decision: Decision, floor: Floor) -> tuple[Evidence, ...]:
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
    test = Simulator(observe(replace(dataset, runs=tests)), plant=problem.plant) if tests else None
    base = next(j for j in decision.judged if not j.names)
    right = expected(problem, *(j.fitted for j in (base, decision.chosen) if j is not None))

    def row(judged: Judged) -> Evidence:
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


def _parameters(judged: Judged, model: Model) -> dict[str, dict[str, float]]:
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


def _test_rms(problem: Problem, test: Simulator, model: Model) -> float:
    try:
        predictions = test.predictions(model)
    except MecanumError:
        return math.nan
    blocks = test.observations.blocks
    parts = [block.value - p for block, p in zip(blocks, predictions, strict=True)]
    return raw_rms(problem, test.observations, parts, "test")
