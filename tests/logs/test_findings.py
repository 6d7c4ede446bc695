from collections.abc import Callable

import numpy as np
import pytest

from mecanum_env.units import RAD_S_PER_RPM
from sysid.logs import BodyCommand, Finding, Run
from sysid.logs.checks import _moving, dataset_findings, run_findings
from sysid.logs.findings import KINDS

BenchRun = Callable[..., Run]
Step = Callable[..., np.ndarray]
COMMAND = np.concatenate([np.zeros(50), np.full(100, 40.0), np.full(100, -60.0), np.full(100, 90.0)])


def follow(command: np.ndarray, time_constant_s: float = 0.08, noise: float = 0.3) -> np.ndarray:
    """A first-order wheel and noise, read to 0.01 rpm."""
    speed = np.zeros(command.size)
    for k in range(command.size - 1):
        speed[k + 1] = speed[k] + (command[k] - speed[k]) * 0.01 / time_constant_s
    return np.round(speed + noise * np.random.default_rng(7).standard_normal(command.size), 2)


def short_holds(hold_s: float, seed: int = 0) -> np.ndarray:
    """Commands drawn at random, each held for a time [s]."""
    levels = np.random.default_rng(seed).integers(-110, 111, 8)
    return np.repeat(np.append(0, levels), round(hold_s / 0.01)).astype(float)


def kinds(run: Run) -> dict[str, Finding]:
    found = {finding.kind: finding for finding in run_findings(run)}
    assert set(found) <= set(KINDS)
    return found


def test_a_good_run_has_no_findings(bench_run: BenchRun) -> None:
    assert kinds(bench_run("a.csv", COMMAND, follow(COMMAND))) == {}


def test_rounding_to_one_rpm_is_not_taken_for_held_samples(bench_run: BenchRun) -> None:
    assert kinds(bench_run("a.csv", COMMAND, np.round(follow(COMMAND)))) == {}


def test_coarse_steps_beside_noise_and_jumps_are_not_taken_for_held_samples(bench_run: BenchRun) -> None:
    jump = np.where(np.arange(COMMAND.size) // 6 % 2 == 0, 0.0, 90.0)
    noisy = np.round((jump + np.random.default_rng(0).normal(0.0, 0.8, jump.size)) / 1.7) * 1.7
    assert "held_samples" not in kinds(bench_run("a.csv", COMMAND, noisy))


@pytest.mark.parametrize("factor", [2, 3])
def test_held_samples_are_seen_with_their_share(factor: int, bench_run: BenchRun) -> None:
    held = np.repeat(follow(COMMAND)[::factor], factor)[: COMMAND.size]
    found = kinds(bench_run("a.csv", COMMAND, held))
    assert found["held_samples"].value == pytest.approx(1 - 1 / factor, abs=0.06)
    assert found["held_samples"].channel == "speed_rpm"


def test_uneven_stamps_are_seen_with_their_spread(bench_run: BenchRun) -> None:
    interval = np.where(np.arange(COMMAND.size) % 4 == 0, 0.012, 0.003)
    found = kinds(bench_run("a.csv", COMMAND, follow(COMMAND), time_s=np.cumsum(interval)))
    assert found["uneven_stamps"].value == pytest.approx(3.0)
    assert "intervals of 3 to 12 ms" in found["uneven_stamps"].message


def test_a_gap_is_seen_with_its_length(bench_run: BenchRun) -> None:
    time = 0.01 * np.arange(COMMAND.size)
    time[200:] += 0.7
    found = kinds(bench_run("a.csv", COMMAND, follow(COMMAND), time_s=time))
    assert found["gap"].value == pytest.approx(0.71)
    assert "uneven_stamps" not in found


def test_missing_cells_are_counted(bench_run: BenchRun) -> None:
    speed = follow(COMMAND)
    speed[::5] = np.nan
    assert kinds(bench_run("a.csv", COMMAND, speed))["missing"].value == pytest.approx(0.2)


def test_a_dead_sensor_is_seen(bench_run: BenchRun) -> None:
    assert "stuck" in kinds(bench_run("a.csv", COMMAND, np.zeros(COMMAND.size)))


def test_a_sensor_that_freezes_on_the_way_is_seen(bench_run: BenchRun) -> None:
    speed = follow(COMMAND)
    speed[100:240] = speed[100]
    found = kinds(bench_run("a.csv", COMMAND, speed))
    assert found["stuck"].value == pytest.approx(1.39)


def test_rest_while_nothing_is_commanded_is_not_stuck(bench_run: BenchRun) -> None:
    assert kinds(bench_run("a.csv", np.zeros(50), np.zeros(50))) == {}


@pytest.mark.parametrize(
    ("scale", "sentence"),
    [
        (RAD_S_PER_RPM, "speed_rpm in rad/s? (scale = 9.549"),
        (1 / RAD_S_PER_RPM, "the command in rad/s? (scale = 9.549"),
        (1 / 60, "speed_rpm in turns/s? (scale = 60)"),
        (-1.0, "is the sign reversed? (scale = -1)"),
    ],
)
def test_a_wrong_unit_is_seen(scale: float, sentence: str, bench_run: BenchRun) -> None:
    run = bench_run("a.csv", COMMAND, scale * follow(COMMAND))
    (finding,) = dataset_findings([run])
    assert finding.kind == "units"
    assert sentence in finding.message
    assert finding.value == pytest.approx(scale, rel=0.02)


@pytest.mark.parametrize("gain", [0.3, 0.7, 1.0, 1.4, 3.0])
def test_a_slow_or_fast_wheel_is_not_taken_for_a_unit(gain: float, bench_run: BenchRun) -> None:
    assert dataset_findings([bench_run("a.csv", COMMAND, gain * follow(COMMAND))]) == []


@pytest.mark.parametrize("hold_s", [0.2, 0.3, 0.5])
def test_a_wrong_unit_is_seen_where_no_command_is_held_for_long(hold_s: float, bench_run: BenchRun) -> None:
    run = bench_run("a.csv", command := short_holds(hold_s), RAD_S_PER_RPM * follow(command, 0.05))
    (finding,) = dataset_findings([run])
    assert "speed_rpm in rad/s? (scale = 9.549" in finding.message


@pytest.mark.parametrize("hold_s", [0.1, 0.2, 0.5])
@pytest.mark.parametrize("time_constant_s", [0.05, 0.3, 1.0, 5.0])
def test_a_wheel_that_has_not_settled_is_not_taken_for_a_unit(
    hold_s: float, time_constant_s: float, bench_run: BenchRun
) -> None:
    runs = [
        bench_run(f"{seed}.csv", command := short_holds(hold_s, seed), follow(command, time_constant_s))
        for seed in range(20)
    ]
    assert all(dataset_findings([run]) == [] for run in runs)


def test_milliseconds_are_seen(bench_run: BenchRun) -> None:
    run = bench_run("a.csv", COMMAND, follow(COMMAND), time_s=10.0 * np.arange(COMMAND.size))
    assert "milliseconds" in kinds(run)["units"].message


def body_run(theta: float, yaw_rate: float) -> Run:
    n = 50
    command = BodyCommand(np.full(n, 20.0), np.full(n, theta), np.zeros(n))
    rate = yaw_rate * np.sin(np.arange(n))
    return Run("a.csv", "a", "fit", 0.01 * np.arange(n), command, {"yaw_rate_rad_s": rate})


def test_an_angle_in_radians_is_seen() -> None:
    assert "radians" in kinds(body_run(1.5708, 0.01))["units"].message
    assert "units" not in kinds(body_run(90.0, 0.01))


def test_a_yaw_rate_in_degrees_is_seen() -> None:
    assert "degrees per second" in kinds(body_run(0.0, 80.0))["units"].message


def test_commands_faster_than_the_robot_takes_them_are_counted(bench_run: BenchRun) -> None:
    command = np.repeat([0.0, 10.0, 20.0, 30.0, 40.0], [50, 5, 5, 50, 50])
    assert kinds(bench_run("a.csv", command, follow(command)))["fast_commands"].value == 2.0


def test_commands_at_the_robots_own_period_are_fine(bench_run: BenchRun) -> None:
    command = np.repeat(10.0 * np.arange(20), 10)[:120]
    assert "fast_commands" not in kinds(bench_run("a.csv", command, follow(command)))


@pytest.mark.parametrize(("peak", "beyond"), [(134.0, False), (135.0, False), (140.0, True)])
def test_speeds_above_the_limit_are_seen(
    peak: float, beyond: bool, bench_run: BenchRun, step_command: Step
) -> None:
    command = step_command(peak)
    assert ("beyond_limit" in kinds(bench_run("a.csv", command, follow(command)))) is beyond


def test_a_moving_start_is_seen_with_its_speed(bench_run: BenchRun) -> None:
    found = kinds(bench_run("a.csv", COMMAND, follow(COMMAND) + 12.0))
    assert found["not_at_rest"].value == pytest.approx(12.0, abs=0.5)


def test_noise_at_rest_is_no_moving_start(bench_run: BenchRun) -> None:
    speed = follow(COMMAND)
    speed[:3] = (1.2, -0.4, 0.1)
    assert "not_at_rest" not in kinds(bench_run("a.csv", COMMAND, speed))


def test_one_sensor_under_two_names_is_seen() -> None:
    base = body_run(0.0, 0.1)
    speed = np.sin(np.arange(50))
    both = {"speed_fl_rpm": speed, "speed_rl_rpm": speed.copy()}
    found = kinds(Run("a.csv", "a", "fit", base.time_s, base.command, both))["same_channel"]
    assert (found.channel, found.details["other"]) == ("speed_rl_rpm", "speed_fl_rpm")
    assert found.message == "speed_rl_rpm repeats speed_fl_rpm: one sensor, not two"


@pytest.mark.parametrize(
    "damage", [lambda x: x * np.nan, lambda x: np.where(np.arange(x.size) < 1, x, np.nan)]
)
def test_channels_without_samples_raise_no_error(
    damage: Callable[[np.ndarray], np.ndarray], bench_run: BenchRun
) -> None:
    run = bench_run("a.csv", COMMAND, damage(follow(COMMAND)))
    assert "missing" in kinds(run)
    assert dataset_findings([run]) == []


def test_the_largest_numbers_that_a_file_can_hold_do_not_overflow():
    largest = np.array([2.7e306, -1.77e308, 1.7e308, -1.7e308, 1e308, 0.0, 1.0, 2.0])
    assert _moving(largest).any()
    assert not _moving(np.arange(20.0)).any()


def test_commands_that_stand_a_row_late_are_found(bench_run: BenchRun) -> None:
    """A program that sends, waits and then reads writes a row in which the wheel has moved already."""
    late = np.concatenate([COMMAND[:1], COMMAND[:-1]])
    (finding,) = dataset_findings([bench_run(f"{i}.csv", late, follow(COMMAND)) for i in range(2)])
    assert finding.kind == "late_rows"
    assert "6 of 6 changes" in finding.message


def test_commands_in_the_row_of_their_time_are_not_late(bench_run: BenchRun) -> None:
    assert dataset_findings([bench_run(f"{i}.csv", COMMAND, follow(COMMAND)) for i in range(2)]) == []


def test_the_largest_numbers_are_looked_at_without_a_warning(bench_run: BenchRun) -> None:
    dataset_findings([bench_run("a.csv", np.zeros(3), np.array([0.0, 1.7e308, -1.7e308]))])
