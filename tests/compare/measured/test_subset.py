"""Runs, or pieces of runs, that decide: all of them, or those that cover the commanded speeds."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.measured import most_active_runs, select_runs, small_command_runs
from sysid.compare.measured.subset import BEFORE_S, PIECE_S, pieces
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, Split

PERIOD_S = 0.1
MODEL = paper_model()


def held(levels: list[float], hold_s: float, split: Split = "fit", name: str = "long") -> Run:
    """Return a bench run of held commands whose speed is that command, and whose clock is 0.05 s."""
    time = np.arange(round(len(levels) * hold_s / 0.05)) * 0.05
    command = np.array(levels)[np.minimum((time / hold_s + 1e-9).astype(int), len(levels) - 1)]
    return Run(f"{name}.csv", name, split, time, BenchCommand(command), {"speed_rpm": command.copy()})


def test_pieces_are_the_run_cut_before_changes_of_command() -> None:
    run = held([10.0, -20.0, 30.0, -40.0, 50.0, 60.0], 6.0)
    cut = list(pieces(run, PERIOD_S))
    np.testing.assert_array_equal(
        np.concatenate([p.channels["speed_rpm"] for p in cut]), run.channels["speed_rpm"]
    )
    assert [p.group for p in cut] == [f"long, piece {i}" for i in range(len(cut))]
    assert all(p.file == "long.csv" and p.time_s[0] == 0.0 and p.duration_s >= PIECE_S - 0.1 for p in cut)
    for before, after in pairwise(cut):
        change = after.command_changes()[0][1]
        assert BEFORE_S <= change < BEFORE_S + 2 * PERIOD_S  # it has settled, and the command soon changes
        assert after.command.wheels_rpm[0] == before.command.wheels_rpm[-1]


def test_pieces_keep_the_clock_of_the_commands() -> None:
    run = held([10.0, -20.0, 30.0, -40.0], 6.35)
    starts = np.cumsum([0.0, *(p.time_s.size * 0.05 for p in pieces(run, PERIOD_S))])[:-1]
    assert len(starts) > 2
    np.testing.assert_allclose(starts, np.rint(starts / PERIOD_S) * PERIOD_S, atol=1e-9)


def test_a_robots_commands_are_cut_with_it() -> None:
    time = np.arange(0.0, 24.0, 0.05)
    v = np.where(time < 12.0, 20.0, 80.0)
    run = Run("r.csv", "r", "fit", time, BodyCommand(v, 0.0 * v, -v), {"yaw_rate_rad_s": v})
    cut = list(pieces(run, PERIOD_S))
    assert len(cut) == 2
    rotations = [p.command.columns()["command_vc_rpm"] for p in cut]
    np.testing.assert_array_equal(np.concatenate(rotations), -v)


def test_runs_that_fit_are_all_taken_whole() -> None:
    runs = (held([10.0, 20.0], 15.0), held([-10.0], 3.0, "validation", "short"))
    assert select_runs(runs, 33.0, PERIOD_S) == runs


def test_the_most_active_groups_of_every_split_are_kept_whole() -> None:
    calm, wild = held([0.0, 10.0], 1.0, name="calm"), held([0.0, 100.0], 1.0, name="wild")
    runs = (calm, wild, held([0.0, 50.0], 1.0, "validation", "held"))
    assert [run.group for run in most_active_runs(runs, 4.0)] == ["wild", "held"]
    assert most_active_runs(runs, 100.0) == runs


def test_short_runs_are_never_cut() -> None:
    runs = [held([10.0 * i, -10.0 * i], 1.5, name=f"{i}") for i in range(1, 9)]
    chosen = select_runs(runs, 10.0, PERIOD_S)
    assert len(chosen) == 3
    assert all(run in runs for run in chosen)


def test_of_runs_that_hold_one_command_each_those_are_taken_that_cover_the_speeds() -> None:
    """As the logs of a robot that starts once in each run: the first runs by name are the slowest."""
    levels = [0.0, 10.0, -10.0, 20.0, -20.0, 40.0, -40.0, 80.0, -80.0, 78.0, 79.0]
    runs = [held([level], 3.0, name=f"{i:02d}") for i, level in enumerate(levels)]
    chosen = {run.command.wheels_rpm[0, 0] for run in select_runs(runs, 21.0, PERIOD_S)}
    assert chosen == {80.0, -80.0, 40.0, -40.0, 20.0, -20.0, 10.0}


def test_a_start_from_rest_is_a_change_of_the_command() -> None:
    slow, fast = held([10.0], 1.0, name="a"), held([90.0], 1.0, name="b")
    assert most_active_runs([slow, fast], 1.0) == (fast,)


def test_pieces_cover_the_speeds_before_they_repeat_one() -> None:
    # The livelier two thirds go to and fro between two speeds only.
    levels = [100.0, -100.0] * 8 + [20.0, 45.0, 70.0, 45.0, 20.0, -20.0, -45.0, -70.0]
    runs = [held(levels, 6.0), held(levels[::-1], 6.0, "validation", "other")]
    chosen = select_runs(runs, 70.0, PERIOD_S)
    assert sum(run.duration_s for run in chosen) <= 70.0
    for split in ("fit", "validation"):
        seen = {float(x) for run in chosen if run.split == split for x in np.unique(run.command.wheels_rpm)}
        assert {100.0, -100.0} < seen
        assert len(seen) >= 6
    lively = most_active_runs([p for run in runs for p in pieces(run, PERIOD_S)], 70.0)
    assert {float(x) for run in lively for x in np.unique(run.command.wheels_rpm)} == {100.0, -100.0}


def test_an_effect_is_found_in_pieces_of_long_runs() -> None:
    rng = np.random.default_rng(5)
    true = MODEL.with_effect("speed_saturation", limit_rpm=80.0)
    runs = []
    splits: tuple[Split, ...] = ("fit", "validation", "test")
    for i, split in enumerate(splits):
        levels = [0.0, *np.rint(rng.uniform(-120.0, 120.0, 5)).tolist()]
        run = held(levels, 5.0, split, f"{i}")
        speed = replay_bench(true, run.time_s, run.command.wheels_rpm[:, 0])
        measured = {"speed_rpm": speed + 0.5 * rng.standard_normal(speed.size)}
        runs.append(Run(run.file, run.group, run.split, run.time_s, run.command, measured))
    options = GapOptions(only=("speed_saturation",), seconds=20.0, next_experiment=False)
    report = analyse(runs, MODEL, options)
    assert [found.name for found in report.effects] == ["speed_saturation"]
    assert report.effects[0].parameters["limit_rpm"].value == pytest.approx(80.0, abs=1.0)
    assert any("pieces of the runs" in note for note in report.notes)
    assert report.gap.after < 0.6


def test_the_time_that_decides_is_above_nothing() -> None:
    logs = Dataset("logs", (held([10.0, 20.0], 2.0),), ())
    with pytest.raises(Exception, match=r"seconds = 0, must be above 0"):
        analyse(logs, MODEL, GapOptions(seconds=0.0))


def test_runs_of_small_commands_keep_their_splits() -> None:
    loud = held([0.0, 100.0, -90.0], 3.0, name="loud")
    calm = held([0.0, 50.0, -40.0], 3.0, "validation", "calm")
    long = held([20.0, 30.0, -30.0, 95.0, 100.0, 100.0], 6.0)
    test = held([0.0, 10.0], 3.0, "test", "test")
    logs = Dataset("logs", (loud, calm, long, test), (), "sha")
    kept = small_command_runs(logs, PERIOD_S)
    assert {run.split for run in kept.runs} == {"fit", "validation"}
    assert max(float(np.max(np.abs(run.command.wheels_rpm))) for run in kept.runs) == 50.0
    assert "calm" in {run.group for run in kept.runs}
    assert kept.sha256 != logs.sha256
    only_loud = Dataset("logs", (loud, test), (), "sha")
    assert small_command_runs(only_loud, PERIOD_S) is only_loud
