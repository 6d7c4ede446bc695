"""The gap workflow on recordings of real robots; skipped where they are not there."""

from pathlib import Path

import pytest

from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import read_robot
from sysid.compare.subset import small_command_runs
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset

ROW_S = 0.05
"""Between the rows of the husky's logs."""


def test_what_a_ruler_tells_of_the_husky_makes_a_robot(real_logs: Path) -> None:
    robot = read_robot(real_logs / "husky/body/robot.json")
    assert robot.yaw_inertia_kg_m2 == pytest.approx(2.376, abs=5e-4)
    robot_masses(robot)


@pytest.mark.slow
def test_the_limits_of_the_husky_act_on_its_body(real_logs: Path) -> None:
    """Commands were beyond what the platform lets through, in speed and in acceleration."""
    data = read_dataset(real_logs / "husky/body")
    robot = read_robot(real_logs / "husky/body/robot.json")
    given = ("wheel_radius_m", "half_wheelbase_m", "half_track_m", "mass_kg")
    part = small_command_runs(data, ROW_S)
    model = fitted_model(fit_dataset(part, FitOptions(starts=2, robot=robot, robot_given=given)))
    report = analyse(data, model, GapOptions(seconds=40.0, plant="planar", next_experiment=False))
    assert {"body_speed_limit", "body_acceleration_limit"} <= {found.name for found in report.effects}
    for name in ("speed_fl_rpm", "speed_fr_rpm", "speed_rl_rpm", "speed_rr_rpm"):
        assert report.channels[name].after <= 0.65 * report.channels[name].before


@pytest.mark.slow
def test_files_with_different_controllers_get_no_name(real_logs: Path) -> None:
    """No law and no effect fits files that were each recorded with other controller settings."""
    data = read_dataset(real_logs / "micromouse/closed_loop_left")
    model = fitted_model(fit_dataset(data, FitOptions(starts=1)))
    report = analyse(data, model, GapOptions(max_effects=2, next_experiment=False))
    assert report.verdict == "unexplained"
    assert report.effects == ()
    assert report.gap.after == report.gap.before
    assert any("fitted to these very logs" in note for note in report.notes)
