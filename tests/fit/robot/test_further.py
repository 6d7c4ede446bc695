"""A second effect of a robot is needed by its logs, not by what the first one does to the model's error."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import paper_model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Learned, Whitener, learn
from sysid.compare.model_error.elsewhere import beside
from sysid.compare.predicted import SimulationSettings
from sysid.gap.search.chance import Floor
from sysid.gap.search.decision import _holds
from sysid.gap.search.further import needed
from sysid.gap.search.responses import Library, responses
from sysid.gap.search.scores import scored
from sysid.gap.search.sets import Search
from sysid.gap.search.thresholds import SearchEffort
from sysid.logs import Dataset

MakeLogs = Callable[..., Dataset]
PLANAR = SimulationSettings("planar")
FLOOR = Floor(1e4, trusted=True, compared=True, knows_all=True, slack=1.5)
BASE = paper_model()
SLOW = BASE.with_effect("speed_gain", gain=0.8)
"""The robot, whose gain the model lacks."""
LIMIT = {"v_rpm": 25.0, "vc_rpm": 20.0}


@pytest.fixture(scope="module")
def learned(robot_logs: MakeLogs) -> Learned:
    return learn(BASE, robot_logs(SLOW, runs=4, seconds=2.0), PLANAR)


def problem_of(logs: Dataset, learned: Learned) -> ResidualProblem:
    whitener = Whitener(observe(logs), learned.whitener.noise, learned.error)
    return ResidualProblem(learned.model, whitener, PLANAR, learned=learned)


@pytest.fixture(scope="module")
def limited(learned: Learned, robot_logs: MakeLogs) -> ResidualProblem:
    """Return the study of the robot after its speed was limited."""
    return problem_of(robot_logs(SLOW.with_effect("body_speed_limit", **LIMIT), runs=2, seconds=2.0), learned)


@pytest.fixture(scope="module")
def late(learned: Learned, robot_logs: MakeLogs) -> ResidualProblem:
    """Return the study of the robot after its speed was limited and its commands came late."""
    both = SLOW.with_effect("body_speed_limit", **LIMIT).with_effect("command_latency", delay_s=0.1)
    return problem_of(robot_logs(both, runs=2, seconds=2.0), learned)


def searched(problem: ResidualProblem, *second: str) -> Search:
    """Return a search with the limit fitted, and beside it each `second` effect."""
    names = ["body_speed_limit", *second]
    search = Search(problem, Library(responses(problem, names)), SearchEffort(4, 4, 1, 1, 1))
    search.grow(1)
    search.fit_best(search.growths(search.of_size(1)[0]), 4)
    return search


def test_the_error_of_a_model_is_taken_off_where_an_effect_moves_the_robot(
    limited: ResidualProblem,
) -> None:
    true = BASE.with_effect("body_speed_limit", **LIMIT)
    far, near = limited.residual(true), limited.moved(true).residual(true)
    assert far is not None
    assert near is not None
    assert near @ near < 0.5 * (far @ far)


def test_a_second_effect_that_only_makes_up_for_the_error_of_the_model_is_not_needed(
    limited: ResidualProblem, monkeypatch: pytest.MonkeyPatch
) -> None:
    search = searched(limited, "speed_gain")
    one, two = search.of_size(1)[0], search.of_size(2)[0]
    assert one.names == ("body_speed_limit",)
    # Beside the error as it is without the limit, it would explain most of what is left.
    assert two.cost < 0.3 * one.cost
    # The decision asks the same, whatever else objects to the pair.
    monkeypatch.setattr("sysid.gap.search.decision.doubtful", lambda *_: ())
    assert not _holds(search, FLOOR, scored(limited, two), np.random.default_rng(0))
    assert not needed(search, FLOOR, two, 1.0, np.random.default_rng(0))


def test_a_second_effect_that_is_new_is_needed(late: ResidualProblem) -> None:
    search = searched(late, "command_latency")
    assert needed(search, FLOOR, search.of_size(2)[0], 1.0, np.random.default_rng(0))


def test_a_third_effect_stands_only_on_a_second_that_is_needed(late: ResidualProblem) -> None:
    search = searched(late, "speed_gain", "command_latency")
    artefact = next(two for two in search.of_size(2) if "speed_gain" in two.names)
    assert not needed(search, FLOOR, artefact, 1.0, np.random.default_rng(0))
    # The delay is real, but the pair that it was found beside is not.
    search.fit_best(search.growths(artefact), 4)
    three = next(three for three in search.of_size(3) if set(artefact.names) < set(three.names))
    found: Any = SimpleNamespace(problem=late, library=search.library)
    found.of_size = lambda size: [artefact] if size == 2 else search.of_size(size)
    assert three.cost < 0.5 * artefact.cost
    assert not needed(found, FLOOR, three, 1.0, np.random.default_rng(0))


def test_a_single_effect_is_no_further_one(learned: Learned, robot_logs: MakeLogs) -> None:
    search = searched(problem_of(robot_logs(SLOW, runs=2, seconds=2.0), learned), "speed_gain")
    assert needed(search, FLOOR, search.of_size(1)[0], 1.0, np.random.default_rng(0))


def test_a_variant_of_a_model_is_put_beside_what_another_adds() -> None:
    at = BASE.with_effect("body_speed_limit", **LIMIT)
    both = beside(SLOW, BASE, at)
    assert both is not None
    assert both.effects == SLOW.effects | at.effects


@pytest.mark.parametrize("other", ["command_latency", "command_latency/jitter"])
def test_which_of_two_values_of_one_cause_holds_is_not_decided(other: str) -> None:
    late = BASE.with_effect("command_latency", delay_s=0.02)
    assert beside(late, BASE, BASE.with_effect(other, delay_s=0.05)) is None


def test_another_form_of_a_cause_takes_the_place_of_the_base_models() -> None:
    base = BASE.with_effect("command_latency", delay_s=0.02)
    at = replace(BASE, effects={"command_latency/jitter": {"delay_s": 0.02, "jitter_s": 0.01}})
    moved = beside(base.with_effect("speed_gain", gain=0.9), base, at)
    assert moved is not None
    assert set(moved.effects) == {"command_latency/jitter", "speed_gain"}
