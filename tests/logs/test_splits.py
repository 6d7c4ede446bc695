from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.units import FloatArray
from sysid.logs import Run, Split
from sysid.logs.splits import are_repeats, assign_splits, command_sequence, group_names

BenchRun = Callable[..., Run]
Step = Callable[..., FloatArray]
SplitOf = Callable[..., dict[str, Split]]


@pytest.fixture(scope="session")
def split_of(bench_run: BenchRun, step_command: Step) -> SplitOf:
    """Split steps of some speeds with so many repeats each; return the split by file."""

    def split(speeds: list[float], repeats: int, stated: dict[str, Split] | None = None) -> dict[str, Split]:
        runs = [
            bench_run(f"{speed:g}_{r}.csv", step_command(speed), group=f"{speed:g}")
            for speed in speeds
            for r in range(repeats)
        ]
        splits, _ = assign_splits(runs, stated or {})
        return {run.file: split for run, split in zip(runs, splits, strict=True)}

    return split


def grouped(runs: list[Run], stated: dict[str, str] | None = None) -> list[str]:
    return group_names(runs, stated or {})[0]


def test_equal_commands_are_repeats_however_long_the_rest_before_and_after(
    bench_run: BenchRun, step_command: Step
) -> None:
    one = command_sequence(bench_run("a.csv", step_command(40, before=20, after=100)))
    other = command_sequence(bench_run("b.csv", step_command(40, before=73, after=50)))
    assert are_repeats(one, other)


def test_other_commands_are_no_repeats(bench_run: BenchRun, step_command: Step) -> None:
    one = command_sequence(bench_run("a.csv", step_command(40)))
    back = np.concatenate([step_command(40), np.zeros(5)])
    for other in (step_command(41), step_command(-40), back, np.full(50, 40.0)):
        assert not are_repeats(one, command_sequence(bench_run("b.csv", other)))


@pytest.mark.parametrize(("shift", "same"), [(1, True), (2, True), (4, False)])
def test_changes_may_be_logged_two_samples_apart(shift: int, same: bool, bench_run: BenchRun) -> None:
    def hold(samples: int) -> np.ndarray:
        return np.concatenate([np.zeros(10), np.full(samples, 40.0), np.full(50, 20.0)])

    one, other = (command_sequence(bench_run("x.csv", hold(n))) for n in (50, 50 + shift))
    assert are_repeats(one, other) is same


def test_repeats_are_found_without_a_group(bench_run: BenchRun, step_command: Step) -> None:
    runs = [bench_run(name, step_command(v)) for name, v in (("a.csv", 40), ("b.csv", 80), ("c.csv", 40))]
    assert grouped(runs) == ["a", "b", "a"]


def test_a_run_without_a_group_joins_the_stated_group_of_its_commands(
    bench_run: BenchRun, step_command: Step
) -> None:
    runs = [bench_run(name, step_command(v)) for name, v in (("a.csv", 40), ("b.csv", 40), ("c.csv", 80))]
    assert grouped(runs, {"b.csv": "forty"}) == ["forty", "forty", "c"]


def test_stated_groups_win_over_equal_commands(bench_run: BenchRun, step_command: Step) -> None:
    runs = [bench_run("a.csv", step_command(40)), bench_run("b.csv", step_command(40))]
    assert grouped(runs, {"a.csv": "slow gains", "b.csv": "fast gains"}) == ["slow gains", "fast gains"]


def test_a_found_group_does_not_take_a_stated_name(bench_run: BenchRun, step_command: Step) -> None:
    runs = [bench_run("a.csv", step_command(40)), bench_run("b.csv", step_command(80))]
    assert grouped(runs, {"b.csv": "a"}) == ["a_2", "a"]


def test_a_stated_group_with_other_commands_is_reported(bench_run: BenchRun, step_command: Step) -> None:
    runs = [
        bench_run("a.csv", step_command(40)),
        bench_run("b.csv", step_command(80)),
        bench_run("c.csv", step_command(40)),
    ]
    _, findings = group_names(runs, dict.fromkeys(("a.csv", "b.csv", "c.csv"), "g"))
    assert [(f.file, f.kind) for f in findings] == [("b.csv", "group")]


def test_whole_groups_are_held_out_and_the_largest_fits(split_of: SplitOf) -> None:
    splits = split_of([10, 40, 80, 120, 130], repeats=3)
    assert {name: splits[f"{name}_0.csv"] for name in (10, 40, 80, 120, 130)} == {
        10: "fit",
        40: "test",
        80: "fit",
        120: "validation",
        130: "fit",
    }
    assert all(splits[f"{v}_0.csv"] == splits[f"{v}_2.csv"] for v in (10, 40, 80, 120, 130))


@given(count=st.integers(3, 40), repeats=st.integers(1, 3))
def test_every_split_has_about_its_share(count: int, repeats: int, split_of: SplitOf) -> None:
    splits = split_of([float(v) for v in range(1, count + 1)], repeats)
    share = {name: list(splits.values()).count(name) / repeats for name in ("fit", "validation", "test")}
    assert share["validation"] == share["test"] == max(1, round(count / 5))
    assert splits[f"{count}_0.csv"] == "fit"


@given(order=st.permutations(range(6)))
def test_splits_do_not_depend_on_the_order_of_the_runs(
    order: list[int], bench_run: BenchRun, step_command: Step
) -> None:
    runs = [bench_run(f"{v}.csv", step_command(10.0 * v + 10), group=f"{v}") for v in range(6)]
    plain, _ = assign_splits(runs, {})
    shuffled, _ = assign_splits([runs[i] for i in order], {})
    assert [plain[i] for i in order] == shuffled


def test_one_group_splits_its_repeats_and_is_reported(bench_run: BenchRun, step_command: Step) -> None:
    runs = [bench_run(f"{r}.csv", step_command(40), group="g") for r in range(3)]
    splits, findings = assign_splits(runs, {})
    assert splits == ["fit", "validation", "test"]
    assert any("both fitted and held out" in f.message for f in findings)


def test_two_sequences_without_repeats_fit_the_larger(split_of: SplitOf) -> None:
    assert split_of([40, 80], repeats=1) == {"40_0.csv": "test", "80_0.csv": "fit"}


def test_one_run_is_not_split_and_is_reported(bench_run: BenchRun, step_command: Step) -> None:
    splits, (finding,) = assign_splits([bench_run("a.csv", step_command(40), group="a")], {})
    assert splits == ["fit"]
    assert "one run only" in finding.message


def test_stated_splits_are_kept_and_repeats_follow(split_of: SplitOf) -> None:
    splits = split_of([10, 40, 80, 120], 2, {"80_0.csv": "test", "10_1.csv": "fit"})
    assert splits["80_0.csv"] == splits["80_1.csv"] == "test"
    assert splits["10_0.csv"] == splits["10_1.csv"] == "fit"


def test_splits_that_none_states_are_assigned(split_of: SplitOf) -> None:
    splits = split_of([10, 40, 80, 120], 1, {"80_0.csv": "test"})
    assert splits == {"10_0.csv": "validation", "40_0.csv": "fit", "80_0.csv": "test", "120_0.csv": "fit"}


@given(count=st.integers(1, 12), repeats=st.integers(1, 3), added=st.integers(1, 4))
def test_groups_added_for_the_fit_leave_the_others_as_they_were(
    count: int, repeats: int, added: int, bench_run: BenchRun, step_command: Step
) -> None:
    """Reading used to deal out all groups again: runs of the test came to decide, and new ones did not."""

    def runs_at(speeds: list[float]) -> list[Run]:
        names = [(f"{speed:g}_{r}.csv", speed) for speed in speeds for r in range(repeats)]
        return [bench_run(name, step_command(speed), group=f"{speed:g}") for name, speed in names]

    logs, new = runs_at([10.0 * (i + 1) for i in range(count)]), runs_at([10.0 * i + 5 for i in range(added)])
    alone, _ = assign_splits(logs, {})
    # One entry for each new group suffices: its repeats follow.
    together, _ = assign_splits(logs + new, {run.file: "fit" for run in new[::repeats]})
    assert together == alone + ["fit"] * len(new)


def test_a_split_without_runs_is_reported(bench_run: BenchRun, step_command: Step) -> None:
    runs = [bench_run(f"{v}.csv", step_command(v), group=f"{v}") for v in (10, 20)]
    _, findings = assign_splits(runs, {"10.csv": "fit", "20.csv": "fit"})
    assert [f.message for f in findings] == ["no run is for validation", "no run is for test"]


def test_commands_of_body_and_wheels_are_compared_as_wheel_speeds(
    bench_run: BenchRun, step_command: Step
) -> None:
    base = bench_run("a.csv", step_command(40))
    assert base.command.wheels_rpm.shape == (120, 1)
    assert not are_repeats(
        command_sequence(base), replace(command_sequence(base), wheels_rpm=np.zeros((2, 4)))
    )
