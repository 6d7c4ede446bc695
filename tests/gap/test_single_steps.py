"""Runs of one step each: a gap that is passed once, from an unknown place, is no other than a delay."""

from __future__ import annotations

import numpy as np
import pytest

from mecanum_env.errors import InputError
from mecanum_env.model import Model
from mecanum_env.simulator import replay_bench
from sysid.fit.effects.candidates import drive_candidates
from sysid.gap import GapOptions, analyse
from sysid.logs import BenchCommand, Dataset, Run, Split

SPLITS: tuple[Split, ...] = ("fit", "fit", "fit", "fit", "validation", "validation", "test", "test")
LOOSE = {"backlash", "backlash/rest"}


def steps(model: Model, *falling_rpm: float) -> Dataset:
    """Return runs of a model, each with one step from rest; a speed that falls is added to the first."""
    rng, runs = np.random.default_rng(0), []
    time_s = 0.01 * np.arange(151)
    for number, (split, rpm) in enumerate(zip(SPLITS, (20, -35, 50, -80, 65, -95, 110, -25), strict=True)):
        command = np.where(time_s >= 0.1, float(rpm), 0.0)
        if falling_rpm and number == 0:
            command[100:] = falling_rpm[0]
        speed = replay_bench(model, time_s, command) + 0.3 * rng.standard_normal(time_s.size)
        name = f"run_{number}"
        runs.append(Run(f"{name}.csv", name, split, time_s, BenchCommand(command), {"speed_rpm": speed}))
    return Dataset("steps", tuple(runs), ())


@pytest.mark.parametrize(
    ("falling_rpm", "falls"), [((), False), ((10.0,), True), ((-20.0,), True), ((30.0,), False)]
)
def test_a_command_falls_where_it_comes_nearer_to_rest_or_reverses(
    base: Model, falling_rpm: tuple[float, ...], falls: bool
) -> None:
    data = steps(base, *falling_rpm)
    assert data.command_falls is falls
    assert (drive_candidates(data.columns, command_falls=data.command_falls).keys() >= LOOSE) is falls


def test_a_study_of_single_steps_says_that_they_show_no_gap(base: Model) -> None:
    report = analyse(steps(base.with_effect("speed_gain", gain=0.9)), base, GapOptions())
    reasons = {one.name: one.reason for one in report.untestable}
    assert reasons.keys() >= LOOSE
    assert all("drive reversals" in reasons[name] for name in LOOSE)
    assert ("speed_gain",) in report.candidates


def test_a_gap_cannot_be_asked_of_single_steps(base: Model) -> None:
    with pytest.raises(
        InputError, match="only backlash/rest: has no effect in bench logs in which no command falls"
    ):
        analyse(steps(base), base, GapOptions(only=("backlash/rest",)))
