"""The gap without what the model errs by in the logs of its fit, where the same commands were driven."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from sysid.compare.least_squares import ResidualProblem
from sysid.compare.measured import observe
from sysid.compare.model_error import Whitener, with_adopted
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import SimulationSettings
from sysid.gap.report.beside_fit import gap_beside_fit
from sysid.gap.report.held_out import compare, differences, predicted, without_scatter
from sysid.gap.result import Difference
from sysid.gap.wording import closure
from sysid.logs import Dataset
from tests.compare.repeated_logs import GAIN, MODEL, NOISE, NOMINAL, PLANAR, logs

SEQUENCES = (1, 2, 3)
CHANGED = 0.88
"""Gain of the robot after a change."""
BEFORE, AFTER = (MODEL.with_effect("speed_gain", gain=gain) for gain in (GAIN, CHANGED))
"""Models with the robot's gain, and without its latency."""
GAINS = ("gain_fl", "gain_fr", "gain_rl", "gain_rr")


def gaps(new: Dataset, better: Model, model: Model = MODEL) -> tuple[Difference, Difference | None]:
    """Return the gap of new logs that a `better` model closes, plain and beside the logs of the fit."""
    runs = new.runs
    before, after = (predicted(one, runs, PLANAR) for one in (model, better))
    comparison = compare("test", runs, before, after)
    plain = differences(new, comparison, NOISE)[0]
    return plain, gap_beside_fit(new, NOMINAL, model, comparison, runs, NOISE, PLANAR)


def test_of_a_robot_in_which_nothing_changed_the_noise_is_left() -> None:
    plain, beside = gaps(logs(GAIN, SEQUENCES, seed=31), MODEL)
    assert beside is not None
    assert beside.noise_floor == 1.0
    assert plain.before > 3.0
    assert beside.before == pytest.approx(1.0, rel=0.1)


def test_the_right_change_closes_the_gap_that_it_does_not_close_beside_the_plain_error() -> None:
    plain, beside = gaps(logs(CHANGED, SEQUENCES, seed=32), AFTER, BEFORE)
    assert beside is not None
    # The latency, which the model lacked when it was fitted, remains.
    assert closure(plain) < 0.6
    # It changed with the gain, by a twentieth.
    assert closure(beside) > 0.8


def test_what_the_model_adopted_after_its_fit_is_no_error_of_the_fit() -> None:
    name = ["wheel_gain_mismatch"]
    model = BEFORE.with_effect(name[0], **dict.fromkeys(GAINS, CHANGED / GAIN))
    adopted = with_adopted(model, [f"{name[0]}.{one}" for one in GAINS], np.eye(4) * 1e-6, name, name)
    _, beside = gaps(logs(CHANGED, SEQUENCES, seed=33), adopted, adopted)
    assert beside is not None
    assert beside.before == pytest.approx(1.0, rel=0.4)


def test_without_repeats_the_noise_is_that_of_the_logs_of_the_fit() -> None:
    single = logs(GAIN, SEQUENCES, seed=37, repeats=1)
    given = predicted(MODEL, single.runs, PLANAR)
    comparison = compare("test", single.runs, given, given)
    unknown = differences(single, comparison, NOISE)[0]
    assert unknown.noise_floor is None
    total, channels = differences(single, comparison, NOISE, NOMINAL)
    assert total.before == pytest.approx(unknown.before, rel=0.1), "sigma is that of the noise in any case"
    assert total.noise_floor == 1.0
    assert channels["speed_fl_rpm"].noise_floor == pytest.approx(NOISE["speed_fl_rpm"], rel=0.1)
    beside = gap_beside_fit(single, NOMINAL, MODEL, comparison, single.runs, NOISE, PLANAR)
    assert beside is not None
    assert beside.before == pytest.approx(1.0, rel=0.1)


def test_a_recording_is_none_beside_itself() -> None:
    """Its own residual, taken off, would leave nothing, and any effect would raise that."""
    single = logs(GAIN, SEQUENCES, seed=38, repeats=1)
    given = predicted(MODEL, single.runs, PLANAR)
    comparison = compare("test", single.runs, given, given)
    assert gap_beside_fit(single, single, MODEL, comparison, single.runs, NOISE, PLANAR) is None
    repeated = replace(NOMINAL, runs=(*NOMINAL.runs, *single.runs))
    beside = gap_beside_fit(single, repeated, MODEL, comparison, single.runs, NOISE, PLANAR)
    assert beside is not None
    assert beside.before == pytest.approx(1.0, rel=0.1)


def test_runs_with_other_commands_than_the_logs_of_the_fit_are_left_out() -> None:
    _, none = gaps(logs(GAIN, (91, 92), seed=34), MODEL)
    assert none is None
    _, some = gaps(logs(GAIN, (*SEQUENCES, 91), seed=35), MODEL)
    assert some is not None
    assert some.before == pytest.approx(1.0, rel=0.1)


def test_a_channel_that_the_logs_of_the_fit_lack_is_left_out() -> None:
    new = logs(GAIN, SEQUENCES, seed=36)
    runs = tuple(
        replace(run, channels={name: value for name, value in run.channels.items() if name != "vy_m_s"})
        for run in NOMINAL.runs
    )
    lacking = replace(NOMINAL, runs=runs)
    given = predicted(MODEL, new.runs, PLANAR)
    comparison = compare("test", new.runs, given, given)
    beside = gap_beside_fit(new, lacking, MODEL, comparison, new.runs, NOISE, PLANAR)
    assert beside is not None
    assert beside.before == pytest.approx(1.0, rel=0.1)


def test_the_change_of_an_effect_has_no_scatter_of_the_rollers_in_it() -> None:
    dataset = logs(GAIN, SEQUENCES[:1], seed=34)
    runs, observations = dataset.runs[:1], observe(dataset)
    whitener = Whitener(observations, measure_noise(dataset, observations), None)
    problem = ResidualProblem(MODEL, whitener, SimulationSettings("rollers"))
    models = (MODEL, MODEL.with_effect("track_width", scale=1.03))
    planar = [predicted(model, runs, PLANAR)[0] for model in models]
    # What the rollers add to either prediction.
    on_rollers = [
        {name: v + more for name, v in one.items()} for one, more in zip(planar, (2.0, 5.0), strict=True)
    ]
    before, after = ([one] for one in on_rollers)
    (found,) = without_scatter(problem, ["track_width"], models, runs, (before, after))
    for name, values in found.items():
        np.testing.assert_allclose(values, planar[1][name] + 2.0, atol=1e-9)
    assert np.max(np.abs(found["yaw_rate_rad_s"] - before[0]["yaw_rate_rad_s"])) > 0.01
    assert without_scatter(problem, ["low_grip"], models, runs, (before, after)) is after
    assert without_scatter(problem, [], models, runs, (before, after)) is after
