"""What the logs of a robot's fit teach about effects: those are taken off, and only what is new is left."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Learned, Whitener, learn
from sysid.compare.predicted import SimulationSettings
from sysid.logs import Dataset

MakeLogs = Callable[..., Dataset]
PLANAR = SimulationSettings("planar")


@pytest.fixture(scope="module")
def turned() -> Model:
    return paper_model().with_effect("mount_yaw", angle_deg=3.0)


@pytest.fixture(scope="module")
def learned(robot_logs: MakeLogs, turned: Model) -> Learned:
    return learn(paper_model(), robot_logs(turned, runs=3, seconds=2.0, body=True), PLANAR)


def cost(learned: Learned, logs: Dataset, what: Learned) -> float:
    """Return the mean square of what is left of the base model in logs, with what was learned."""
    whitener = Whitener(observe(logs), learned.whitener.noise, learned.error)
    problem = ResidualProblem(learned.model, whitener, PLANAR, learned=what)
    return float(np.mean(problem.base_residual**2))


def test_an_effect_that_the_logs_of_the_fit_have_is_no_difference(
    learned: Learned, robot_logs: MakeLogs, turned: Model
) -> None:
    same = robot_logs(turned, runs=2, seconds=2.0, body=True)
    assert cost(learned, same, learned) < 1.3
    assert cost(learned, same, learned.before()) > 2.0 * cost(learned, same, learned)


def test_an_effect_that_came_later_stays(learned: Learned, robot_logs: MakeLogs, turned: Model) -> None:
    later = robot_logs(turned.with_effect("mount_yaw", angle_deg=9.0), runs=2, seconds=2.0, body=True)
    assert cost(learned, later, learned) > 2.0
