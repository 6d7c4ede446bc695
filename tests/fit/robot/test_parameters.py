"""Servo stiffness, yaw inertia and grip: found where robot logs show them, left where not."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.kinematics import TWIST
from mecanum_env.model import Model
from sysid.fit.robot import RobotFit, grip_beside
from sysid.fit.robot.grip import RobotParameter, scan_grip
from sysid.fit.robot.output_error import PlantData
from sysid.fit.robot.parameters import fit_robot
from sysid.logs import BodyCommand, Dataset


def plant_data(data: Dataset, noise_rpm: float = 0.3) -> PlantData:
    names = tuple(data.runs[0].channels)
    sigma = {name: 0.003 if name in TWIST else noise_rpm for name in names}
    return PlantData(data.split("fit"), names, sigma)


def by_name(found: RobotFit) -> dict[str, RobotParameter]:
    return {p.name: p for p in found.parameters}


@pytest.fixture(scope="module")
def heavy(robot_logs: Callable[..., Dataset]) -> tuple[Model, RobotFit]:
    from mecanum_env.model import paper_model

    model = paper_model()
    true = replace(model, robot=replace(model.robot, servo_n_m_s_rad=2.0, yaw_inertia_kg_m2=1.6))
    return true, fit_robot(model, (), plant_data(robot_logs(true, runs=1, seconds=2.0)))


@pytest.mark.parametrize("name", ["servo_n_m_s_rad", "yaw_inertia_kg_m2"])
def test_what_the_logs_show_is_recovered(heavy: tuple[Model, RobotFit], name: str) -> None:
    true, found = heavy
    parameter = by_name(found)[name]
    assert parameter.fitted
    assert parameter.value == pytest.approx(getattr(true.robot, name), abs=3.0 * parameter.standard_error)
    assert parameter.standard_error < 0.1 * parameter.value


def test_law_and_robot_together_leave_only_the_noise(heavy: tuple[Model, RobotFit]) -> None:
    _, found = heavy
    assert found.residual_after == pytest.approx(1.0, abs=0.05)
    assert found.residual_before > 2.0


def test_grip_is_left_without_body_velocities(heavy: tuple[Model, RobotFit]) -> None:
    grip = by_name(heavy[1])["friction"]
    assert not grip.fitted
    assert grip.value == 0.8
    assert "without body velocities" in grip.reason


def test_what_was_measured_is_not_fitted(paper: Model, robot_logs: Callable[..., Dataset]) -> None:
    given = ("servo_n_m_s_rad", "yaw_inertia_kg_m2", "friction")
    found = fit_robot(paper, given, plant_data(robot_logs(paper, runs=1, seconds=1.0)))
    assert found.robot == paper.robot
    assert all("given" in p.reason and not p.fitted for p in found.parameters)


def test_logs_that_show_nothing_leave_the_robot(
    paper: Model, robot_logs: Callable[..., Dataset], monkeypatch: pytest.MonkeyPatch
) -> None:
    # Where nothing is to be found, a long search finds no more.
    monkeypatch.setattr("sysid.fit.robot.output_error._FASTER", ())
    monkeypatch.setattr("sysid.fit.robot.output_error._EVALUATIONS", 4)
    data = robot_logs(paper, runs=1, seconds=0.6, noise_rpm=8.0)
    slow = replace(
        data.runs[0], command=BodyCommand(*(np.sign(c) * 3.0 for c in vars(data.runs[0].command).values()))
    )
    found = fit_robot(paper, (), plant_data(replace(data, runs=(slow,)), noise_rpm=30.0))
    assert found.robot == paper.robot
    assert all("left" in p.reason for p in found.parameters)


@pytest.mark.slow
def test_a_fitted_grip_is_right_within_its_interval(paper: Model, robot_logs: Callable[..., Dataset]) -> None:
    true = replace(paper, robot=replace(paper.robot, friction=0.2))
    grip = by_name(fit_robot(paper, (), plant_data(robot_logs(true, body=True, plant="rollers"))))["friction"]
    assert grip.fitted
    assert abs(grip.value - 0.2) <= 1.96 * grip.standard_error
    assert grip.standard_error < 0.2 * grip.value


def test_grip_is_left_where_nothing_slips(paper: Model, robot_logs: Callable[..., Dataset]) -> None:
    given = ("servo_n_m_s_rad", "yaw_inertia_kg_m2")
    data = robot_logs(paper, runs=1, seconds=1.0, body=True, plant="rollers")
    grip = by_name(fit_robot(paper, given, plant_data(data)))["friction"]
    assert not grip.fitted
    assert grip.value == paper.robot.friction
    assert "no slip" in grip.reason


def test_a_body_that_follows_late_is_no_slip_once_that_is_known(
    paper: Model, robot_logs: Callable[..., Dataset]
) -> None:
    true = paper.with_effect("sensor_latency/body", delay_s=0.06)
    logs = robot_logs(true, runs=1, seconds=1.0, body=True, plant="rollers")
    law_alone = scan_grip(paper, given=False, data=plant_data(logs))
    assert law_alone.fitted
    assert law_alone.value < 0.6
    grip = grip_beside(true, logs, (), plant_data(logs), paper.robot.friction)
    assert not grip.fitted
    assert grip.value == paper.robot.friction


@pytest.mark.slow
def test_a_grip_beside_effects_is_right_within_its_interval(
    paper: Model, robot_logs: Callable[..., Dataset]
) -> None:
    known = paper.with_effect("sensor_latency/body", delay_s=0.06)
    true = replace(known, robot=replace(known.robot, friction=0.2))
    logs = robot_logs(true, body=True, plant="rollers")
    grip = grip_beside(known, logs, (), plant_data(logs), paper.robot.friction)
    assert grip.fitted
    assert abs(grip.value - 0.2) <= 1.96 * grip.standard_error
