"""Which runs of other logs were sent the commands of a run."""

from __future__ import annotations

import numpy as np

from sysid.compare.model_error.same_commands import with_same_commands
from sysid.logs import BenchCommand, Run

STAMPS = np.arange(0.0, 3.0, 0.02)


def run(levels: np.ndarray, name: str = "run.csv", stamps: np.ndarray = STAMPS) -> Run:
    """Return a run of a wheel on the bench that was sent the levels (n,) [rpm], one at each stamp."""
    return Run(name, name, "fit", stamps, BenchCommand(levels), {"speed_rpm": 0.9 * levels})


def led_by_hand(phase_s: float) -> np.ndarray:
    """Return commands of a joystick that is read every 0.1 s, beginning at a phase."""
    read = np.floor((STAMPS - phase_s) / 0.1) * 0.1 + phase_s
    return np.asarray(np.round(70.0 * np.sin(2.0 * np.maximum(read, 0.0))))


def steps(first: float, second: float) -> np.ndarray:
    return np.where(STAMPS < 0.5, 0.0, np.where(STAMPS < 1.5, first, second))


def test_steps_to_the_same_levels_are_the_same_and_to_others_not() -> None:
    one, again, other = run(steps(60.0, -40.0)), run(steps(60.0, -40.0), "a"), run(steps(30.0, 80.0), "b")
    assert with_same_commands(one, (again, other), 0.1) == {again: 0.0}


def test_a_joystick_that_is_read_at_other_times_leads_alike() -> None:
    one, again = run(led_by_hand(0.0)), run(led_by_hand(0.03), "a")
    assert not np.array_equal(led_by_hand(0.0), led_by_hand(0.03))
    assert with_same_commands(one, (again,), 0.02) == {again: 0.0}


def test_a_run_that_ends_earlier_is_no_partner() -> None:
    short = run(led_by_hand(0.0)[:100], "short", STAMPS[:100])
    assert with_same_commands(run(led_by_hand(0.0)), (short,), 0.02) == {}
