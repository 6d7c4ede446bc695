"""The target system behaves as the published robot does, and stays outside the law's model class."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mecanum_env.errors import InputError
from sysid.studies.target_system import TargetRecord, TargetSystem, simulate_target

SPEEDS = tuple(range(10, 131, 10))


def quiet(command: object, **changes: Any) -> TargetRecord:
    system = replace(TargetSystem(), **changes)
    return simulate_target(
        np.asarray(command, float),
        rng=np.random.default_rng(0),
        system=system,
        noise_rpm=0.0,
        sample_period_s=0.001,
    )


@pytest.fixture(scope="module")
def steps() -> dict[int, TargetRecord]:
    return {speed: quiet(np.full(15, speed)) for speed in SPEEDS}


def rise_and_settling(record: TargetRecord) -> tuple[float, float]:
    time, speed = record.time_s, record.true_speed_rpm
    final = speed[-200:].mean()
    rise = time[np.argmax(speed >= 0.9 * final)] - time[np.argmax(speed >= 0.1 * final)]
    outside = np.flatnonzero(np.abs(speed - final) > 0.02 * abs(final))
    return float(rise), float(time[outside[-1] + 1])


def test_rise_and_settling_are_the_published_ones(steps: dict[int, TargetRecord]) -> None:
    figures = np.array([rise_and_settling(record) for record in steps.values()])
    assert figures[:, 0].mean() == pytest.approx(0.11, abs=0.005)
    assert figures[:, 1].mean() == pytest.approx(0.25, abs=0.01)


def test_the_mean_steady_state_error_is_the_published_one(steps: dict[int, TargetRecord]) -> None:
    errors = [record.true_speed_rpm[-500:].mean() / speed - 1.0 for speed, record in steps.items()]
    assert np.mean(errors) == pytest.approx(4.5e-4, abs=0.5e-4)


def test_the_ceiling_is_135_rpm() -> None:
    assert quiet(np.full(15, 140.0)).true_speed_rpm[-1] == pytest.approx(135.0, rel=1e-3)
    assert quiet(np.full(15, -200.0)).true_speed_rpm[-1] == pytest.approx(-135.0, rel=1e-3)


def test_the_voltage_limit_bends_large_steps(steps: dict[int, TargetRecord]) -> None:
    limited, free = steps[130], quiet(np.full(15, 130.0), supply_v=1000.0)
    assert np.max(np.abs(limited.true_speed_rpm - free.true_speed_rpm)) > 2.0
    assert (
        np.max(np.abs(steps[60].true_speed_rpm - quiet(np.full(15, 60.0), supply_v=1000.0).true_speed_rpm))
        < 0.01
    )


def test_friction_slows_small_steps_more(steps: dict[int, TargetRecord]) -> None:
    at_50_ms = {speed: record.true_speed_rpm[50] / speed for speed, record in steps.items()}
    assert at_50_ms[10] < at_50_ms[40] - 0.02


def test_without_friction_limits_and_encoder_the_drive_is_linear() -> None:
    changes = {"friction_n_m": 0.0, "supply_v": 1e6, "encoder_counts": 10_000_000, "speed_window": 1}
    one, three = (quiet(np.full(10, v), **changes).true_speed_rpm for v in (30.0, 90.0))
    np.testing.assert_allclose(3.0 * one, three, atol=0.01)


def test_forward_and_reverse_are_alike() -> None:
    forward, reverse = (quiet(np.full(10, v)).true_speed_rpm for v in (40.0, -40.0))
    np.testing.assert_allclose(forward, -reverse, atol=0.5)


def test_commands_are_rounded_to_whole_rpm() -> None:
    np.testing.assert_array_equal(
        quiet(np.full(5, 40.3)).true_speed_rpm, quiet(np.full(5, 40.0)).true_speed_rpm
    )


def test_a_wheel_at_rest_stays_at_rest() -> None:
    np.testing.assert_array_equal(quiet(np.zeros(5)).true_speed_rpm, 0.0)


def test_the_logged_speed_is_counts_and_noise() -> None:
    record = simulate_target(np.full(20, 60.0), rng=np.random.default_rng(0), noise_rpm=0.0)
    count_rpm = 60.0 / (2048 * 20 * 0.01)
    np.testing.assert_allclose(record.speed_rpm / count_rpm, np.rint(record.speed_rpm / count_rpm), atol=1e-9)
    noisy = simulate_target(np.full(200, 60.0), rng=np.random.default_rng(0), noise_rpm=0.5)
    assert np.std(noisy.speed_rpm[1000:]) == pytest.approx(0.5, rel=0.1)


def test_equal_seeds_give_equal_logs() -> None:
    one, other = (simulate_target([20.0, 50.0], rng=np.random.default_rng(4)) for _ in range(2))
    np.testing.assert_array_equal(one.speed_rpm, other.speed_rpm)


def test_the_log_has_the_commands_as_sent() -> None:
    record = simulate_target([0.0, 140.0], rng=np.random.default_rng(0), sample_period_s=0.05)
    np.testing.assert_allclose(record.time_s, [0.0, 0.05, 0.1, 0.15, 0.2])
    np.testing.assert_array_equal(record.command_rpm, [0.0, 0.0, 140.0, 140.0, 140.0])


def test_no_commands_and_odd_periods_are_refused() -> None:
    with pytest.raises(InputError, match="command_rpm is empty"):
        simulate_target([], rng=np.random.default_rng(0))
    with pytest.raises(
        InputError, match=r"sample_period_s is 8.33\S* control periods, must be a whole number"
    ):
        simulate_target([1.0], rng=np.random.default_rng(0), sample_period_s=1 / 120)
