"""Where in the backlash of its gear a run starts."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from mecanum_env.effects.apply import sensors_of
from mecanum_env.model import paper_model
from mecanum_env.simulator import replay_bench
from mecanum_env.simulator.free_wheel import BenchRun, FreeWheel
from sysid.compare.measured import observe
from sysid.compare.predicted import MIDDLE, Simulator, gap_start, predict
from sysid.compare.predicted.gap_start import SeenSpeed, motions_from_gap
from sysid.logs import BenchCommand, Dataset, Run

LOOSE = paper_model().with_effect("backlash", "rest", gap_deg=20.0, slowing_rpm_s=300.0)
TIME = np.arange(0.0, 2.0, 0.01)
COMMAND = np.where(TIME < 0.2, 0.0, np.where(TIME < 1.1, 60.0, -40.0))


def run_from(gap_share: float, name: str = "a", model=LOOSE, noise_rpm: float = 0.0) -> Run:
    speed = replay_bench(model, TIME, COMMAND, gap_share=gap_share)
    speed = speed + noise_rpm * np.random.default_rng(0).normal(size=TIME.size)
    return Run(f"{name}.csv", name, "fit", TIME, BenchCommand(COMMAND), {"speed_rpm": speed})


@given(gap_share=st.floats(-1.0, 1.0))
@example(gap_share=-0.8125)
def test_a_prediction_starts_where_the_run_shows_it_to(gap_share: float) -> None:
    run = run_from(gap_share, noise_rpm=0.1)
    # The last distance at which the place is looked for is a sixteenth of half the gap.
    near = replay_bench(LOOSE, TIME, COMMAND, gap_share=float(np.clip(gap_share - 0.07, -1.0, 1.0)))
    also = replay_bench(LOOSE, TIME, COMMAND, gap_share=float(np.clip(gap_share + 0.07, -1.0, 1.0)))
    off = [
        np.sum((run.channels["speed_rpm"] - one) ** 2)
        for one in (predict(LOOSE, run)["speed_rpm"], near, also)
    ]
    assert off[0] <= max(off[1:]) + 1e-9


def test_runs_of_equal_commands_start_each_where_they_do() -> None:
    places = (-1.0, 0.0, 0.5, 1.0)
    runs = tuple(run_from(place, str(place)) for place in places)
    found = [predict(LOOSE, run)["speed_rpm"] for run in runs]
    for run, predicted in zip(runs, found, strict=True):
        np.testing.assert_allclose(predicted, run.channels["speed_rpm"], atol=1e-9)
    # The motor that stands at the side towards which it turns moves the wheel first.
    starts = [int(np.argmax(np.abs(one) > 1.0)) for one in found]
    assert starts == sorted(starts, reverse=True)
    assert starts[-1] < starts[0]


def test_a_study_starts_each_situation_where_it_does_and_sees_it_through_its_sensors() -> None:
    slow = LOOSE.with_effect("sensor_lowpass", time_constant_s=0.05)
    runs = tuple(run_from(place, str(place), slow) for place in (-1.0, 0.5))
    runs = (runs[0], Run(**{**vars(runs[1]), "time_s": TIME + 0.0001}))
    observations = observe(Dataset("made", runs, ()))
    found = Simulator(observations).predictions(slow)
    assert len(found) == len(observations.blocks) == 2
    assert np.max(np.abs(found[0] - observations.blocks[0].value)) < 1e-9
    # Its stamps are a little later than its samples, but the middle of the gap is farther off.
    off = found[1] - observations.blocks[1].value
    middle = Simulator(observations).predictions(slow, starts=MIDDLE)[1] - observations.blocks[1].value
    assert np.sum(off**2) < 0.1 * np.sum(middle**2)


def test_from_the_middle_of_the_gap_a_prediction_does_not_depend_on_what_was_measured() -> None:
    both = [
        Simulator(observe(Dataset("made", (run_from(place),), ()))).predictions(LOOSE, starts=MIDDLE)[0]
        for place in (-1.0, 1.0)
    ]
    np.testing.assert_array_equal(*both)
    np.testing.assert_allclose(both[0], replay_bench(LOOSE, TIME, COMMAND), atol=1e-9)


@given(
    gap_deg=st.floats(2.0, 60.0),
    form=st.sampled_from(["coast", "rest"]),
    levels=st.lists(st.sampled_from([-90.0, -20.0, 0.0, 5.0, 60.0]), min_size=3, max_size=3),
    gap_share=st.floats(-1.0, 1.0),
    sticks=st.booleans(),
)
@settings(max_examples=30)
def test_ends_that_are_simulated_until_they_meet_are_found_as_in_whole_runs(
    gap_deg: float, form: str, levels: list[float], gap_share: float, sticks: bool
) -> None:
    more = {"slowing_rpm_s": 200.0} if form == "rest" else {}
    model = paper_model().with_effect("backlash", form, gap_deg=gap_deg, **more)
    if sticks:
        model = model.with_effect("stiction", breakaway_n_m=1.5, stribeck_rpm=10.0)
    time_s = np.arange(0.0, 9.0, 0.02)
    command = np.repeat([0.0, *levels], [50, 150, 150, 100])
    speed = replay_bench(model, time_s, command, gap_share=gap_share)
    run = Run("a.csv", "a", "fit", time_s, BenchCommand(command), {"speed_rpm": speed})
    wheel, sensors = FreeWheel.of(model), sensors_of(model)
    asked, seen = [BenchRun(time_s, command, 9.0)], [SeenSpeed.of([run])]
    found = motions_from_gap(wheel, asked, seen, sensors)
    with pytest.MonkeyPatch.context() as whole:
        whole.setattr(gap_start, "_meeting_s", lambda _: None)
        expected = motions_from_gap(wheel, asked, seen, sensors)
    assert found.places == expected.places
    np.testing.assert_array_equal(
        found.motions[0].channels["speed_rpm"], expected.motions[0].channels["speed_rpm"]
    )


def test_a_run_without_samples_starts_in_the_middle() -> None:
    run = run_from(1.0)
    without = Run(**{**vars(run), "channels": {"speed_rpm": np.full(TIME.size, np.nan)}})
    expected = replay_bench(LOOSE, TIME, COMMAND)
    np.testing.assert_allclose(predict(LOOSE, without)["speed_rpm"], expected, atol=1e-12)


@pytest.mark.parametrize("form", ["coast", "rest"])
def test_the_wheel_is_reached_the_sooner_the_nearer_the_motor_stands(form: str) -> None:
    more = {"slowing_rpm_s": 300.0} if form == "rest" else {}
    model = paper_model().with_effect("backlash", form, gap_deg=20.0, **more)
    speeds = [replay_bench(model, TIME, COMMAND, gap_share=place) for place in np.linspace(-1.0, 1.0, 9)]
    starts = [int(np.argmax(np.abs(one) > 1.0)) for one in speeds]
    assert starts == sorted(starts, reverse=True)
    assert starts[-1] < starts[0]


def test_an_elastic_filling_starts_in_its_middle() -> None:
    model = paper_model().with_effect(
        "backlash", "spring", gap_deg=20.0, swing_hz=4.0, damping=0.1, friction_deg=0.0
    )
    speeds = [replay_bench(model, TIME, COMMAND, gap_share=place) for place in (-1.0, 1.0)]
    np.testing.assert_array_equal(*speeds)
