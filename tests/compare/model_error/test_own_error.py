"""The model's own error: measured, told from noise, and kept by the model file."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mecanum_env.model import Model, read_model, write_model
from sysid.compare.measured import activity_rpm
from sysid.compare.model_error import (
    ModelError,
    estimate_model_error,
    model_error_of,
    own_error,
    with_own_error,
)
from sysid.compare.model_error.size import DECAY_S, ChannelError, Residual, with_model_error
from sysid.logs import BenchCommand, Run
from tests.gap.conftest import MakeLogs


def _run(levels: list[float], name: str = "a") -> Run:
    time = np.arange(0.0, 1.0 * len(levels), 0.01)
    command = np.repeat(np.array(levels), time.size // len(levels))
    time = time[: command.size]
    return Run(f"{name}.csv", name, "fit", time, BenchCommand(command), {"speed_rpm": command})


def test_activity_is_the_decaying_change_of_command() -> None:
    run = _run([0.0, 50.0])
    at = np.array([0.5, 1.0, 1.0 + DECAY_S])
    assert activity_rpm(run, at, DECAY_S) == pytest.approx([0.0, 50.0, 50.0 / np.e], rel=1e-9)


def test_known_settled_and_transient_errors_are_found() -> None:
    rng = np.random.default_rng(0)
    parts = []
    for k in range(20):
        run = _run([0.0, 80.0, -40.0, 100.0], name=f"r{k}")
        size = np.hypot(0.3, 0.02 * activity_rpm(run, run.time_s, DECAY_S))
        value = size * rng.standard_normal(run.time_s.size) + 0.5 * rng.standard_normal(run.time_s.size)
        parts.append(Residual(run, "speed_rpm", run.time_s, value, np.full(run.time_s.size, 0.25)))
    found = estimate_model_error(parts).channels["speed_rpm"]
    assert found.settled == pytest.approx(0.3, rel=0.15)
    assert found.transient == pytest.approx(0.02, rel=0.15)


def test_no_error_is_stated_below_what_the_logs_can_show() -> None:
    rng = np.random.default_rng(1)
    run = _run([0.0, 80.0])
    noise = Residual(
        run, "speed_rpm", run.time_s, rng.standard_normal(run.time_s.size), np.ones(run.time_s.size)
    )
    assert estimate_model_error([noise]).channels["speed_rpm"].settled > 0.1


def test_the_model_file_keeps_the_error(base: Model, tmp_path: Path) -> None:
    error = ModelError({"speed_rpm": ChannelError(0.1, 0.01, 0.05)}, "abc")
    write_model(with_model_error(base, error), tmp_path / "model.json")
    assert model_error_of(read_model(tmp_path / "model.json")) == error
    assert model_error_of(base) is None


def test_a_right_model_states_a_negligible_error(bench_logs: MakeLogs, base: Model) -> None:
    dataset = bench_logs(base)
    error = model_error_of(with_own_error(base, dataset))
    assert error is not None
    assert error.data_sha256 == dataset.sha256
    assert error.channels["speed_rpm"].settled < 0.15
    assert error.channels["speed_rpm"].transient < 0.01


def test_a_plausible_model_that_cannot_be_simulated_does_not_end_a_fit(
    bench_logs: MakeLogs, base: Model, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A robot's law within its standard errors may throw it about on rollers."""
    dataset = bench_logs(base)
    monkeypatch.setattr(own_error, "plausible_models", lambda _: [])
    alone = model_error_of(with_own_error(base, dataset))
    late = base.with_effect("command_latency", delay_s=1e6)
    monkeypatch.setattr(own_error, "plausible_models", lambda _: [late])
    assert model_error_of(with_own_error(base, dataset)) == alone
