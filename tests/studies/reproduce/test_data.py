"""The data sets are those that the paper describes."""

from collections import Counter

import numpy as np
import pytest

from sysid.studies.reproduce import published
from sysid.studies.reproduce.data import NOISE_RPM, random_hold_command, record_data_sets


def test_four_speeds_three_times_to_fit_and_thirteen_five_times_to_test(data):
    assert Counter(r.name for r in data.fit) == {f"step {v} rpm": 3 for v in (10, 40, 80, 130)}
    assert Counter(r.name for r in data.test) == {f"step {v} rpm": 5 for v in range(10, 131, 10)}
    assert [r.name for r in data.beyond] == ["step 140 rpm"]
    assert {r.name for r in data.search} == {"step 60 rpm"}


@pytest.mark.parametrize("seed", range(20))
def test_a_random_trial_has_five_long_and_five_short_holds_in_5_2_s(seed):
    command = random_hold_command(np.random.default_rng(seed))
    assert len(command) == round(published.TRIAL_S / 0.1)
    assert command.min() >= 0.0
    assert command.max() <= 130.0
    # Two neighbouring holds of one speed look like one, which chance makes rare: count what can be seen.
    changes = np.flatnonzero(np.diff(command)) + 1
    holds = np.diff(np.concatenate([[0], changes, [len(command)]]))
    assert len(holds) in (9, 10)
    if len(holds) == 10:
        assert np.sum(holds * 0.1 < published.SETTLING_S["target"]) == 5


def test_repeats_differ_by_noise_alone(data):
    one, other = (data.fit[i].record for i in (3, 4))
    np.testing.assert_array_equal(one.command_rpm, other.command_rpm)
    steady = slice(60, None)
    spread = np.std(one.speed_rpm[steady] - other.speed_rpm[steady]) / np.sqrt(2.0)
    assert spread == pytest.approx(NOISE_RPM, rel=0.4)


def test_the_law_sees_the_command_on_its_own_clock(data):
    for recording in (*data.fit, *data.beyond, *data.trials):
        at = np.minimum(recording.run.sample_tick.astype(int), len(recording.run.command_rpm) - 1)
        phase = np.arange(len(recording.record.time_s)) % 10
        inside = (phase > 0) & (phase < 9)  # not at a change, where half a tick decides
        np.testing.assert_array_equal(
            recording.run.command_rpm[at][inside], recording.record.command_rpm[inside]
        )


def test_another_seed_gives_other_trials_and_other_noise(data):
    other = record_data_sets(1)
    assert not np.array_equal(data.trials[0].record.command_rpm, other.trials[0].record.command_rpm)
    assert not np.array_equal(data.fit[0].record.speed_rpm, other.fit[0].record.speed_rpm)
