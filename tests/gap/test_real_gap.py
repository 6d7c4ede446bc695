"""The gap workflow on recordings of real robots; skipped where they are not there."""

from pathlib import Path

import pytest

from mecanum_env.effects.friction import droop_rpm
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import Model, cause_of, read_robot
from sysid.compare.measured import small_command_runs
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.alone import law_of
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse
from sysid.logs import read_dataset

MOTORS = ("motor1", "motor2", "motor3")
ROW_S = 0.05
"""Between the rows of the husky's logs."""
PER_TURN = 6
"""Periods per turn of the Robotino's wheels on a floor."""
RIPPLES = ("torque_ripple", "encoder_eccentricity")


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


def change_of(robotino: Path, before: str, after: str, motor: str) -> GapReport:
    """Return the study of a motor's recording after a change, with the model fitted to the one before."""
    old, new = (read_dataset(robotino / name / motor) for name in (before, after))
    model = fitted_model(fit_dataset(old, FitOptions(starts=5)))
    return analyse(new, model, GapOptions(fitted_on=old, next_experiment=False))


def friction_rpm(model: Model) -> float:
    """Return what Coulomb friction takes from a motor's speed [rpm]."""
    return droop_rpm("coulomb_friction", model.effects.get("coulomb_friction", {}), model)


@pytest.mark.slow
@pytest.mark.parametrize("motor", MOTORS)
def test_a_drive_without_its_integral_term_shows_more_of_the_friction_it_had(
    robotino: Path, motor: str
) -> None:
    report = change_of(robotino, "bench_with_integral", "bench_without_integral", motor)
    # The motor's own friction is in the model that was fitted, as friction.
    assert friction_rpm(report.base) == pytest.approx(2.3, abs=0.5)
    assert "command_deadband/subtract" not in report.base.effects
    assert "coulomb_friction" in report.candidates[0]
    # 3.2 rpm at every speed without the integral term, 1.3 to 2.5 with it.
    assert friction_rpm(report.model) == pytest.approx(3.4, abs=0.6)
    assert report.gap.after < 0.95 * report.gap.before


@pytest.mark.slow
@pytest.mark.parametrize("motor", MOTORS)
def test_another_floor_takes_more_friction(robotino: Path, motor: str) -> None:
    """A ripple may be named beside it, at the six periods per turn that all motors show on the floors."""
    report = change_of(robotino, "floor_table", "floor_gray", motor)
    claims = {tuple(name for name in names if name not in RIPPLES) for names in report.candidates}
    assert ("coulomb_friction",) in claims
    assert claims <= {("coulomb_friction",), ("command_deadband",)}
    ripples = [values for name, values in report.model.effects.items() if cause_of(name) in RIPPLES]
    assert [values["per_turn"] for values in ripples] in ([], [PER_TURN])
    assert report.gap.after < 0.9 * report.gap.before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["micromouse/duty_left", "micromouse/duty_right"])
def test_the_micromouse_has_a_ceiling(real_logs: Path, name: str) -> None:
    data = read_dataset(real_logs / name)
    part = small_command_runs(data, min(run.median_interval_s for run in data.runs))
    model = fitted_model(fit_dataset(part, FitOptions(starts=5)))
    report = analyse(data, model, GapOptions(seconds=60.0, next_experiment=False))
    assert "speed_saturation" in report.candidates[0]
    assert report.gap.after < 0.6 * report.gap.before


@pytest.mark.slow
def test_the_law_of_one_recording_keeps_the_delays_of_its_link(robotino: Path) -> None:
    data = read_dataset(robotino / "bench_with_integral/motor1")
    law, options = law_of(data, GapOptions(next_experiment=False))
    assert set(law.effects) == {"command_latency/jitter"}
    assert any("coulomb_friction" in note for note in options.notes)
