"""The clock of the commands, found between the rows of a log."""

import numpy as np
import pytest

from sysid.fit.drive.command_clock import command_clock_s
from sysid.logs import BenchCommand, Run


def log(period_s: float, rows_s: float, jitter_s: float = 0.0, seed: int = 0) -> list[Run]:
    """Return runs of random commands sent on a clock, each shown in the first row after it."""
    rng = np.random.default_rng(seed)
    runs = []
    for number in range(4):
        time_s = np.arange(0.0, 4.0, rows_s)
        time_s[1:] += np.clip(jitter_s * rng.standard_normal(time_s.size - 1), -0.4 * rows_s, 0.4 * rows_s)
        time_s = np.round(time_s, 6)
        levels = np.repeat(rng.integers(-100, 101, 100), rng.integers(2, 9, 100)).astype(float)
        command = levels[np.floor(time_s / period_s + 1e-9).astype(int)]
        speed = {"speed_rpm": np.zeros(time_s.size)}
        runs.append(Run(f"run_{number}.csv", f"run_{number}", "fit", time_s, BenchCommand(command), speed))
    return runs


@pytest.mark.parametrize(
    ("period_s", "rows_s", "jitter_s"),
    [(0.05, 0.018, 0.002), (0.02962, 0.02, 0.0), (0.04, 0.02, 0.0), (0.025, 0.01, 0.0002), (0.1, 0.03, 0.0)],
)
def test_the_clock_is_found_between_rows(period_s, rows_s, jitter_s):
    assert command_clock_s(log(period_s, rows_s, jitter_s)) == pytest.approx(period_s, rel=1e-3)


def test_commands_as_fast_as_the_rows_show_no_clock():
    assert command_clock_s(log(0.02, 0.02)) is None
    assert command_clock_s(log(0.013, 0.02)) is None


def test_commands_at_any_times_have_no_clock():
    rng = np.random.default_rng(3)
    time_s = np.arange(0.0, 20.0, 0.01)
    changes = np.cumsum(rng.uniform(0.05, 0.4, 60))
    command = rng.uniform(-100.0, 100.0, 61)[np.searchsorted(changes, time_s)]
    run = Run("a.csv", "a", "fit", time_s, BenchCommand(command), {"speed_rpm": np.zeros(time_s.size)})
    assert command_clock_s([run]) is None
