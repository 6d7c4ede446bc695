import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from sysid.logs import read_dataset
from sysid.logs.noise import noise_from_repeats

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture(scope="module")
def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("make_example_logs", EXAMPLES / "make_example_logs.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_example_logs_are_what_the_script_makes(script: ModuleType) -> None:
    made, read = script.make_dataset(), read_dataset(EXAMPLES / "logs")
    assert read.name == made.name
    expected = {run.file: run for run in made.runs}
    assert {run.file for run in read.runs} == set(expected)
    for run in read.runs:
        other = expected[run.file]
        assert (run.group, run.split) == (other.group, other.split)
        np.testing.assert_array_equal(run.command.wheels_rpm, other.command.wheels_rpm)
        # Another platform's libm may move the last bit, and so now and then one encoder count (0.15 rpm).
        np.testing.assert_allclose(run.channel("speed_rpm"), other.channel("speed_rpm"), atol=0.16)


def test_the_example_logs_are_small_clean_and_have_repeats() -> None:
    assert sum(file.stat().st_size for file in (EXAMPLES / "logs").iterdir()) < 300_000
    data = read_dataset(EXAMPLES / "logs")
    assert data.findings == ()
    noise = noise_from_repeats(data.runs)
    assert noise is not None
    assert noise["speed_rpm"].std == pytest.approx(0.5, rel=0.05)
