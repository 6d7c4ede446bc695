"""Predictions of logs: how a run starts, what sensors measure, and poses in the frame of the log."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive, replay_bench
from sysid.compare.measured import start_of
from sysid.compare.predicted import SimulationSettings, predict, predict_all
from sysid.logs import BenchCommand, BodyCommand, Run

MODEL = paper_model()
TIME = np.arange(0.0, 1.5, 0.02)


def _bench(speed: float = 0.0) -> Run:
    command = np.where(TIME < 0.2, speed, 60.0)
    return Run("b.csv", "b", "fit", TIME, BenchCommand(command), {"speed_rpm": np.full(TIME.size, speed)})


def _robot(x: float = 0.0, y: float = 0.0, yaw: float = 0.0) -> Run:
    v = np.where(TIME < 0.2, 0.0, 60.0)
    zero = np.zeros(TIME.size)
    channels = {"x_m": zero + x, "y_m": zero + y, "yaw_rad": zero + yaw, "vx_m_s": zero}
    return Run("r.csv", "r", "fit", TIME, BodyCommand(v, zero, zero), channels)


def test_a_bench_prediction_is_the_replay() -> None:
    run = _bench()
    assert predict(MODEL, run)["speed_rpm"] == pytest.approx(
        replay_bench(MODEL, TIME, run.command.wheels_rpm[:, 0]), abs=1e-12
    )


@given(seed=st.integers(0, 2**32 - 1), rate_hz=st.sampled_from([47.0, 64.0, 100.0, 120.0, 200.0]))
def test_uneven_stamps_and_other_rates_delay_no_command(seed: int, rate_hz: float) -> None:
    rng = np.random.default_rng(seed)
    stamps = np.arange(0.0, 0.9, 1.0 / rate_hz)
    stamps[1:] += rng.uniform(-0.3, 0.3, stamps.size - 1) / rate_hz
    # The robot finds a new command at 0.2 and 0.5 s; each row shows what it holds by then.
    command = np.where(stamps < 0.2, 0.0, np.where(stamps < 0.5, 60.0, -20.0))
    run = Run("b.csv", "b", "fit", stamps, BenchCommand(command), {"speed_rpm": np.zeros(stamps.size)})
    true = replay_bench(MODEL, np.array([0.0, 0.2, 0.5]), np.array([0.0, 60.0, -20.0]), sample_times_s=stamps)
    assert predict(MODEL, run)["speed_rpm"] == pytest.approx(true, abs=1e-9)


def test_a_bench_run_that_is_already_turning_starts_turning() -> None:
    run = _bench(40.0)
    assert start_of(run).initial_rpm == pytest.approx(40.0)
    assert predict(MODEL, run)["speed_rpm"][0] == pytest.approx(40.0, abs=0.1)


def test_a_robot_without_a_command_starts_at_rest_despite_a_biased_sensor() -> None:
    run = _robot()
    biased = replace(run, channels={**run.channels, "vx_m_s": np.full(TIME.size, -0.03)})
    assert not start_of(biased).moving
    driven = replace(biased, command=BodyCommand(np.full(TIME.size, -5.0), *np.zeros((2, TIME.size))))
    assert start_of(driven).moving


def test_a_robot_prediction_is_the_drive_with_the_log_s_channels() -> None:
    shown = predict(MODEL, _robot())
    commands = BodyCommands.from_rows([(0.0, 0.0, 0.0, 0.0), (0.2, 60.0, 0.0, 0.0)])
    true = drive(MODEL, commands, float(TIME[-1])).channels_at(TIME)
    assert set(shown) == {"x_m", "y_m", "yaw_rad", "vx_m_s"}
    assert shown["vx_m_s"] == pytest.approx(true["vx_m_s"], abs=1e-9)


def test_a_pose_goes_on_from_where_the_log_begins() -> None:
    plain, turned = predict(MODEL, _robot()), predict(MODEL, _robot(2.0, -1.0, math.pi / 2))
    way = plain["x_m"][-1]
    assert way > 0.1
    assert turned["y_m"][-1] == pytest.approx(-1.0 + way, abs=0.02)
    assert turned["x_m"][-1] == pytest.approx(2.0, abs=0.02)
    assert turned["vx_m_s"] == pytest.approx(plain["vx_m_s"], abs=1e-9)


def test_a_slope_keeps_its_heading_in_the_world() -> None:
    sloped = MODEL.with_effect("floor_slope", slope_deg=5.0, heading_deg=90.0)
    # Facing along the fall line the robot is faster than facing away from it.
    down = predict(sloped, _robot(yaw=math.pi / 2))["vx_m_s"][-1]
    up = predict(sloped, _robot(yaw=-math.pi / 2))["vx_m_s"][-1]
    assert down > up + 0.001


def test_effects_of_sensors_leave_the_motion() -> None:
    run = _robot()
    plain = predict(MODEL, run)
    scaled = predict(MODEL.with_effect("sensor_scale", linear=1.1), run)
    assert scaled["vx_m_s"] == pytest.approx(1.1 * plain["vx_m_s"], abs=1e-12)
    assert np.array_equal(scaled["x_m"], plain["x_m"])


def test_runs_are_predicted_together_as_each_alone() -> None:
    runs = [_robot(), _robot(x=1.0, yaw=0.5), _robot()]
    model = MODEL.with_effect("sensor_latency", delay_s=0.05)
    together = predict_all(model, runs, settings=SimulationSettings("planar"))
    for run, found in zip(runs, together, strict=True):
        alone = predict(model, run, settings=SimulationSettings("planar"))
        assert {name: values.tolist() for name, values in found.items()} == {
            name: values.tolist() for name, values in alone.items()
        }
