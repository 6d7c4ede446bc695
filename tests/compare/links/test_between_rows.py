"""Commands that a log shows in the first row after they were given."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import Model
from mecanum_env.simulator.bench import bench_motion
from mecanum_env.units import FloatArray
from sysid.compare.links import AlignedLogs, LinkClock, delays_between_rows, with_stamps
from sysid.compare.links.between_rows import EDGE_S, as_stamped, blurred
from sysid.compare.links.changes import GRID_S, STEP_S, Change, means_over_ticks
from sysid.logs import BenchCommand, Dataset, Run

ROW_S, LATE_S = 0.04, 0.03
_LEVELS_RPM = np.array([-100.0, -75.0, -50.0, -25.0, 30.0, 55.0, 80.0, 105.0])


def logs(model: Model, *, between_rows: bool, late_s: float = LATE_S, repeats: int = 2) -> Dataset:
    """Return runs of eight steps that act `late_s` after they were given, at any time or at rows."""
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 480.0))
    rng, runs = np.random.default_rng(2), []
    time = np.arange(0.0, 4.5, ROW_S)
    for index in range(4):
        sent = 0.2 + 0.5 * np.arange(8) + rng.uniform(0.0, 0.2, 8)
        if not between_rows:
            sent = np.ceil(sent / ROW_S) * ROW_S
        levels = np.append(0.0, rng.permutation(_LEVELS_RPM))
        clock, true = bench_motion(fine, np.append(0.0, sent + late_s), levels, float(time[-1]))
        command = BenchCommand(levels[np.searchsorted(sent, time + 1e-9, side="right")])
        for repeat in range(repeats):
            speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
            split = ("fit", "fit", "validation", "test")[index]
            runs.append(Run(f"r{index}_{repeat}", f"g{index}", split, time, command, {"speed_rpm": speed}))
    return Dataset("rows", tuple(runs), (), "sent " + repr(between_rows))


def sent_s(dataset: Dataset) -> FloatArray:
    """Return when the commands of `logs` were given, run by run."""
    rng = np.random.default_rng(2)
    found = []
    for index in range(4):
        sent = 0.2 + 0.5 * np.arange(8) + rng.uniform(0.0, 0.2, 8)
        rng.permutation(_LEVELS_RPM)
        repeats = [run for run in dataset.runs if run.group == f"g{index}"]
        for run in repeats:
            rng.standard_normal(run.time_s.size)
            found.append(sent)
    return np.concatenate(found)


@pytest.fixture
def clock(model: Model) -> LinkClock:
    return LinkClock(model.wheel.law.sample_period_s, None)


@pytest.fixture
def stamped(model: Model) -> Model:
    """Return a model whose logs show commands in the first row after they were given."""
    tick = model.wheel.law.sample_period_s
    on_tick = replace(model, wheel=replace(model.wheel, command_period_s=tick))
    return with_stamps(on_tick.with_effect("command_latency", delay_s=LATE_S), LATE_S)


def test_times_between_rows_are_found(model: Model, clock: LinkClock) -> None:
    data = logs(model, between_rows=True)
    found = delays_between_rows(model, data.runs, clock)
    assert found.differ
    assert found.mean_s == pytest.approx(LATE_S, abs=0.006)
    given = np.array([change.given_s for change in found.changes])
    error = given + found.delay_s - found.mean_s - sent_s(data)
    # The row alone tells a time to its width over the root of twelve.
    assert np.std(error) < 0.4 * ROW_S / np.sqrt(12.0)


def test_a_logged_voltage_tells_no_noise_of_the_speed(model: Model, clock: LinkClock) -> None:
    data, rng = logs(model, between_rows=True), np.random.default_rng(0)
    with_voltage = [
        replace(
            run, channels={**run.channels, "battery_v": 12.0 + 1e-6 * rng.standard_normal(run.time_s.size)}
        )
        for run in data.runs
    ]
    alone, beside = (delays_between_rows(model, runs, clock) for runs in (data.runs, with_voltage))
    for expected, found in zip(alone.unsure, beside.unsure, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_commands_that_were_given_at_rows_are_not_between_them(model: Model, clock: LinkClock) -> None:
    assert not delays_between_rows(model, logs(model, between_rows=False).runs, clock).differ


def test_repeats_stay_repeats(model: Model, stamped: Model) -> None:
    data = logs(model, between_rows=True)
    late = AlignedLogs.stated(data, stamped)
    assert late is not None
    assert [run.group for run in late.dataset.runs] == [run.group for run in data.runs]


def test_later_commands_are_not_taken_for_others_that_were_given_later(model: Model, stamped: Model) -> None:
    late = AlignedLogs.stated(logs(model, between_rows=True, late_s=LATE_S + 0.1), stamped)
    assert late is not None
    changes = late.delays.changes
    # They are placed no later than the row that shows them, so that what is late is left to be found.
    placed = late.delays.delay_s - late.delays.mean_s
    assert np.all(placed <= np.array([change.within_s for change in changes]) + EDGE_S + 1e-9)


def test_a_model_that_predicts_the_logs_better_tells_the_times_better(model: Model, stamped: Model) -> None:
    better = model.with_effect("acceleration_limit", limit_rpm_s=400.0)
    data = logs(better, between_rows=True)
    spread_s = []
    for timed_by in (None, stamped.with_effect("acceleration_limit", limit_rpm_s=400.0)):
        late = AlignedLogs.stated(data, stamped, timed_by)
        assert late is not None
        assert dict(late.model.effects) == dict(stamped.effects)
        given_s = np.array([change.given_s for change in late.delays.changes])
        spread_s.append(float(np.std(given_s + late.delays.delay_s - late.delays.mean_s - sent_s(data))))
    assert spread_s[1] < 0.7 * spread_s[0]


def test_a_model_of_such_logs_says_so_before_and_after(model: Model, stamped: Model) -> None:
    late = AlignedLogs.stated(logs(model, between_rows=True), stamped)
    assert late is not None
    assert "commands_between_rows" not in late.model.uncertainty
    assert late.as_stated(late.model) == stamped


@given(peak=st.floats(0.02, 0.4), within=st.integers(0, 30))
def test_a_likelihood_blurred_over_a_row_has_the_mean_of_its_values(peak: float, within: int) -> None:
    row = -0.5 * ((GRID_S - peak) / 0.01) ** 2
    change = Change(0, 0.0, 0.0, 50.0, within * STEP_S, within * STEP_S)
    mean = np.exp(blurred(row[None, :], [change]))[0]
    expected = [np.mean(np.exp(row[k : k + within + 1])) for k in range(row.size - within)]
    np.testing.assert_allclose(mean[: row.size - within], expected, atol=1e-12)


def test_a_stamp_is_a_time_since_the_row_before() -> None:
    row = -np.abs(GRID_S - 0.1)
    change = Change(0, 0.0, 0.0, 50.0, 0.04, 0.04)
    assert GRID_S[np.argmax(as_stamped(row[None, :], [change])[0])] == pytest.approx(0.06)


@given(
    at=st.lists(st.floats(0.0, 0.9), min_size=1, max_size=5).map(sorted),
    levels=st.lists(st.integers(-100, 100), min_size=6, max_size=6),
)
def test_means_over_ticks_keep_what_a_command_adds_up_to(at: list[float], levels: list[int]) -> None:
    tick_s, end_s = 1.0 / 120.0, 1.0
    rpm = np.array(levels[: len(at) + 1], float)
    times, means = means_over_ticks(np.array(at), rpm, tick_s, end_s)
    np.testing.assert_allclose(times / tick_s, np.rint(times / tick_s), atol=1e-9)
    whole = float(rpm @ np.diff([0.0, *at, end_s]))
    assert means @ np.diff([*times, end_s]) == pytest.approx(whole, abs=1e-3)
    assert means[-1] == pytest.approx(rpm[-1], abs=1e-4)
