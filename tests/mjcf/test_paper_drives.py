"""The paper's robot drives, as the experiment and `benchmarks/paper_drives.py` run them."""

import pytest

from mecanum_env.law.metrics import law_step_metrics
from sysid.studies.reproduce.robot import robot_drives


@pytest.fixture(scope="module")
def results(packaged):
    return {result.name: result for result in robot_drives(packaged)}


def test_they_are_the_papers_five(results):
    assert list(results) == [*(f"straight {v} rpm" for v in (10, 40, 80, 130)), "turn 1.484 rad/s"]


@pytest.mark.parametrize("v", [10, 40, 80, 130])
def test_without_friction_a_straight_drive_loses_nothing(results, v):
    assert abs(results[f"straight {v} rpm"].loss) < 1e-3


def test_a_turn_loses_what_the_rollers_give(results):
    assert results["turn 1.484 rad/s"].loss == pytest.approx(0.0078, abs=2e-3)


def test_slow_drives_rise_like_the_free_wheel_and_fast_ones_as_the_motors_allow(results, packaged):
    free = law_step_metrics(packaged.wheel.law).rise_time_s
    assert results["straight 10 rpm"].rise_s == pytest.approx(free, rel=0.1)
    assert results["straight 130 rpm"].rise_s > 1.5 * free
    robot = packaged.robot
    most = 4 * robot.torque_limit_n_m / robot.wheel_radius_m / robot.mass_kg  # [m/s^2], wheels' inertia aside
    radius_rpm = robot.wheel_radius_m * 0.10471975511965977  # m/s per rpm
    assert results["straight 130 rpm"].peak_acceleration <= 1.02 * most / radius_rpm
