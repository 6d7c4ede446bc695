"""The thresholds that a search tries lie between the sizes of the commands in the logs."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.effects import CATALOGUE
from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray
from sysid.compare.search_space import coordinate, scale_of, scanned
from sysid.logs import BenchCommand, BodyCommand, Run

DEAD_BAND = CATALOGUE["command_deadband"]
ENDLESS = replace(paper_model(), wheel=replace(paper_model().wheel, saturation_rpm=np.inf))
LIMITED = paper_model()


def run_of(commands_rpm: FloatArray) -> Run:
    time_s = 0.1 * np.arange(commands_rpm.size)
    return Run("x.csv", "x", "fit", time_s, BenchCommand(commands_rpm), {"speed_rpm": commands_rpm})


def thresholds(run: Run, model: Model = ENDLESS) -> FloatArray:
    """Return the dead bands that a search tries [rpm], in rising order."""
    parameter, scale = DEAD_BAND.parameters[0], scale_of(model, (run,))
    one = coordinate(model, DEAD_BAND, parameter, scale)
    return np.sort([one.value(place) for place in scanned(parameter, one, scale)])


@given(st.lists(st.integers(-150, 150), min_size=2, max_size=30, unique_by=abs), st.floats(1.0, 160.0))
def test_whatever_a_dead_band_ignores_one_that_is_tried_ignores(sizes: list[int], true_rpm: float) -> None:
    commands = 10.0 * np.array([0, *sizes])
    kept = np.abs(commands) >= 10.0 * true_rpm
    if not np.any(kept) or np.all(kept | (commands == 0.0)):
        return
    tried = [np.abs(commands) >= threshold for threshold in thresholds(run_of(commands))]
    assert any(np.array_equal(kept, one) for one in tried)


def test_commands_that_never_repeat_get_a_few_thresholds_over_their_range() -> None:
    found = thresholds(run_of(np.linspace(0.0, 100.0, 1000)))
    assert found.size == 32
    assert np.max(np.diff(found)) < 4.0


def test_a_dead_band_between_commands_above_the_ceiling_is_tried() -> None:
    commands = np.array([0.0, 60.0, 150.0, 200.0])
    found = thresholds(run_of(commands), LIMITED)
    assert LIMITED.wheel.saturation_rpm < 150.0
    assert [np.count_nonzero(commands >= threshold) for threshold in found] == [2, 1]


def test_a_robots_dead_band_is_tried_at_the_sizes_of_the_catalogue() -> None:
    numbers = np.array([0.0, 30.0, 60.0])
    run = replace(run_of(numbers), command=BodyCommand(numbers, numbers, numbers))
    assert scale_of(LIMITED, (run,)).thresholds_rpm == ()
