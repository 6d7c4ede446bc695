"""On the bench every single effect is fitted, and at least as well as where it was screened."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import EFFORT
from tests.gap.conftest import MakeLogs

THRESHOLDS_OF_SPEED = (
    "command_deadband",
    "static_map",
    "speed_saturation",
    "stiction",
    "stiction/washed_out",
)


@pytest.fixture(
    scope="module",
    params=[("command_deadband", {"threshold_rpm": 75.0}), ("stiction", {"breakaway_n_m": 1.0})],
    ids=["deadband", "stiction"],
)
def search(request: pytest.FixtureRequest, bench_logs: MakeLogs, base: Model) -> Search:
    """Return the search of single effects in logs with a large threshold."""
    name, values = request.param
    dataset = bench_logs(base.with_effect(name, **values))
    observations = observe(dataset)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(dataset, observations), None))
    found = Search(problem, Library(responses(problem, THRESHOLDS_OF_SPEED)), EFFORT["bench"])
    found.grow(1)
    return found


def test_every_effect_is_fitted_however_much_a_curve_promises(search: Search) -> None:
    assert {names for names in search.fitted if names} == {(name,) for name in THRESHOLDS_OF_SPEED}


def test_no_fit_is_worse_than_a_size_that_was_screened(search: Search) -> None:
    residual: Any = search.base.residual
    for response in search.library:
        if not response.linear:
            screened = float(np.sum((residual + response.change) ** 2))
            assert search.fitted[(response.effect,)].cost <= screened * (1.0 + 1e-6), response.effect


@pytest.mark.parametrize("was_fitted", [True, False])
def test_a_single_effect_that_ended_too_early_or_was_not_fitted_is_fitted_from_a_pair(
    bench_logs: MakeLogs, base: Model, was_fitted: bool
) -> None:
    dataset = bench_logs(base.with_effect("speed_gain", gain=0.9))
    observations = observe(dataset)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(dataset, observations), None))
    search = Search(problem, Library(responses(problem, ("speed_gain", "command_latency"))), EFFORT["bench"])
    search.grow(1)
    right = search.fitted[("speed_gain",)]
    start = right.candidate.start()
    search._fitted[("speed_gain",)] = replace(right, place=start, residual=search.base.residual)
    if not was_fitted:
        del search._fitted[("speed_gain",)]
    search.grow(2)
    assert search.fitted[("speed_gain",)].cost == pytest.approx(right.cost, rel=0.01)
