"""Cases of hidden effects in bench drives: what a change does, how large it is, and that a seed repeats."""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from sysid.studies.zoo.cases.bench.change import Change, friction_torque, integrates
from sysid.studies.zoo.cases.bench.changes import CHANGES, TWINS, change_of
from sysid.studies.zoo.cases.bench.draw import (
    BLOCK,
    SHARES,
    case_commands,
    draw_bench_case,
    fit_commands,
    kind_of,
)
from sysid.studies.zoo.cases.bench.outsiders import FAR_OUTSIDERS, NEAR_OUTSIDERS, Outsider
from sysid.studies.zoo.cases.bench.plans import GENTLE, PLANS, Commands, plan
from sysid.studies.zoo.cases.bench.size import Yardstick, signal, solve_size
from sysid.studies.zoo.cases.layouts import LAYOUTS, STANDARD, Layout, layout_again
from sysid.studies.zoo.cases.write import write_bench_case
from sysid.studies.zoo.drives.draw import draw_drive
from sysid.studies.zoo.drives.drive import Drive, Family
from sysid.studies.zoo.drives.simulate import move

ALL = (*CHANGES, *NEAR_OUTSIDERS, *FAR_OUTSIDERS)
FAMILIES: tuple[Family, ...] = ("pi", "open_duty", "p", "cascade", "feed_forward")


@cache
def drawn(seed: int) -> Drive:
    """Return a drawn drive; five families take turns."""
    return draw_drive(seed, FAMILIES[seed % len(FAMILIES)])


def title(change: Change | Outsider) -> str:
    """Return what a test of this change is called."""
    return f"{change.name}-{change.form}" if isinstance(change, Change) else change.words


def commands_of(drive: Drive) -> list[Commands]:
    """Return a run that reverses at all speeds and one near zero."""
    names = ("reversals", "slow_near_zero")
    return [plan(n, drive.top_rpm, 2.5, drive.link.period_s, np.random.default_rng(3)) for n in names]


def first_with(change: Change | Outsider) -> Drive:
    """Return the first drawn drive that can have the change."""
    return next(drawn(seed) for seed in range(60) if change.possible(drawn(seed)))


def at(change: Change | Outsider, drive: Drive, size: float) -> Drive:
    """Return the drive with the change, whose draws are the same at every size."""
    return change.apply(drive, size, np.random.default_rng(5))


@pytest.mark.parametrize("change", ALL, ids=title)
def test_a_gross_change_shows_in_the_logs_of_a_drawn_drive(change: Change | Outsider) -> None:
    able = [drawn(seed) for seed in range(60) if change.possible(drawn(seed))][:4]
    assert any(Yardstick(d, commands_of(d), 1)(at(change, d, 1.0)) > 0.3 for d in able)


@pytest.mark.parametrize("change", ALL, ids=title)
def test_a_change_of_size_zero_changes_nothing(change: Change | Outsider) -> None:
    drive = first_with(change)
    assert at(change, drive, 0.0) == drive
    assert signal(drive, drive, commands_of(drive), (1,)) == 0.0


@pytest.mark.parametrize("change", ALL, ids=title)
def test_a_large_change_leaves_more_than_a_small_one(change: Change | Outsider) -> None:
    drive = first_with(change)
    yardstick = Yardstick(drive, commands_of(drive), 1)
    small, large = (yardstick(at(change, drive, size)) for size in (0.3, 1.0))
    assert small < large


def test_a_cold_gear_rubs_more_and_warms_up_to_what_it_was() -> None:
    change = change_of("warm_up", "cold_friction")
    before = first_with(change)
    after = at(change, before, 0.7)
    more = change.truth(before, after)
    sticking = after.gear.wheel_sticking_n_m - before.gear.wheel_sticking_n_m
    for speed in (0.0, 5.0):
        cold, warm = friction_torque(after, speed), friction_torque(before, speed)
        expected = more["torque_n_m"] - sticking + more["damping_n_m_s_rad"] * speed
        assert cold - warm == pytest.approx(expected)
        assert cold * (1.0 - after.gear.friction_warming) == pytest.approx(warm)


def test_every_name_and_form_is_there_once() -> None:
    keys = [(change.name, change.form) for change in CHANGES]
    assert len(keys) == len(set(keys)) == 33
    assert set(TWINS) <= set(keys)


def test_the_size_is_solved_for_the_wanted_trace() -> None:
    drive = drawn(0)
    yardstick = Yardstick(drive, commands_of(drive), 1)
    solved = solve_size(change_of("speed_gain", "").apply, drive, 1.5, yardstick, (7,))
    assert solved.signal == pytest.approx(1.5, rel=0.05)
    assert yardstick(solved.drive) == solved.signal


def test_an_unreachable_trace_ends_at_the_gross_size() -> None:
    drive = drawn(0)
    yardstick = Yardstick(drive, commands_of(drive), 1)
    assert solve_size(change_of("speed_gain", "").apply, drive, 1e4, yardstick, (7,)).size == 1.0


def test_a_trace_below_the_noise_is_still_measured() -> None:
    """A gain that is wrong by a hundredth as much leaves a hundredth of the trace."""
    drive = drawn(1)
    yardstick = Yardstick(drive, commands_of(drive), 1)
    change = change_of("sensor_scale", "")
    assert yardstick(at(change, drive, 0.5)) == pytest.approx(
        yardstick(at(change, drive, 1.0)) / 100.0, rel=0.1
    )


def steady_rpm(drive: Drive, command_rpm: float) -> float:
    """Return the mean speed of the wheel after 2 s of a constant command."""
    motion = move(drive, np.full(round(3.0 / drive.link.period_s), command_rpm), np.random.default_rng(0))
    late = motion.time_s > 2.0
    turned, passed = (float(np.ptp(v[late])) for v in (motion.wheel_rad, motion.time_s))
    return turned / passed * 60.0 / (2.0 * math.pi)


def test_the_true_droop_is_what_friction_takes() -> None:
    change = change_of("coulomb_friction", "droop")
    able = [drawn(seed) for seed in range(20) if change.possible(drawn(seed))][:4]
    for drive in able:
        after = at(change, drive, 0.85)
        command = 0.7 * drive.top_rpm
        lost = steady_rpm(drive, command) - steady_rpm(after, command)
        assert change.truth(drive, after)["droop_rpm"] == pytest.approx(lost, rel=0.1)


def test_the_true_ceiling_is_what_the_supply_allows() -> None:
    change = change_of("speed_saturation", "supply")
    able = [drawn(seed) for seed in range(20) if change.possible(drawn(seed)) and integrates(drawn(seed))][:3]
    for drive in able:
        after = at(change, drive, 0.9)
        reached = steady_rpm(after, drive.top_rpm)
        assert change.truth(drive, after)["limit_rpm"] == pytest.approx(reached, rel=0.05)


@pytest.mark.parametrize("name", PLANS)
def test_plans_are_whole_commands_from_rest_within_the_top_speed(name: str) -> None:
    commands = plan(name, 87.6, 2.5, 0.04, np.random.default_rng(2))
    assert commands.shape == (62,)
    assert commands[0] == 0.0
    assert np.array_equal(commands, np.rint(commands))
    assert 0.0 < np.abs(commands).max() <= 87.0


def test_the_gentle_plan_is_slow_and_forward() -> None:
    commands = plan(GENTLE, 100.0, 2.5, 0.04, np.random.default_rng(2))
    assert commands.min() >= 0.0
    assert commands.max() < 50.0


def test_studies_last_between_15_and_60_seconds() -> None:
    assert all(15.0 <= one.sequences * one.repeats * one.seconds <= 60.0 for one in LAYOUTS)


def test_kinds_come_in_their_shares_wherever_50_seeds_begin() -> None:
    for first in (0, 17, 1033):
        assert Counter(kind_of(seed)[0] for seed in range(first, first + BLOCK)) == SHARES


def test_turns_of_a_kind_have_no_gaps() -> None:
    turns = [turn for kind, turn in map(kind_of, range(3 * BLOCK)) if kind == "single"]
    assert turns == list(range(60))


def test_a_quiet_case_hides_nothing() -> None:
    seed = next(s for s in range(BLOCK) if kind_of(s)[0] == "quiet")
    case, nominal, changed = draw_bench_case(seed)
    assert nominal == changed
    assert (case.hidden, case.outsider, case.signal) == ((), "", 0.0)


def test_an_untestable_effect_is_there_and_does_not_show() -> None:
    seed = next(s for s in range(BLOCK) if kind_of(s)[0] == "untestable")
    case, nominal, changed = draw_bench_case(seed)
    assert nominal != changed
    assert case.plan == GENTLE
    assert case.signal < 0.3


def test_a_pair_hides_two_names_with_traces_of_their_own() -> None:
    seed = next(s for s in range(BLOCK) if kind_of(s)[0] == "pair")
    case, _, _ = draw_bench_case(seed)
    assert len({hidden.name for hidden in case.hidden}) == 2
    assert min(hidden.signal for hidden in case.hidden) > 0.0


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Write one case twice."""
    folders = tmp_path_factory.mktemp("first"), tmp_path_factory.mktemp("again")
    cases = [write_bench_case(1033, folder) for folder in folders]
    assert cases[0] == cases[1]
    return folders


def test_a_seed_writes_the_same_bytes_again(written: tuple[Path, Path]) -> None:
    first, again = ({p.relative_to(f): p.read_bytes() for p in f.rglob("*.*")} for f in written)
    assert first == again


def test_logs_are_read_as_the_contract_says(written: tuple[Path, Path]) -> None:
    from sysid.logs import read_dataset

    nominal, logs = read_dataset(written[0] / "nominal"), read_dataset(written[0] / "logs")
    assert {run.split for run in nominal.runs} == {"fit", "validation", "test"}
    layout = next(v for v in LAYOUTS if v.name == draw_bench_case(1033)[0].layout)
    assert len(logs.runs) == layout.sequences * layout.repeats
    assert len(logs.groups()) == layout.sequences


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.name)
def test_a_layout_that_drives_the_fit_again_has_sequences_of_the_fit(layout: Layout) -> None:
    again = layout_again(layout, STANDARD)
    assert (again.seconds, again.repeats) == (STANDARD.seconds, layout.repeats)
    assert again.sequences <= STANDARD.sequences
    assert again.sequences == STANDARD.sequences or layout.repeats > 1


@pytest.mark.parametrize("kind", ["single", "untestable"])
def test_the_same_commands_are_those_of_the_fit(kind: str) -> None:
    seed = next(s for s in range(BLOCK) if kind_of(s)[0] == kind)
    case, nominal, changed = draw_bench_case(seed, "same")
    commands, fitted = case_commands(case, nominal), fit_commands(seed, nominal)
    np.testing.assert_array_equal(commands, fitted[: len(commands)])
    assert case.kind == ("quiet" if kind == "untestable" else kind)
    assert (nominal == changed) == (case.kind == "quiet")
    assert case.name.startswith(f"bench-{seed:04d}-same-")


def test_a_layout_senses_both_drives_alike() -> None:
    drive = drawn(0)
    for layout in LAYOUTS:
        assert dataclasses.replace(layout.sensed(drive), sensor=drive.sensor) == drive
