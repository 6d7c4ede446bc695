"""A study beside the logs of a fit that never let the wheel settle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.simulator import replay_bench
from sysid.compare.measured import observe
from sysid.compare.model_error.steady_gain import unreached_share, with_other_gain
from sysid.gap.result import GapOptions
from sysid.gap.workflow import analyse
from sysid.logs import BenchCommand, Dataset, Run, Split
from tests.gap.conftest import NOISE_RPM

SLOW_S = 1.0
SHORT_S, LONG_S = 0.8, 6.0


@pytest.fixture(scope="module")
def slow(base: Model) -> Model:
    """Return a wheel of first order with a time constant of 1 s."""
    tick = base.wheel.law.sample_period_s
    pole = float(np.exp(-tick / SLOW_S))
    law = WheelLaw(A=pole, B=0.0, C=0.0, D=1.0 - pole, E=0.0, F=0.0, sample_period_s=tick)
    return replace(base, wheel=replace(base.wheel, law=law))


def logs(model: Model, hold_s: float, seed: int) -> Dataset:
    """Return runs of a step from rest and one to another level, each held for so long, two repeats each."""
    rng = np.random.default_rng(seed)
    splits: tuple[Split, ...] = ("fit", "fit", "fit", "validation", "test")
    runs = []
    for number, split in enumerate(splits):
        levels = rng.choice([-1.0, 1.0]) * rng.uniform(40.0, 120.0, 2)
        time = np.arange(0.0, 0.2 + 2.0 * hold_s, 0.02)
        command = np.rint(np.where(time < 0.2, 0.0, np.where(time < 0.2 + hold_s, *levels)))
        speed = replay_bench(model, time, command)
        for repeat in range(2):
            measured = speed + NOISE_RPM * rng.standard_normal(time.size)
            channels, name = {"speed_rpm": measured}, f"run{number}_{repeat}.csv"
            runs.append(Run(name, f"run{number}", split, time, BenchCommand(command), channels))
    return Dataset("steps", tuple(runs), (), f"seed {seed}")


def test_the_share_that_is_never_reached_is_the_rest_of_the_way(slow: Model) -> None:
    short, long = (unreached_share(slow, observe(logs(slow, hold_s, 0))) for hold_s in (SHORT_S, LONG_S))
    # Two holds in the same direction.
    assert np.exp(-2.0 * SHORT_S / SLOW_S) <= short <= np.exp(-SHORT_S / SLOW_S)
    assert long < 0.01


def test_another_gain_changes_every_speed_by_its_share(slow: Model) -> None:
    time = np.arange(0.0, 3.0, 0.02)
    command = np.full(time.size, 80.0)
    before, after = (replay_bench(model, time, command) for model in (slow, with_other_gain(slow, 0.1)))
    assert after == pytest.approx(1.1 * before)


@pytest.mark.parametrize(("hold_s", "is_known"), [(SHORT_S, False), (LONG_S, True)])
def test_a_gain_that_the_fit_could_not_show_is_no_gap(slow: Model, hold_s: float, is_known: bool) -> None:
    """The same change of the gain is told where the logs of the fit let the wheel settle."""
    weaker = slow.with_effect("speed_gain", gain=0.9)
    options = GapOptions(fitted_on=logs(slow, hold_s, 1), next_experiment=False)
    report = analyse(logs(weaker, LONG_S + 1.0, 2), slow, options)
    assert (report.verdict == "no_gap") != is_known
    assert any("before the wheel had settled" in note for note in report.notes) != is_known
    assert is_known == any("speed_gain" in names for names in report.candidates)
