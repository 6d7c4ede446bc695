"""Predictions of logs with a logged voltage."""

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import CustomEffect, paper_model
from mecanum_env.simulator import replay_bench
from sysid.compare.measured import observe
from sysid.compare.measured.subset import pieces
from sysid.compare.predicted import Simulator, predict
from sysid.logs import BenchCommand, BodyCommand, Dataset, Run

PLAIN = paper_model()
SAGGING = PLAIN.with_effect("battery_sag", "voltage", per_volt=0.05)
TIME = np.arange(0.0, 1.5, 0.01)


def bench_run(falls_v: float, name: str = "a", seconds: float = 1.5) -> Run:
    time_s = np.arange(0.0, seconds, 0.01)
    command = np.where(time_s % 1.0 < 0.5, 20.0, 80.0)
    channels = {"speed_rpm": np.zeros(time_s.size), "battery_v": 24.0 - falls_v * time_s / seconds}
    return Run(f"{name}.csv", name, "fit", time_s, BenchCommand(command), channels)


def test_a_prediction_follows_the_voltage_of_its_run() -> None:
    run = bench_run(2.0)
    command, volts = run.command.wheels_rpm[:, 0], run.channels["battery_v"]
    expected = replay_bench(SAGGING, run.time_s, command, battery_v=volts)
    np.testing.assert_allclose(predict(SAGGING, run)["speed_rpm"], expected, atol=1e-12)
    assert np.max(np.abs(expected - predict(PLAIN, run)["speed_rpm"])) > 4.0


@pytest.mark.parametrize(
    "model", [SAGGING, PLAIN, PLAIN.with_custom(CustomEffect("set_point", "-0.1 * voltage * command"))]
)
def test_runs_of_equal_commands_share_a_motion_only_if_the_voltage_does_not_matter(model) -> None:
    runs = (bench_run(2.0, "a"), bench_run(4.0, "b"))
    found = Simulator(observe(Dataset("made", runs, ()))).predictions(model)
    for run, predicted in zip(runs, found, strict=True):
        np.testing.assert_allclose(predicted, predict(model, run)["speed_rpm"], atol=1e-9)
    assert np.array_equal(*found) == (model is PLAIN)


def test_a_piece_of_a_run_knows_the_full_voltage() -> None:
    run = bench_run(4.0, seconds=30.0)
    whole = predict(SAGGING, run)["speed_rpm"]
    *_, last = pieces(run, PLAIN.wheel.command_period_s)
    assert last.duration_s < run.duration_s
    assert predict(SAGGING, last)["speed_rpm"][-1] == pytest.approx(whole[-1], abs=1e-6)


def test_a_robot_that_is_driving_when_its_log_starts_follows_the_voltage() -> None:
    turning = {f"speed_{wheel}_rpm": np.full(TIME.size, 60.0) for wheel in ("fl", "fr", "rl", "rr")}
    channels = turning | {"battery_v": np.where(TIME < 0.5, 24.0, 20.0)}
    zero = np.zeros(TIME.size)
    run = Run("r.csv", "r", "fit", TIME, BodyCommand(zero + 60.0, zero, zero), channels)
    found = predict(SAGGING, run)["speed_fl_rpm"]
    constant = predict(SAGGING, replace(run, channels=turning))["speed_fl_rpm"]
    np.testing.assert_allclose(found[TIME < 0.4], constant[TIME < 0.4], rtol=1e-9)
    assert found[-1] == pytest.approx(0.8 * constant[-1], rel=0.01)
