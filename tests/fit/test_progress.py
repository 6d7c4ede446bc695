"""What a fit says while it works."""

from sysid.fit import FitOptions, fit_dataset


def test_a_fit_tells_every_stage_once_and_how_far_the_long_one_is(bench):
    told: list[str] = []
    fit_dataset(bench(), FitOptions(starts=2), told.append)
    stages = [message for message in told if ": effect " not in message]
    assert stages == ["clock of the commands", "delay and ceiling", "output-error: 2 starts", "uncertainty",
                      "drive effects"]  # fmt: skip
    assert all(message.startswith("drive effects: effect ") for message in told if message not in stages)
    assert len(told) > len(stages)
