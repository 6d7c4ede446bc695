"""A planned session: what its commands cover, what is written, and that a drive recorded with it is
identified."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.kinematics import command_to_wheels
from mecanum_env.law import WheelLaw
from mecanum_env.model import robot_from_dict
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.logs import read_dataset
from sysid.logs.__main__ import main
from sysid.logs.plan.layout import Plan, make_plan
from sysid.logs.plan.protocol import command_columns, recordings, write_plan
from sysid.logs.plan.sequences import Form, Size, _reach_m
from sysid.logs.writer import write_columns
from sysid.studies.synthetic import random_stable_law

PERIOD_S = 1.0 / 120.0


def record(plan: Plan, law: WheelLaw, folder: Path, rng: np.random.Generator) -> None:
    """Play every command of a plan on a drive and log it at 120 Hz, with the noise that the plan assumes."""
    for file, sequence in recordings(plan):
        ticks = round(plan.size.period_s / PERIOD_S)
        command = np.repeat(sequence.commands[:, 0], ticks)
        speed = law.simulate(np.clip(command, -plan.size.top_rpm, plan.size.top_rpm))[:-1]
        noisy = speed + plan.noise_rpm * rng.standard_normal(speed.size)
        columns = {"time_s": PERIOD_S * np.arange(speed.size), "command_rpm": command, "speed_rpm": noisy}
        write_columns(columns, folder / "logs" / file)


def test_a_drive_recorded_as_planned_is_identified_within_the_precision(tmp_path: Path) -> None:
    plan = make_plan(Size(rise_s=0.05))
    write_plan(plan, tmp_path / "plan")
    rng = np.random.default_rng(1)
    law = random_stable_law(rng, PERIOD_S)
    record(plan, law, tmp_path / "plan", rng)
    dataset = read_dataset(tmp_path / "plan" / "logs")
    # Without the long holds, which are for slow effects; this drive has none.
    short = replace(dataset, runs=tuple(run for run in dataset.runs if run.duration_s < 60.0))
    options = FitOptions(starts=1, delay_s=0.0, effects="off", command_period_s=plan.size.period_s)
    found = fit_dataset(short, options)
    step = np.concatenate([np.full(120, 1.0), np.full(120, -0.5)])
    error = found.law.simulate(step) - law.simulate(step)
    assert 100.0 * math.sqrt(float(np.mean(error**2))) < plan.precision_percent
    assert fitted_model(found).wheel.saturation_rpm == pytest.approx(plan.size.top_rpm, rel=0.02)


@pytest.mark.parametrize("form", ["bench", "floor"])
def test_a_plan_covers_what_the_law_and_its_effects_need(form: Form) -> None:
    size = Size(form=form)
    plan = make_plan(size)
    fitted = np.concatenate([one.wheels_rpm(size) for one in plan.sequences if one.split == "fit"])
    share = fitted / size.top_rpm
    moving = share[np.concatenate([[True], np.diff(share) != 0.0])]
    assert share.max() >= 1.0, "the ceiling"
    assert share.min() <= -0.9
    assert np.sum(np.abs(moving[moving != 0.0]) < 0.05) >= 4, "the dead zone"
    assert np.sum(moving[1:] * moving[:-1] < 0.0) >= 20, "reversals"
    holds = np.diff(np.flatnonzero(np.concatenate([[True], np.diff(share) != 0.0, [True]]))) * size.period_s
    assert holds.min() <= 2.0 * size.period_s + 1e-9
    assert holds.max() >= 30.0, "slow effects"
    assert np.unique(holds.round(3)).size >= 8, "the delay"
    assert {one.split for one in plan.sequences} == {"fit", "validation", "test"}
    assert all(np.all(one.commands[0] == 0.0) and np.all(one.commands[-1] == 0.0) for one in plan.sequences)


def test_the_held_out_commands_are_new() -> None:
    plan = make_plan(Size())
    rows = {one.name: one.commands.tobytes() for one in plan.sequences}
    assert len(set(rows.values())) == len(rows)


def test_the_files_of_commands_hold_each_command_until_the_next_row() -> None:
    size = Size(period_s=0.05)
    (sequence, *_) = make_plan(size).sequences
    columns = command_columns(sequence, size)
    time = size.period_s * np.arange(len(sequence.commands))
    rows = np.searchsorted(columns["time_s"], time + 1e-6, side="right") - 1
    np.testing.assert_array_equal(columns["command_rpm"][rows], sequence.commands[:, 0])
    assert columns["time_s"][-1] == pytest.approx(sequence.duration_s(size))


def test_a_floor_plan_stays_in_its_room_and_below_the_wheels_top_speed() -> None:
    size = Size(form="floor", room_m=2.2)
    for one in make_plan(size).sequences:
        assert _reach_m(size, one.commands) <= size.room_m / 2.0 + 0.05
        assert np.abs(command_to_wheels(*one.commands.T)).max() <= 1.07 * size.top_rpm


def test_more_noise_or_precision_makes_a_longer_plan_and_time_is_filled() -> None:
    size = Size()
    short = make_plan(size)
    longer = make_plan(size, noise_rpm=10.0, precision_percent=0.8)
    assert max(short.errors_percent.values()) <= 1.0
    assert max(longer.errors_percent.values()) <= 0.8
    assert longer.minutes > short.minutes
    assert 18.0 < make_plan(size, minutes=20.0).minutes <= 20.0


def test_everything_is_written_and_read_back(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "plan"
    assert main(["plan", "--top-speed", "20", "--out", str(out)]) == 0
    assert "read" in capsys.readouterr().out
    page = (out / "PROTOCOL.md").read_text()
    assert "| `test` |" in page
    assert "python -m sysid.fit logs --out fit" in page
    assert sorted(path.stem for path in (out / "commands").iterdir())[:2] == ["holds", "levels"]


REFUSED = {
    "--minutes 2": "--minutes 2: the shortest plan takes",
    "--precision 0.0001": "--precision 0.0001: ",
    "--precision 0.0001 --minutes 12": "give a longer --minutes, or a coarser --precision",
    "--top-speed 0": "--top-speed 0, must be a number from 1 to 100000",
    "--period nan": "--period nan, must be a number from 0.001 to 1",
    "--noise inf": "--noise inf, must be a number above 0",
    "--form floor --room 1": "--room 1: at 135 rpm the robot goes 0.97 m before its speed has settled",
}


@pytest.mark.parametrize("options", REFUSED)
def test_a_plan_that_cannot_be_is_refused(
    options: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["plan", *options.split(), "--out", str(tmp_path / "plan")]) == 2
    message = capsys.readouterr().err
    assert REFUSED[options] in message
    assert message.count("\n") == 1
    assert not (tmp_path / "plan").exists()


def test_a_floor_plan_of_other_wheels_is_refused() -> None:
    wheels = [{"angle_deg": 120.0 * i, "distance_m": 0.1, "radius_m": 0.04} for i in range(3)]
    with pytest.raises(InputError, match="floor plans are for robots of four Mecanum wheels"):
        Size(form="floor", robot=robot_from_dict({"wheels": wheels}))


def test_logs_are_drawn(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "logs"
    for name in ("a_r1", "a_r2", "b"):
        command = np.repeat([0.0, 40.0 if name == "b" else 60.0], 20)
        write_columns(
            {"time_s": 0.01 * np.arange(40), "command_rpm": command, "speed_rpm": 0.9 * command},
            path / f"{name}.csv",
        )
    assert main(["plot", str(path), "--out", str(tmp_path / "logs.png")]) == 0
    assert (tmp_path / "logs.png").read_bytes().startswith(b"\x89PNG")
    assert main(["plot", str(path), "--out", str(tmp_path / "logs.txt")]) == 2
    assert "a picture's name must end in .png, .svg, .pdf" in capsys.readouterr().err
