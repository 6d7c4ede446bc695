"""Columns that are not what their place says, positions or other units: each refusal says what to do."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.units import RAD_S_PER_RPM
from sysid.logs import Dataset, Run, read_dataset
from sysid.logs.checks import dataset_findings, run_findings
from sysid.logs.quantities import require_our_units, require_speeds

Folder = Callable[[dict[str, str | bytes]], Path]
BenchRun = Callable[..., Run]
LEVELS = np.repeat([0.0, 40.0, -60.0, 90.0, 20.0, -30.0, 70.0, 0.0], 100)


def lagged(values: np.ndarray) -> np.ndarray:
    """Follow values at 100 Hz with a time constant of 0.08 s."""
    out = np.zeros(values.size)
    for k in range(values.size - 1):
        out[k + 1] = out[k] + (values[k] - out[k]) / 8.0
    return out


POSITIONS = {
    "time_s,command_deg,position_deg": "column 'command_deg' is a position in degrees",
    "time_s,command_rad,speed_rpm": "column 'command_rad' is a position in rad",
    "time_s,command_rpm,position_deg": "column 'position_deg' is a position in degrees",
    "time_s,goal_position,present_position": "column 'goal_position' is a position",
    "time_s,command_rpm,encoder_ticks": "column 'encoder_ticks' is a position in counts",
}


@pytest.mark.parametrize("header", POSITIONS)
def test_a_position_is_refused_with_what_to_convert(folder: Folder, header: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_dataset(folder({"run.csv": f"{header}\n0,0,0\n1,1,1\n"}))
    message = str(refusal.value)
    assert f"run.csv, line 1: {POSITIONS[header]}, and a wheel law follows speeds" in message
    assert "\n" not in message


def test_the_refusal_of_a_position_names_the_column_and_the_factor(folder: Folder) -> None:
    with pytest.raises(InputError, match=r"its change per second \[deg/s\] times 0.166666667 is command_rpm"):
        read_dataset(folder({"run.csv": "time_s,command_deg,speed_rpm\n0,0,0\n1,1,1\n"}))


def test_a_position_is_refused_when_dataset_toml_calls_it_a_speed(folder: Folder) -> None:
    toml = '[columns]\ncommand_rpm = { from = "command_deg", scale = 0.1 }\n'
    files: dict[str, str | bytes] = {"a.csv": "time_s,command_deg,speed_rpm\n0,0,0\n1,1,1\n"}
    with pytest.raises(InputError, match="column 'command_deg' is a position in degrees"):
        read_dataset(folder({**files, "dataset.toml": toml}))


def test_a_position_beside_speeds_may_be_ignored(folder: Folder, step: str) -> None:
    text = "\n".join(f"{line},{'position_deg' if i == 0 else i}" for i, line in enumerate(step.splitlines()))
    toml = '[dataset]\nignore_columns = ["position_deg"]\n'
    assert len(read_dataset(folder({"a.csv": text, "dataset.toml": toml})).runs) == 1


UNITS = {
    "time_s,command_rpm,speed_rad_s": 'rad/s, must be rpm: speed_rpm = { from = "speed_rad_s", scale = 9.549',
    "time_s,command_deg_s,speed_rpm": 'must be rpm: command_rpm = { from = "command_deg_s", scale = 0.16',
    "time_ms,command_rpm,speed_rpm": 'ms, must be s: time_s = { from = "time_ms", scale = 0.001 }',
    "timestamp_ns,command_rpm,speed_rpm": 'ns, must be s: time_s = { from = "timestamp_ns", scale = 1e-09 }',
    "time_s,command_rpm,omega_rad_s": 'rad/s, must be rpm: speed_rpm = { from = "omega_rad_s", scale = 9.549',
    "time_s,command_fl_rad_s,speed_fl_rpm": 'command_fl_rpm = { from = "command_fl_rad_s", scale = 9.549',
    "time_s,vx_mm_s,vy_m_s": 'mm/s, must be m/s: vx_m_s = { from = "vx_mm_s", scale = 0.001 }',
}


@pytest.mark.parametrize("header", UNITS)
def test_a_unit_in_a_name_is_refused_with_its_factor(folder: Folder, header: str) -> None:
    with pytest.raises(InputError) as refusal:
        read_dataset(folder({"run.csv": f"{header}\n0,0,0\n1,1,1\n"}))
    assert UNITS[header] in str(refusal.value)
    assert "under [columns] in dataset.toml" in str(refusal.value)


def test_the_line_that_the_refusal_proposes_is_read(folder: Folder) -> None:
    toml = '[columns]\nspeed_rpm = { from = "speed_rad_s", scale = 9.549296585513721 }\n'
    path = folder({"a.csv": "time_s,command_rpm,speed_rad_s\n0,0,0\n1,60,6.2831853\n", "dataset.toml": toml})
    assert read_dataset(path).runs[0].channel("speed_rpm")[1] == pytest.approx(60.0)


@pytest.mark.parametrize("shape", ["steps", "waves"])
def test_a_command_that_the_turned_angle_follows_is_a_position(bench_run: BenchRun, shape: str) -> None:
    time = 0.01 * np.arange(LEVELS.size)
    command = LEVELS if shape == "steps" else 50.0 * np.sin(2.0 * time)
    angle = lagged(command)
    speed = np.gradient(angle, time) / 6.0
    with pytest.raises(InputError, match="command_rpm looks like a position: the angle that"):
        require_speeds([bench_run("servo.csv", command, speed)])


@pytest.mark.parametrize("delay", [0, 20, 40])
def test_a_command_that_the_speed_follows_is_none(bench_run: BenchRun, delay: int) -> None:
    late = np.concatenate([np.zeros(delay), LEVELS])[: LEVELS.size]
    noise = np.random.default_rng(3).standard_normal(LEVELS.size)
    require_speeds(
        [
            bench_run("a.csv", LEVELS, lagged(late) + noise),
            bench_run("still.csv", LEVELS, np.zeros(LEVELS.size)),
            bench_run("held.csv", np.full(50, 40.0)),
        ]
    )


def dataset(run: Run) -> Dataset:
    return Dataset("mine", (run,), (*run_findings(run), *dataset_findings([run])))


def test_data_in_rad_per_s_are_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", LEVELS, RAD_S_PER_RPM * lagged(LEVELS))
    with pytest.raises(InputError, match=r"mine: speed_rpm is 0\.10\d times .* \(scale = 9\.549"):
        require_our_units(dataset(run))


def test_stamps_in_milliseconds_are_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", LEVELS, lagged(LEVELS), time_s=10.0 * np.arange(LEVELS.size))
    with pytest.raises(InputError, match=r"milliseconds\? \(scale = 0\.001\)"):
        require_our_units(dataset(run))


def test_data_in_our_units_are_fitted(bench_run: BenchRun) -> None:
    require_our_units(dataset(bench_run("a.csv", LEVELS, lagged(LEVELS))))


def test_commands_and_speeds_in_rad_per_s_are_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", np.round(RAD_S_PER_RPM * LEVELS, 4), RAD_S_PER_RPM * lagged(LEVELS))
    with pytest.raises(InputError, match=r"command_rpm has whole numbers of rpm in rad/s; .*scale = 9\.549"):
        require_our_units(dataset(run))


def test_commands_that_are_no_whole_numbers_are_fitted(bench_run: BenchRun) -> None:
    odd = LEVELS + 0.37 * np.sign(LEVELS)
    require_our_units(dataset(bench_run("a.csv", odd, lagged(odd))))


def test_a_command_that_is_a_duty_is_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", LEVELS / 135.0, lagged(LEVELS))
    with pytest.raises(InputError, match=r"is the command a duty, a voltage .*\(scale = 1[34]\d"):
        require_our_units(dataset(run))


def test_a_motor_before_its_gear_is_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", LEVELS, lagged(LEVELS) / 30.0)
    with pytest.raises(InputError, match=r"is speed_rpm a duty, .* motor's speed\? \(scale = (29|30)"):
        require_our_units(dataset(run))


def test_a_wheel_that_turns_against_its_command_is_not_fitted(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", LEVELS, -lagged(LEVELS))
    with pytest.raises(InputError, match=r"is the sign reversed\? \(scale = -1\); give it as the column's"):
        require_our_units(dataset(run))


def test_a_wheel_that_never_turns_has_no_unit(bench_run: BenchRun) -> None:
    require_our_units(dataset(bench_run("a.csv", LEVELS, np.zeros(LEVELS.size))))


FINER = {
    **{"slow ms": (200, "0.001"), "fast us": (1000, "1e-06")},
    **{"us": (10_000, "1e-06"), "ns": (10_000_000, "1e-09")},
}


@pytest.mark.parametrize(("interval", "scale"), FINER.values(), ids=FINER)
def test_stamps_in_finer_units_are_refused_with_the_scale(folder: Folder, interval: int, scale: str) -> None:
    speed = np.round(lagged(LEVELS), 3)
    rows = [f"{i * interval},{LEVELS[i]:g},{speed[i]}" for i in range(LEVELS.size)]
    with pytest.raises(InputError, match=rf"a\.csv.*seconds\? \(scale = {scale}\)"):
        require_our_units(read_dataset(folder({"a.csv": "\n".join(["time_s,command_rpm,speed_rpm", *rows])})))


@pytest.mark.parametrize("column", ["command_rpm", "speed_rpm"])
def test_a_number_that_is_none_of_a_robot_is_refused(bench_run: BenchRun, column: str) -> None:
    values = {"command_rpm": LEVELS, "speed_rpm": lagged(LEVELS)}
    values[column] = np.where(np.arange(LEVELS.size) == 50, -1e30, values[column])
    logs = Dataset("made", (bench_run("a.csv", values["command_rpm"], values["speed_rpm"]),), ())
    with pytest.raises(
        InputError, match=rf"a.csv: {column} = -1e\+30 at 0.5 s after the first row, must be at"
    ):
        require_our_units(logs)
