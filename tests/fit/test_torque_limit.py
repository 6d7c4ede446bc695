"""The torque limit of a robot's drives: found where hard starts reach it, with the law before it."""

import math
from collections.abc import Callable
from dataclasses import replace

import pytest

from mecanum_env.model import Model
from sysid.fit.robot_search import PlantData, RobotSearch, faster_law
from sysid.fit.torque_limit import NAME, with_ceilings, with_torque_limit
from sysid.logs import Dataset

LIMIT_N_M = 0.4
MakeLogs = Callable[..., Dataset]


def data_of(logs: Dataset) -> PlantData:
    names = tuple(logs.runs[0].channels)
    return PlantData(logs.split("fit"), names, dict.fromkeys(names, 0.3))


def limited(model: Model, torque_n_m: float = LIMIT_N_M) -> Model:
    return replace(model, robot=replace(model.robot, torque_limit_n_m=torque_n_m))


def slow(model: Model) -> Model:
    """Return the model as a fit of a linear law gives it: slow, below a ceiling that is not there."""
    wheel = replace(model.wheel, law=faster_law(model.wheel.law, 0.3), saturation_rpm=60.0)
    return replace(model, wheel=wheel)


@pytest.fixture(scope="module")
def found(robot_logs: MakeLogs) -> tuple[Model, Model | None]:
    from mecanum_env.model import paper_model

    model = paper_model()
    data = data_of(robot_logs(limited(model), runs=3))
    return model, with_torque_limit(slow(model), data, model.wheel.saturation_rpm)


def test_a_constant_acceleration_is_taken_for_a_torque_limit(found: tuple[Model, Model | None]) -> None:
    _, start = found
    assert start is not None
    assert LIMIT_N_M / 1.5 < start.robot.torque_limit_n_m < LIMIT_N_M * 1.5


def test_a_ceiling_that_the_limit_explains_is_given_up(found: tuple[Model, Model | None]) -> None:
    model, start = found
    assert start is not None
    assert start.wheel.saturation_rpm == model.wheel.saturation_rpm


def test_a_search_from_there_finds_the_limit(found: tuple[Model, Model | None], robot_logs: MakeLogs) -> None:
    model, start = found
    assert start is not None
    data = data_of(robot_logs(limited(model), runs=1))
    robot = RobotSearch(start, data, thorough=False).fit([NAME]).model.robot
    assert robot.torque_limit_n_m == pytest.approx(LIMIT_N_M, rel=0.05)


def test_drives_that_never_reach_their_limit_show_none(paper: Model, robot_logs: MakeLogs) -> None:
    strong = limited(paper, 50.0)
    assert with_torque_limit(strong, data_of(robot_logs(strong, runs=1)), math.inf) is None


def test_a_ceiling_that_is_known_is_tried_once(paper: Model) -> None:
    known = paper.wheel.saturation_rpm
    assert with_ceilings(paper, paper, 0.0) == with_ceilings(paper, paper, known) == [paper]
    assert [one.wheel.saturation_rpm for one in with_ceilings(paper, paper, math.inf)] == [known, math.inf]
