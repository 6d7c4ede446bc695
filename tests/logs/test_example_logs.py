import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sysid.logs import read_dataset
from sysid.logs.noise import noise_from_repeats
from sysid.logs.runs import SPLITS

EXAMPLES = Path(__file__).parents[2] / "examples"
FOLDERS = {"logs": "make_example_logs", "gap_logs": "make_gap_logs"}
"""Folder of logs -> script that makes it."""


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(("folder", "name"), FOLDERS.items())
def test_the_example_logs_are_what_the_script_makes(folder: str, name: str) -> None:
    made, read = script(name).make_dataset(), read_dataset(EXAMPLES / folder)
    assert read.name == made.name
    expected = {run.file: run for run in made.runs}
    assert {run.file for run in read.runs} == set(expected)
    for run in read.runs:
        other = expected[run.file]
        assert (run.group, run.split) == (other.group, other.split)
        np.testing.assert_array_equal(run.command.wheels_rpm, other.command.wheels_rpm)
        # Another platform's libm may move the last bit, and so now and then one encoder count (0.15 rpm).
        np.testing.assert_allclose(run.channel("speed_rpm"), other.channel("speed_rpm"), atol=0.16)


@pytest.mark.parametrize("folder", FOLDERS)
def test_the_example_logs_are_small_clean_and_have_repeats(folder: str) -> None:
    assert sum(file.stat().st_size for file in (EXAMPLES / folder).iterdir()) < 300_000
    data = read_dataset(EXAMPLES / folder)
    assert data.findings == ()
    noise = noise_from_repeats(data.runs)
    assert noise is not None
    assert noise["speed_rpm"].std == pytest.approx(0.5, rel=0.05)


def test_the_hidden_change_of_the_gap_logs_is_in_no_command() -> None:
    maker = script("make_gap_logs")
    sent = np.repeat([0.0, 12.0, -12.0, 13.0, -60.0], 100)
    seen = maker.changed(sent)
    assert not seen[:300].any()
    assert seen[399] == 13.0
    assert seen[499] == -60.0
    assert np.max(np.abs(np.diff(seen))) == pytest.approx(maker.RAMP_RPM_S * maker.TICK_S)


def test_every_part_of_the_gap_logs_has_commands_that_the_dead_band_swallows() -> None:
    threshold = script("make_gap_logs").DEAD_BAND_RPM
    data = read_dataset(EXAMPLES / "gap_logs")
    for split in SPLITS:
        sizes = np.abs(np.concatenate([run.command.wheels_rpm for run in data.split(split)]))
        assert np.any((sizes > 0.0) & (sizes < threshold))
