"""A fit to bench logs whose commands arrive late by a time of their own."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.simulator.bench import bench_motion
from sysid.compare.links import AlignedLogs
from sysid.compare.links.in_model import late_between_rows
from sysid.compare.predicted import predict
from sysid.fit import Fit, FitOptions, fit_dataset, fitted_model, pipeline
from sysid.fit.drive import command_times
from sysid.fit.effects import HeldOut
from sysid.logs import BenchCommand, Dataset, Run

MEAN_S, SPREAD_S = 0.1, 0.04
QUICK = FitOptions(starts=1, effects="off")


def logs(spread_s: float) -> Dataset:
    """Return runs of five steps each through a link that delays them by a mean and a spread [s]."""
    model = paper_model()
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 240.0))
    rng, runs = np.random.default_rng(3), []
    for index in range(8):
        time, given = np.arange(0.0, 6.0, 0.02), np.arange(0.5, 5.5, 1.0)
        levels = np.append(0.0, rng.choice([-1, 1], given.size) * rng.integers(30, 110, given.size))
        late = MEAN_S + spread_s * rng.uniform(-1.0, 1.0, given.size) * np.sqrt(3.0)
        clock, true = bench_motion(fine, np.append(0.0, given + late), levels, float(time[-1]))
        speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
        command = BenchCommand(levels[np.searchsorted(given, time + 1e-9, side="right")])
        split = ("fit", "fit", "validation", "test")[index % 4]
        runs.append(Run(f"r{index}", f"g{index}", split, time, command, {"speed_rpm": speed}))
    return Dataset("link", tuple(runs), ())


def test_the_law_is_fitted_beside_the_delay_of_each_command() -> None:
    fit = fit_dataset(logs(SPREAD_S), QUICK)
    assert fit.link is not None
    assert fit.link.delays.spread_s == pytest.approx(SPREAD_S, rel=0.4)
    described = fitted_model(fit)
    assert described.effects["command_latency/jitter"]["jitter_s"] == fit.link.delays.spread_s
    assert described.wheel.command_period_s == fit.link.given.wheel.command_period_s
    assert any("acts at a time of its own" in note for note in fit.notes)


def test_one_delay_for_all_commands_is_no_late_link() -> None:
    fit = fit_dataset(logs(0.0), QUICK)
    assert fit.link is None
    assert fitted_model(fit).effects["command_latency"]["delay_s"] == pytest.approx(MEAN_S, abs=0.01)


def rows_logs(*, between: bool, row_s: float = 0.04) -> Dataset:
    """Return runs with rows `row_s` apart of a wheel whose commands are given between these, or at them.

    Stamps are in whole microseconds, as in a file.
    """
    model = paper_model()
    fine = replace(model, wheel=replace(model.wheel, command_period_s=1.0 / 480.0))
    rng, runs = np.random.default_rng(4), []
    time = np.round(np.arange(0.0, 5.0, row_s), 6)
    for index in range(8):
        sent = 0.3 + 0.5 * np.arange(9) + rng.uniform(0.0, 0.2, 9)
        sent = sent if between else time[np.searchsorted(time, sent)]
        levels = np.append(0.0, rng.permutation(np.linspace(-110.0, 105.0, 9)).round())
        clock, true = bench_motion(fine, np.append(0.0, sent), levels, float(time[-1]))
        speed = np.interp(time, clock, true) + 0.3 * rng.standard_normal(time.size)
        command = BenchCommand(levels[np.searchsorted(sent, time + 1e-9, side="right")])
        split = ("fit", "fit", "validation", "test")[index % 4]
        runs.append(Run(f"r{index}", f"g{index}", split, time, command, {"speed_rpm": speed}))
    return Dataset("rows", tuple(runs), (), "rows")


@pytest.fixture(scope="module")
def between() -> Fit:
    """Return the fit to logs whose commands are given between rows."""
    return fit_dataset(rows_logs(between=True), QUICK)


def error_rpm(model: Model, dataset: Dataset) -> float:
    errors = [run.channels["speed_rpm"] - predict(model, run)["speed_rpm"] for run in dataset.runs]
    return float(np.sqrt(np.nanmean(np.concatenate(errors) ** 2)))


def test_commands_between_rows_are_fitted_where_they_were_given(between: Fit) -> None:
    assert between.link is not None
    described = fitted_model(between)
    assert late_between_rows(described) is not None
    assert "command_latency/jitter" not in described.effects
    assert not any("taken as command_period_s" in note for note in between.notes)
    # The logs say nothing of a clock, so that the model takes commands at once.
    assert described.wheel.command_period_s == described.wheel.law.sample_period_s
    aligned = AlignedLogs.stated(between.link.logs, described)
    assert aligned is not None
    assert error_rpm(aligned.model, aligned.dataset) < 0.4 * error_rpm(described, between.link.logs)


def test_rounded_stamps_are_no_clock_of_commands_between_rows() -> None:
    # The median interval is a little longer than most: a clock of that period runs ahead of the rows.
    rows = rows_logs(between=True, row_s=0.0428688413)
    fit = fit_dataset(rows, QUICK)
    assert fit.link is not None
    assert late_between_rows(fitted_model(fit)) is not None


@pytest.mark.parametrize("row_s", [0.04, 0.0428688413])
def test_commands_at_rows_are_taken_as_stamped(row_s: float) -> None:
    fit = fit_dataset(rows_logs(between=False, row_s=row_s), QUICK)
    assert fit.link is None
    described = fitted_model(fit)
    assert late_between_rows(described) is None
    # The wheel answers the command of a row at once, not a row later.
    assert described.wheel.law.D > 0.3


def test_times_that_hardly_help_beside_effects_are_not_adopted(
    monkeypatch: pytest.MonkeyPatch, between: Fit
) -> None:
    """Friction and limits delay changes differently, and times of single changes follow them."""
    monkeypatch.setattr(pipeline, "with_times_of_commands", lambda _law, _progress: between)
    for error, adopted in ((0.6, False), (0.4, True)):
        monkeypatch.setattr(pipeline, "_held_out_rpm", lambda fit, e=error: e if fit.link else 1.0)
        assert (fit_dataset(logs(0.0), QUICK).link is not None) is adopted


def test_a_gain_of_one_tells_the_times_that_a_free_gain_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    turns, gains = command_times._link_in_turns, []

    def without_free_gain(*given: Any, unit_gain: bool, **options: Any) -> AlignedLogs | None:
        gains.append(unit_gain)
        return turns(*given, unit_gain=True, **options) if unit_gain else None

    monkeypatch.setattr(command_times, "_link_in_turns", without_free_gain)
    fit = fit_dataset(rows_logs(between=True), QUICK)
    assert gains == [False, True]
    assert fit.link is not None
    assert late_between_rows(fitted_model(fit)) is not None


def test_a_fit_whose_gain_is_free_tries_no_other(monkeypatch: pytest.MonkeyPatch) -> None:
    gains = []

    def none(*_: Any, unit_gain: bool, **__: Any) -> None:
        gains.append(unit_gain)

    monkeypatch.setattr(command_times, "_link_in_turns", none)
    assert fit_dataset(rows_logs(between=True), replace(QUICK, unit_gain=False)).link is None
    assert set(gains) == {False}


def test_no_times_are_tried_where_the_noise_is_most_of_the_error(monkeypatch: pytest.MonkeyPatch) -> None:
    data, asked = logs(0.0), []

    def without_times(law: Any, _progress: Any) -> Any:
        asked.append(law)
        return law

    monkeypatch.setattr(pipeline, "with_times_of_commands", without_times)
    plain = fit_dataset(data, QUICK)
    assert not asked
    noise_rpm = HeldOut.of(data).noise_rpm
    monkeypatch.setattr(pipeline, "_held_out_rpm", lambda _fit: 2.1 * noise_rpm)
    assert fit_dataset(data, QUICK).law == plain.law
    assert len(asked) == 1


@pytest.mark.parametrize("spread_s", [0.0, SPREAD_S])
def test_the_noise_of_the_sensor_is_no_more_where_a_link_is_late(spread_s: float) -> None:
    assert HeldOut.of(logs(spread_s)).noise_rpm == pytest.approx(0.3, rel=0.1)


def test_motion_is_no_noise_of_the_sensor() -> None:
    """Without a held command neighbouring samples only bound the noise, by far more than it is."""
    time, rng = np.arange(0.0, 4.0, 0.02), np.random.default_rng(0)
    speed = 60.0 * np.sin(9.0 * time)
    runs = [
        Run(f"r{i}", f"g{i}", "fit", time, BenchCommand(speed.round()), {"speed_rpm": speed + 0.1 * noise})
        for i, noise in enumerate(rng.standard_normal((3, time.size)))
    ]
    assert HeldOut.of(Dataset("swings", tuple(runs), ())).noise_rpm == 0.0


def test_times_between_rows_are_one_stage_of_the_fit() -> None:
    told: list[str] = []
    fit_dataset(rows_logs(between=True), QUICK, told.append)
    stages = [message for message in told if ": turn " not in message]
    law = ["clock of the commands", "delay and ceiling", "output-error: 1 starts", "uncertainty"]
    assert stages[:5] == [*law, "times of the commands"]
    assert all(message.startswith("times of the commands") for message in stages[5:])
