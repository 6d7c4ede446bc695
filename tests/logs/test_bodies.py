"""Robots on other omni wheels: their logs wheel by wheel, and their body's motion."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.omni import OmniWheel, twist_to_speeds
from sysid.logs import read_dataset
from sysid.logs.__main__ import main
from sysid.logs.bodies import body_runs, body_table, read_measured, read_wheel_logs
from sysid.logs.writer import write_columns

Folder = Callable[[dict[str, str | bytes]], Path]
WHEELS = tuple(
    OmniWheel(name, angle, 0.135, 0.04) for name, angle in (("a", 60.0), ("b", 180.0), ("c", 300.0))
)
SLIP = np.array([0.9, 0.8, 1.0])


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    wheels = [
        {"name": one.name, "angle_deg": one.angle_deg, "distance_m": 0.135, "radius_m": 0.04}
        for one in WHEELS
    ]
    path = tmp_path / "robot.json"
    path.write_text(json.dumps({"wheels": wheels}))
    return path


@pytest.fixture
def logs(tmp_path: Path) -> Path:
    """Two runs of a robot whose wheels follow exactly, and whose body slips."""
    for index, twist in enumerate(([0.2, 0.0, 0.5], [0.1, -0.2, -1.0])):
        time = 0.02 * np.arange(100)
        twists = np.where(time[:, None] < 0.5, 0.0, np.array(twist))
        speeds = twist_to_speeds(twists, WHEELS)
        columns = {"time_s": time}
        for wheel, speed in zip(WHEELS, speeds.T, strict=True):
            columns |= {f"command_{wheel.name}_rpm": speed, f"speed_{wheel.name}_rpm": speed}
        columns |= dict(zip(("vx_m_s", "vy_m_s", "yaw_rate_rad_s"), (SLIP * twists).T, strict=True))
        write_columns(columns, tmp_path / "logs" / f"run_{index}.csv")
    return tmp_path / "logs"


def test_body_velocities_come_from_the_wheels_and_from_what_was_measured(logs: Path) -> None:
    runs = body_runs(read_wheel_logs([logs], WHEELS), WHEELS, read_measured(logs))
    np.testing.assert_allclose(runs[1].commanded[-1], [0.1, -0.2, -1.0], atol=1e-12)
    np.testing.assert_allclose(runs[1].turned, runs[1].commanded, atol=1e-12)
    np.testing.assert_allclose(runs[1].measured, SLIP * runs[1].turned, atol=1e-12)
    assert "left: commanded up to 0.2 m/s; from the wheels 1.0000 (rms" in body_table(runs)
    assert "measured 0.8000 (rms" in body_table(runs)


def test_every_wheel_and_direction_becomes_a_bench_log(
    logs: Path, robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["body", str(logs), "--robot", str(robot), "--out", str(tmp_path / "out")]) == 0
    assert "wheel_a, wheel_b, wheel_c, body_forward, body_left, body_turn" in capsys.readouterr().out
    wheel = read_dataset(tmp_path / "out" / "wheel_b")
    assert wheel.level == "bench"
    left = read_dataset(tmp_path / "out" / "body_left").runs[1]
    rim_rpm = -0.2 / 0.04 * 60.0 / (2.0 * np.pi)
    assert left.command.wheels_rpm[-1, 0] == pytest.approx(rim_rpm, abs=1e-3)
    assert left.channel("speed_rpm")[-1] == pytest.approx(0.8 * rim_rpm, abs=1e-3)


def test_folders_of_single_wheels_make_the_same_body(logs: Path, robot: Path, tmp_path: Path) -> None:
    main(["body", str(logs), "--robot", str(robot), "--out", str(tmp_path / "out")])
    folders = [tmp_path / "out" / f"wheel_{wheel.name}" for wheel in WHEELS]
    apart = body_runs(read_wheel_logs(folders, WHEELS), WHEELS, {})
    together = body_runs(read_wheel_logs([logs], WHEELS), WHEELS, {})
    for one, other in zip(apart, together, strict=True):
        np.testing.assert_array_equal(one.commanded, other.commanded)
        assert np.isnan(one.measured).all()


def test_wheels_that_the_logs_lack_are_refused(logs: Path) -> None:
    with pytest.raises(InputError, match="column command_d_rpm is missing, for wheel d of the robot"):
        read_wheel_logs([logs], (*WHEELS, OmniWheel("d", 0.0, 0.1, 0.04)))
    with pytest.raises(InputError, match="2 folders for 3 wheels"):
        read_wheel_logs([logs, logs], WHEELS)


def test_columns_of_other_wheels_are_refused_with_the_command_to_use(folder: Folder) -> None:
    text = "time_s,command_1_rpm,speed_1_rpm\n0,1,2\n1,1,2\n"
    with pytest.raises(InputError, match=r"of a robot on other wheels: python -m sysid\.logs body"):
        read_dataset(folder({"a.csv": text}))
