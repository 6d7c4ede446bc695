"""Logs that cannot show a gap are refused before any work, in the same sentences as by a fit."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from sysid.gap import analyse
from sysid.logs import BenchCommand, Dataset, Run


def bench(command_rpm: float, speed_rpm: float, samples: int) -> Dataset:
    """Return three repeats of a command and a speed that never change."""
    time = 0.01 * np.arange(samples)
    command, speed = BenchCommand(np.full(samples, command_rpm)), np.full(samples, speed_rpm)
    runs = (Run(f"run{k}.csv", "run", "fit", time, command, {"speed_rpm": speed}) for k in range(3))
    return Dataset("still", tuple(runs), ())


@pytest.mark.parametrize(
    ("logs", "message"),
    [
        (
            bench(40.0, 0.0, 300),
            "speed_rpm is 0 in every sample while wheels are commanded up to 40 rpm: a dead sensor or the "
            "wrong column, or no command that moves the wheel; check the logs, or record larger commands",
        ),
        (
            bench(0.0, 0.0, 300),
            "the command is 0 throughout and nothing moves in 3 run(s), the first of which is run0.csv; "
            "record a step from rest",
        ),
        (bench(40.0, 0.0, 2), "6 samples in 3 run(s), at least 7 are needed to find a gap"),
    ],
)
def test_logs_in_which_nothing_moves_are_refused(base: Model, logs: Dataset, message: str) -> None:
    with pytest.raises(InputError) as refusal:
        analyse(logs, base)
    assert message in str(refusal.value)
