"""A score tells how well runs are predicted from others, and no better than the fit itself reaches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem, fit
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.search_space import effect_set
from sysid.gap.search.scores import scored
from tests.gap.conftest import MakeLogs


def test_a_fit_that_ended_at_a_bound_is_not_scored_beyond_it(bench_logs: MakeLogs, base: Model) -> None:
    """A steady fall of the supply, of which the search may take half only, leaves the other half."""
    logs = bench_logs(base.with_effect("battery_sag", drop_per_s=0.04), seed=3)
    observations = observe(logs)
    problem = ResidualProblem(base, Whitener(observations, measure_noise(logs, observations), None))
    wide = effect_set(base, ["battery_sag"])
    narrow = replace(wide, coordinates=tuple(replace(one, high=0.02) for one in wide.coordinates))
    free, bounded = (fit(problem, one, one.start()) for one in (wide, narrow))
    assert free is not None
    assert bounded is not None
    assert bounded.place == pytest.approx([1.0])
    best, held = scored(problem, free), scored(problem, bounded)
    # Along a straight line from the bound both predict the same.
    assert np.sum(held.scores) == pytest.approx(np.sum(best.scores), rel=0.1)
    assert held.score == pytest.approx(bounded.cost)
    assert best.score == np.sum(best.scores)
    assert held.score > 2.0 * best.score
