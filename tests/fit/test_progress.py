"""What a fit says while it works."""

from pathlib import Path

from sysid.fit import FitOptions, fit_dataset
from sysid.logs import read_dataset

LOGS = Path(__file__).parents[2] / "examples" / "logs"


def test_a_fit_tells_every_stage_once_and_how_far_the_long_one_is():
    told: list[str] = []
    fit_dataset(read_dataset(LOGS), FitOptions(starts=2), told.append)
    stages = [message for message in told if ": effect " not in message]
    assert stages == ["clock of the commands", "delay and ceiling", "output-error: 2 starts", "uncertainty",
                      "drive effects"]  # fmt: skip
    assert all(message.startswith("drive effects: effect ") for message in told if message not in stages)
    assert len(told) > len(stages)
