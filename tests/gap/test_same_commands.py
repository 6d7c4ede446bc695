"""A study of a robot that drove the commands of the fit again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.units import FloatArray
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import RepeatedCommands, Whitener, repeated_commands
from sysid.compare.predicted import SimulationSettings
from sysid.gap import workflow
from sysid.gap.inquiry import start_search
from sysid.gap.result import GapOptions, GapReport
from sysid.gap.search.beyond_fit import ripples_beyond_fit
from sysid.gap.search.responses import responses
from sysid.gap.search.study_data import study_data
from sysid.gap.workflow import analyse
from sysid.logs import Dataset, Run
from sysid.progress import silent
from tests.compare.repeated_logs import GAIN, MODEL, NOMINAL, PLANAR, logs

SEQUENCES = (1, 2, 3, 4)


def study(new: Dataset) -> GapReport:
    only = ("speed_gain", "command_latency")
    options = GapOptions(fitted_on=NOMINAL, only=only, plant="planar", max_effects=1, next_experiment=False)
    return analyse(new, MODEL, options)


def test_what_the_logs_of_the_fit_show_in_the_same_commands_is_no_gap() -> None:
    report = study(logs(GAIN, SEQUENCES, seed=21))
    assert report.verdict == "no_gap"
    assert any("those of the logs of the fit" in note for note in report.notes)


def test_a_small_change_is_named_beside_a_large_error_of_the_model() -> None:
    report = study(logs(GAIN - 0.01, SEQUENCES, seed=22))
    assert [found.name for found in report.effects] == ["speed_gain"]
    assert abs(report.effects[0].parameters["gain"].value - 0.99) < 0.004
    assert report.effects[0].since == "new"


def rippled(dataset: Dataset, seed: int) -> Dataset:
    """Return logs with four ripples a turn in the wheel speeds, of another phase in each run."""
    rng = np.random.default_rng(seed)

    def run_with(run: Run) -> Run:
        channels = dict(run.channels)
        for name in [name for name in channels if name.endswith("_rpm")]:
            speed = channels[name]
            turns = np.cumsum(speed) * np.median(np.diff(run.time_s)) / 60.0
            channels[name] = speed * (1.0 + 0.06 * np.cos(2.0 * np.pi * (4.0 * turns + rng.random())))
        return replace(run, channels=channels)

    return replace(dataset, runs=tuple(map(run_with, dataset.runs)))


def looked_for(nominal: Dataset, new: Dataset) -> set[str]:
    """Return the effects that are looked for in new logs."""
    repeated = repeated_commands(MODEL, nominal, observe(new), PLANAR)
    assert repeated is not None
    whitener = Whitener(repeated.observations, repeated.noise, None)
    problem = ResidualProblem(MODEL, whitener, PLANAR, None, repeated)
    library = responses(problem, ["speed_gain", "encoder_eccentricity"])
    return {response.effect for response in ripples_beyond_fit(problem, repeated, library).searched}


def test_a_ripple_by_which_repeats_differ_is_not_looked_for() -> None:
    new = rippled(logs(GAIN, SEQUENCES, seed=23), seed=1)
    assert "encoder_eccentricity" in looked_for(NOMINAL, new)
    assert "encoder_eccentricity" not in looked_for(rippled(NOMINAL, seed=2), new)


def test_a_threshold_of_a_robot_does_not_vary_from_run_to_run(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    def seen(self: RepeatedCommands, _: Whitener, effects: Sequence[FloatArray]) -> RepeatedCommands:
        asked.append(len(effects))
        return self

    monkeypatch.setattr(RepeatedCommands, "with_varying", seen)
    new, settings = logs(GAIN, SEQUENCES, seed=24), SimulationSettings(plant="planar", jobs=1)
    data = study_data(new, MODEL, GapOptions(fitted_on=NOMINAL, plant="planar"))
    search = start_search(data, MODEL, settings, ("speed_gain", "command_deadband"), silent)
    library = (*search.library, *search.considered.left_out)
    assert {response.effect for response in library} == {"speed_gain", "command_deadband"}
    assert asked == [1]


@pytest.mark.parametrize(("threshold_rpm", "is_there"), [(0.0, False), (15.0, True)])
def test_a_threshold_is_looked_for_where_it_does_more_than_chance(
    threshold_rpm: float, is_there: bool
) -> None:
    new, settings = logs(GAIN, SEQUENCES, seed=24), SimulationSettings(plant="planar", jobs=1)
    model = MODEL.with_effect("command_deadband", threshold_rpm=threshold_rpm) if threshold_rpm else MODEL
    # The model, and not the robot, has the threshold: its error in the logs of the fit is of one without.
    data = study_data(new, MODEL, GapOptions(fitted_on=NOMINAL, plant="planar"))
    search = start_search(data, model, settings, ("speed_gain", "command_deadband"), silent)
    assert ("command_deadband" in {response.effect for response in search.library}) == is_there
    assert search.considered.least["command_deadband"] > 10.0


def test_what_one_sequence_shows_is_no_gap() -> None:
    """Its repeat would tell that this run differs from it, but there is none."""
    new, odd = logs(GAIN, (1, 2), 26, repeats=1), logs(GAIN - 0.005, (1,), 27, repeats=1)
    report = study(replace(new, runs=(*odd.runs, *new.runs[1:])))
    assert report.verdict == "no_gap"
    assert "speed_gain would be significant" in report.notes[-1]
    assert "one command sequence shows nearly all of it" in report.notes[-1]


def test_what_would_be_of_one_sequence_is_not_called_detectable(monkeypatch: pytest.MonkeyPatch) -> None:
    new = logs(GAIN, SEQUENCES, seed=21)
    assert "speed_gain" in study(new).smallest_detectable
    monkeypatch.setattr(workflow, "least_falls", lambda *_: {"speed_gain": 1e9})
    assert "speed_gain" not in study(new).smallest_detectable
