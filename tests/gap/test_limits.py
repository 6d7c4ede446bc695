"""The commands of an experiment: those that the logs show a platform to take, whatever the model assumes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.kinematics import command_to_wheels
from mecanum_env.model import Model
from sysid.gap.design.limits import Limits, limits_of
from sysid.gap.design.sequences import changed, library
from sysid.logs import BenchCommand, BodyCommand, Run, WheelCommand
from sysid.logs.runs import Command

ROW_S = 0.01


def run_of(command: Command, row_s: float = ROW_S) -> Run:
    time = np.arange(len(command.wheels_rpm)) * row_s
    return Run("a.csv", "a", "fit", time, command, {"speed_rpm": np.zeros(time.size)})


def bench_run(levels: list[float], hold_s: float) -> Run:
    return run_of(BenchCommand(np.repeat(levels, round(hold_s / ROW_S))))


def with_clock(model: Model, period_s: float) -> Model:
    return replace(model, wheel=replace(model.wheel, command_period_s=period_s))


def sequences(limits: Limits) -> list[np.ndarray]:
    rng = np.random.default_rng(0)
    found = library(limits, rng)
    return [*found, *(r for s in found * 3 if (r := changed(s, limits, rng)) is not None)]


def test_an_assumed_ceiling_and_clock_allow_nothing_that_the_logs_do_not(paper: Model) -> None:
    """A drive of 47 rpm whose link takes 50 ms; the model has a ceiling of 135 rpm and a period of 8 ms."""
    model = with_clock(paper, 1.0 / 120.0)
    assert model.wheel.saturation_rpm == 135.0
    limits = limits_of(model, [bench_run([0.0, 47.5, -20.0, 10.0, 0.0], 0.05), bench_run([0.0, 30.0], 1.0)])
    assert limits.limit_rpm == 47.5
    assert 0.05 <= limits.period_s < 0.07
    for rows in sequences(limits):
        assert np.max(np.abs(rows)) <= 47.5
        assert len(rows) * limits.period_s <= 6.0


def test_test_runs_and_single_runs_show_what_a_platform_takes(paper: Model) -> None:
    fast = replace(bench_run([0.0, 90.0, 0.0], 0.1), split="test")
    assert limits_of(paper, [bench_run([0.0, 40.0], 0.1), fast]).limit_rpm == 90.0


@pytest.mark.parametrize(
    ("clock_s", "hold_s", "wanted_s"),
    [
        (0.1, 0.1, 0.1),
        (0.1, 0.04, 0.1),
        (0.1, 0.25, 0.3),
        (0.1, 3.0, 0.5),
        (0.02, 0.1, 0.1),
        (1.0, 0.1, 1.0),
    ],
)
def test_commands_are_held_as_long_as_in_the_logs(
    paper: Model, clock_s: float, hold_s: float, wanted_s: float
) -> None:
    run = bench_run([0.0, 40.0, 0.0, 40.0, -40.0], hold_s)
    assert limits_of(with_clock(paper, clock_s), [run]).period_s == pytest.approx(wanted_s)


def test_two_commands_in_one_burst_are_no_clock(paper: Model) -> None:
    levels = np.repeat(np.arange(60.0) % 7.0, 10)
    levels[300] = 50.0
    assert limits_of(with_clock(paper, 0.01), [run_of(BenchCommand(levels))]).period_s == pytest.approx(0.1)


def test_logs_of_single_steps_leave_time_to_settle(paper: Model) -> None:
    assert limits_of(paper, [bench_run([0.0, 40.0], 0.5)]).period_s == pytest.approx(0.5)


@pytest.mark.parametrize("commands", ["body", "wheels"])
def test_a_robot_is_asked_for_no_more_speed_and_no_more_turning(paper: Model, commands: str) -> None:
    v, theta, vc = (np.repeat(x, 20) for x in ([0.0, 50.0, 30.0], [0.0, 90.0, 0.0], [0.0, 0.0, -20.0]))
    wheels = WheelCommand(command_to_wheels(v, theta, vc))
    limits = limits_of(paper, [run_of(BodyCommand(v, theta, vc) if commands == "body" else wheels)])
    for rows in sequences(limits):
        assert np.max(rows[:, 0]) <= 50.0
        assert np.max(np.abs(rows[:, 2])) <= 20.0
        assert np.max(np.abs(command_to_wheels(*rows.T))) <= 50.0 + 1e-9
    assert max(np.max(rows[:, 0]) for rows in sequences(limits)) == 50.0
    assert max(np.max(np.abs(rows[:, 2])) for rows in sequences(limits)) == 20.0


@pytest.mark.parametrize(("v", "vc"), [(50.0, 0.0), (0.0, 20.0), (0.0, 0.0)])
def test_a_robot_that_never_drove_or_turned_is_not_asked_to(paper: Model, v: float, vc: float) -> None:
    still = np.zeros(40)
    still[20:] = 1.0
    limits = limits_of(paper, [run_of(BodyCommand(v * still, 0.0 * still, vc * still))])
    assert all(np.max(rows[:, 0]) <= v for rows in sequences(limits))
    assert all(np.max(np.abs(rows[:, 2])) <= vc for rows in sequences(limits))


@pytest.mark.parametrize("period_s", [0.01, 0.04, 0.3, 0.5, 2.0])
def test_families_keep_their_rhythm_on_any_clock(period_s: float) -> None:
    """On a clock of 8 ms all of them were over in a blink, and on a slow one there were hardly two levels."""
    limits = Limits(100.0, period_s=period_s)
    found = library(limits, np.random.default_rng(0))
    lengths = [len(rows) * period_s for rows in found]
    assert 0.6 * 6.0 <= max(lengths) <= 6.0 + 1e-9
    assert len({rows.tobytes() for rows in found}) == len(found)
    assert all(len(np.unique(rows)) > 1 for rows in found)


def test_a_limit_between_two_commands_is_rounded_down() -> None:
    rows = np.concatenate(library(Limits(47.5, 2.0), np.random.default_rng(0)))
    assert math.isclose(np.max(np.abs(rows)), 46.0)
