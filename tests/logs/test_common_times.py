"""When commands were given, told by all repeats together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.measured import pieces
from sysid.gap import workflow
from sysid.gap.result import GapOptions
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run, read_dataset
from sysid.logs.common_times import with_common_times

ROW_S = 0.02
_PAPER = paper_model()
WHEEL = replace(_PAPER, wheel=replace(_PAPER.wheel, command_period_s=1.0 / 480.0))
"""The paper's wheel with a drive that takes a command at any time."""
SENT_S = np.array([0.2, 0.7, 1.2, 1.6])
"""Multiples of a row, so that jitter decides which row shows a command."""
LEVELS = np.array([0.0, 80.0, -40.0, 110.0, 20.0])


def run(seed: int, name: str = "", sent_s: np.ndarray = SENT_S, *, own: bool = False) -> Run:
    """Return a run that was sent its commands at some times and shows them in the first row after these.

    A run with its `own` times was sent each of them when its rows show it.
    """
    rng = np.random.default_rng(seed)
    time = np.append(0.0, ROW_S * np.arange(1, 110) + 4e-4 * rng.standard_normal(109))
    shown = LEVELS[np.searchsorted(sent_s, time, side="right")]
    if own:
        sent_s = time[np.flatnonzero(np.diff(shown)) + 1]
    clock = np.arange(0.0, 2.3, 1e-3)
    fine = replay_bench(WHEEL, clock, LEVELS[np.searchsorted(sent_s, clock, side="right")])
    speed = np.interp(time, clock, fine) + 0.3 * rng.standard_normal(time.size)
    return Run(name or f"{seed}.csv", "a", "fit", time, BenchCommand(shown), {"speed_rpm": speed})


def logs(*runs: Run) -> Dataset:
    return Dataset("rows", runs, ())


def test_repeats_that_show_a_command_a_row_apart_were_given_it_at_one_time() -> None:
    plain = logs(*map(run, range(4)))
    assert np.ptp([one.command_changes()[0] for one in plain.runs], axis=0).max() > 0.9 * ROW_S
    (timed,) = with_common_times(plain)
    changes = [one.command_changes()[0][1:] for one in timed.runs]
    assert np.ptp(changes, axis=0).max() == 0.0
    np.testing.assert_allclose(changes[0], SENT_S, atol=2e-3)


def test_a_folder_is_read_with_the_times_of_all_its_repeats(tmp_path: Path) -> None:
    for one in map(run, range(4)):
        columns = zip(one.time_s, one.command.wheels_rpm[:, 0], one.channels["speed_rpm"], strict=True)
        rows = ["time_s,command_rpm,speed_rpm", *(f"{t:.6f},{c:g},{v:.3f}" for t, c, v in columns)]
        (tmp_path / one.file).write_text("\n".join(rows) + "\n", encoding="utf-8")
    changes = [one.command_changes()[0] for one in read_dataset(tmp_path).runs]
    assert np.ptp(changes, axis=0).max() == 0.0


def test_a_study_beside_the_fit_takes_the_times_of_both_logs() -> None:
    late = [seed for seed in range(60) if run(seed).command_changes()[0][1] > SENT_S[0] + 0.5 * ROW_S]
    early = [seed for seed in range(60) if seed not in late]
    before, after = logs(*map(run, late[:4])), logs(*map(run, early[:4]))
    before = replace(before, sha256="before")
    other = [replace(r, group="b", split="validation", file=f"b{r.file}") for r in after.runs]
    after = replace(after, runs=(*after.runs, *other), sha256="after")
    seen: list[Dataset] = []

    def stop(dataset: Dataset, _model: Model, options: GapOptions, *_: object) -> NoReturn:
        assert options.fitted_on is not None
        seen.extend((dataset, options.fitted_on))
        raise InterruptedError

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(workflow, "_analyse", stop)
        with pytest.raises(InterruptedError):
            workflow.analyse(after, WHEEL, GapOptions(fitted_on=before))
    times = [one.command_changes()[0] for dataset in seen for one in dataset.runs]
    assert np.ptp(times, axis=0).max() == 0.0


def test_repeats_that_move_when_they_show_a_command_keep_their_times() -> None:
    plain = logs(*(run(seed, own=True) for seed in range(4)))
    assert with_common_times(plain)[0] is plain


def test_logs_of_the_fit_and_new_ones_tell_the_times_together() -> None:
    late = [seed for seed in range(20) if run(seed).command_changes()[0][1] > SENT_S[0] + 0.5 * ROW_S]
    early = [seed for seed in range(20) if seed not in late]
    before, after = logs(*map(run, late[:3])), logs(*map(run, early[:3]))
    timed = with_common_times(before, after)
    times = [one.command_changes()[0] for dataset in timed for one in dataset.runs]
    assert np.ptp(times, axis=0).max() == 0.0


def test_other_commands_are_no_repeats() -> None:
    other = run(5, sent_s=SENT_S + 3.0 * ROW_S)
    (timed,) = with_common_times(logs(*map(run, range(4)), other))
    assert timed.runs[-1].given is None or np.array_equal(timed.runs[-1].given_between()[1], other.time_s)
    assert timed.runs[0].given is not None


def test_times_that_agree_are_left_alone() -> None:
    plain = logs(run(0, "a.csv"), run(0, "b.csv"))
    assert with_common_times(plain)[0] is plain


def test_a_robot_is_left_alone() -> None:
    one, zeros = run(0), np.zeros(110)
    robot = Run("a.csv", "a", "fit", one.time_s, BodyCommand(zeros, zeros, zeros), {"vx_m_s": zeros})
    plain = logs(robot)
    assert with_common_times(plain)[0] is plain


def test_a_run_without_a_sample_is_no_witness() -> None:
    blank = run(9)
    blank = Run("9.csv", "a", "fit", blank.time_s, blank.command, {"speed_rpm": np.full(110, np.nan)})
    (timed,) = with_common_times(logs(*map(run, range(4)), blank))
    assert timed.runs[0].given is not None


@given(st.integers(0, 40), st.integers(0, 40))
def test_common_times_are_within_the_rows_of_each_run(first: int, second: int) -> None:
    plain = logs(run(first, "a.csv"), run(second, "b.csv"))
    for before, after in zip(plain.runs, with_common_times(plain)[0].runs, strict=True):
        earliest, latest = before.given_between()
        after_s, by_s = after.given_between()
        assert np.all(after_s < by_s)
        assert np.all((earliest <= after_s) & (by_s <= latest))


def test_a_piece_of_a_run_keeps_its_times() -> None:
    (timed,) = with_common_times(logs(*map(run, range(4))))
    whole = timed.runs[0]
    for piece in pieces(whole, 0.1):
        assert piece.given is not None
        changes = piece.command_changes()[0][1:] + _start(piece, whole)
        assert np.all(np.isin(np.round(changes, 9), np.round(whole.command_changes()[0], 9)))


def _start(piece: Run, whole: Run) -> float:
    """Return when a piece begins [s]."""
    speed = whole.channels["speed_rpm"]
    return float(whole.time_s[np.flatnonzero(speed == piece.channels["speed_rpm"][0])[0]])


@pytest.mark.parametrize("period_s", [1.0 / 480.0, 0.05])
def test_a_robot_looks_for_a_command_no_earlier_than_it_was_given(period_s: float) -> None:
    (timed,) = with_common_times(logs(*map(run, range(4))))
    held = timed.runs[0].held_since(period_s)[timed.runs[0].command_rows()[1:]]
    assert np.all(held > SENT_S - 2e-3)
    assert np.all(held < SENT_S + 2e-3)
