"""The package's own robot, changed by hand: the workflow still finds what it found.

No evidence of what it finds on other robots: that is `sysid.studies.zoo`.
"""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import pytest

from sysid.gap.result import GapOptions, GapReport
from sysid.gap.workflow import analyse

from .cases import CASES, logs_of, misfit, true_model
from .own_robots import nominal

PLAIN = GapOptions(next_experiment=False)


SEQUENCES = 5
"""Enough to see every change in the logs."""
FEW = ("mount_yaw", "track_width", "speed_gain", "wheel_gain_mismatch", "payload", "sensor_latency")
"""Effects of which a fast study considers each."""


def study(name: str, folder: Path, only: tuple[str, ...] = ()) -> GapReport:
    """Return the report of the study of a case's logs with the model of the robot as it was."""
    return analyse(logs_of(CASES[name], folder), nominal(), replace(PLAIN, only=only))


def test_the_changes_use_no_code_of_the_effects() -> None:
    tree = ast.parse((Path(__file__).parent / "own_robots.py").read_text(encoding="utf-8"))
    modules = {str(node.module) for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    ours = {module for module in modules if module.split(".")[0] in ("mecanum_env", "sysid")}
    assert ours == {"mecanum_env.mjcf", "mecanum_env.model", "mecanum_env.units"}


@pytest.mark.parametrize("name", [name for name, c in CASES.items() if c.truth and not c.gentle])
def test_the_effect_at_its_true_value_closes_the_log(name: str, tmp_path: Path) -> None:
    dataset = logs_of(CASES[name], tmp_path, SEQUENCES)
    assert misfit(nominal(), dataset) > 3.0
    assert misfit(true_model(CASES[name]), dataset) < 1.2


def test_the_unchanged_robot_is_predicted_to_its_noise(tmp_path: Path) -> None:
    assert misfit(nominal(), logs_of(CASES["quiet"], tmp_path, SEQUENCES)) < 1.1


@pytest.mark.parametrize(
    "only", [pytest.param(FEW, id="few effects"), pytest.param((), id="all", marks=pytest.mark.slow)]
)
def test_nothing_is_said_of_the_unchanged_robot(only: tuple[str, ...], tmp_path: Path) -> None:
    assert study("quiet", tmp_path, only).verdict == "no_gap"


@pytest.mark.parametrize(
    ("name", "only"),
    [
        pytest.param("turned_sensor", FEW, id="turned_sensor, few effects"),
        *(
            pytest.param(name, (), id=name, marks=pytest.mark.slow)
            for name in ("turned_sensor", "weak_motor", "load", "smooth_floor", "slow_wheels_turned_sensor")
        ),
    ],
)
def test_what_was_changed_is_named_with_its_size(name: str, only: tuple[str, ...], tmp_path: Path) -> None:
    report = study(name, tmp_path, only)
    truth = CASES[name].truth
    assert report.verdict == "named"
    found = {effect.name: effect.parameters for effect in report.effects}
    assert set(found) == set(truth)
    for effect, values in truth.items():
        for parameter, value in values.items():
            assert found[effect][parameter].value == pytest.approx(value, rel=0.1)


@pytest.mark.slow
def test_a_late_log_is_not_told_from_late_commands(tmp_path: Path) -> None:
    report = study("late_log", tmp_path)
    assert report.verdict == "ambiguous"
    assert set(report.candidates) == {("command_latency",), ("sensor_latency",)}


@pytest.mark.slow
def test_wind_is_seen_and_not_named(tmp_path: Path) -> None:
    assert study("wind", tmp_path).verdict == "unexplained"


def test_driving_straight_is_said_to_tell_nothing_of_the_width(tmp_path: Path) -> None:
    report = study("wide_robot_driven_straight", tmp_path, FEW)
    assert report.verdict == "no_gap"
    assert "track_width" in {entry.name for entry in report.untestable}
