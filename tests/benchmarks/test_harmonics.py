"""The ripples of a measured speed, without a model: any that is there, and that of the Robotino's wheels."""

from pathlib import Path

import numpy as np
import pytest

from sysid.logs import BenchCommand, Dataset, Run, read_dataset


@pytest.fixture(scope="module")
def harmonics(benchmark_of):
    return benchmark_of("harmonics")


def test_a_ripple_is_found_at_its_periods_per_turn_with_its_amplitude(harmonics):
    rng = np.random.default_rng(1)
    time_s = np.arange(0.0, 8.0, 0.01)
    runs = []
    for speed_rpm in (60.0, -90.0):
        angle = speed_rpm * 2.0 * np.pi / 60.0 * time_s
        speed = speed_rpm + 0.8 * np.cos(6.0 * angle + 1.0) + rng.normal(0.0, 0.2, time_s.size)
        command = BenchCommand(np.full(time_s.size, speed_rpm))
        runs.append(Run("x.csv", "x", "fit", time_s, command, {"speed_rpm": speed}))
    found_rpm = harmonics.harmonics_rpm(Dataset("x", tuple(runs), ()))
    assert int(np.argmax(found_rpm)) + 1 == 6
    assert found_rpm[5] == pytest.approx(0.8, rel=0.1)
    assert np.median(found_rpm) < 0.1


@pytest.mark.parametrize("floor", ["floor_table", "floor_gray"])
@pytest.mark.parametrize("motor", ["motor1", "motor2", "motor3"])
def test_wheels_swing_six_times_per_turn_on_a_floor(
    robotino: Path, harmonics, floor: str, motor: str
) -> None:
    found_rpm = harmonics.harmonics_rpm(read_dataset(robotino / floor / motor))
    assert int(np.argmax(found_rpm)) + 1 == 6
