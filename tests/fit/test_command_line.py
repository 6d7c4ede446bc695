"""`python -m sysid.fit`: files written, contract kept, bad input refused with nothing written."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.cli import run
from mecanum_env.model import Model, read_model
from mecanum_env.simulator.bench import replay_bench
from sysid.fit.__main__ import fit
from sysid.logs import Dataset
from sysid.logs.writer import write_dataset

CONTRACT = ("rms_rpm", "max_error_rpm", "rise_time_s", "settling_time_s", "relative_steady_state_error",
            "poles", "stable", "starts", "success_rate", "seconds", "peak_memory_mib")  # fmt: skip


def test_the_example_logs_become_a_model(
    examples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(fit, [str(examples), "--out", str(tmp_path), "--starts", "2"]) == 0
    assert {path.name for path in tmp_path.iterdir()} >= {"model.json", "fit.json", "fit.png", "report.html"}
    said = capsys.readouterr()
    assert "output-error" in said.out
    assert "\r" not in said.err  # no bar where nobody watches
    assert said.err.count("\n") >= 4

    figures = json.loads((tmp_path / "fit.json").read_text())
    method = figures["methods"][figures["method"]]
    assert set(CONTRACT) <= set(method)
    assert set(method["rms_rpm"]) == set(method["max_error_rpm"]) == {"fit", "validation", "test"}
    assert method["stable"] is True
    for name in "ABCDEF":
        assert {"value", "standard_error", "cramer_rao_bound"} <= set(figures["parameters"][name])

    model = read_model(tmp_path / "model.json")
    assert dict(model.effects) == {}
    assert model.wheel.law.dc_gain == pytest.approx(1.0, abs=1e-12)
    time = np.arange(0.0, 1.5, 0.01)
    speed = replay_bench(model, time, np.where(time < 0.1, 0.0, 80.0))
    assert speed[-1] == pytest.approx(80.0, abs=0.5)


def test_a_robot_file_fills_the_model(bench: Callable[..., Dataset], tmp_path: Path) -> None:
    write_dataset(bench(), tmp_path / "logs")
    known = tmp_path / "robot.json"
    known.write_text('{"mass_kg": 31.5, "servo_n_m_s_rad": 3.0}')
    out = tmp_path / "out"
    quick = ["--starts", "1", "--effects", "off"]
    assert run(fit, [str(tmp_path / "logs"), "--robot", str(known), "--out", str(out), *quick]) == 0
    robot = read_model(out / "model.json").robot
    assert (robot.mass_kg, robot.servo_n_m_s_rad, robot.wheel_radius_m) == (31.5, 3.0, 0.0762)


def test_free_gain_is_free(bench: Callable[..., Dataset], tmp_path: Path) -> None:
    write_dataset(bench(), tmp_path / "logs")
    arguments = [str(tmp_path / "logs"), "--free-gain", "--out", str(tmp_path / "out")]
    assert run(fit, [*arguments, "--starts", "1", "--effects", "off"]) == 0
    gain = read_model(tmp_path / "out" / "model.json").wheel.law.dc_gain
    assert gain == pytest.approx(1.0, abs=0.01)
    assert gain != 1.0


def test_each_wheel_gets_its_law_on_request(
    paper: Model, robot_logs: Callable[..., Dataset], tmp_path: Path
) -> None:
    write_dataset(robot_logs(paper, runs=3, seconds=2.0), tmp_path / "logs")
    arguments = [str(tmp_path / "logs"), "--per-wheel", "--starts", "1", "--out", str(tmp_path / "out")]
    assert run(fit, arguments) == 0
    assert set(read_model(tmp_path / "out" / "model.json").wheels) == {"fl", "fr", "rl", "rr"}
    # Channels keep the order of the log, so that sums over them have the same digits in every process.
    noise = json.loads((tmp_path / "out" / "fit.json").read_text())["noise"]["sigma_rpm"]
    assert list(noise) == [f"speed_{wheel}_rpm" for wheel in ("fl", "fr", "rl", "rr")]


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--method", "magic"], "method 'magic': unknown"),
        (["--starts", "0"], "must be at least 1"),
        (["--seed", "-1"], "seed = -1, must be at least 0"),
        (["--delay", "9.0"], "delay_s = 9"),
        (["--command-period", "-1"], "must be above 0"),
        (["--robot", "no.json"], "cannot be read"),
        (["--per-wheel"], "these are logs of one wheel on the bench"),
    ],
)
def test_bad_arguments_leave_an_earlier_result_alone(
    examples: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], extra: list[str], message: str
) -> None:
    earlier = tmp_path / "model.json"
    earlier.write_text("precious")
    assert run(fit, [str(examples), "--out", str(tmp_path), "--starts", "1", *extra]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert len(errors) == 1
    assert message in errors[0]
    assert earlier.read_text() == "precious"
    assert [path.name for path in tmp_path.iterdir()] == ["model.json"]


def test_bad_logs_are_refused_with_their_place(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    logs = tmp_path / "logs"
    logs.mkdir()
    (logs / "a.csv").write_text("time_s,command_rpm,speed_rpm\n0,0,0\n0.1,40,fast\n")
    assert run(fit, [str(logs), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "a.csv" in error
    assert "fast" in error
    assert not (tmp_path / "out").exists()
