"""Delays of single changes of a command, as latent values."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from mecanum_env.model import Model, paper_model
from mecanum_env.units import FloatArray
from sysid.compare.links import LinkClock, LinkDelays, link_delays
from sysid.logs import BenchCommand, Dataset, Run

MakeLogs = Callable[[FloatArray], Dataset]
MakeDelays = Callable[..., FloatArray]


@pytest.fixture
def found(model: Model, at_once: LinkClock, delayed: MakeLogs) -> Callable[[FloatArray], LinkDelays]:
    """Return a function from true delays [s], (n, 2), to those that are found."""
    return lambda truth: link_delays(model, delayed(truth).runs, at_once)


@pytest.mark.parametrize(
    "model",
    [paper_model(), paper_model().with_effect("acceleration_limit", limit_rpm_s=80.0)],
    ids=["law", "a limit that stretches large steps"],
)
def test_the_delay_of_each_change_is_found(found, spread_delays: MakeDelays) -> None:
    truth = spread_delays(0)
    delays = found(truth)
    assert delays.differ
    np.testing.assert_allclose(delays.delay_s, truth.ravel(), atol=0.02)
    assert delays.spread_s == pytest.approx(float(np.std(truth)), rel=0.4)
    assert delays.mean_s == pytest.approx(0.12, abs=0.02)


@pytest.mark.parametrize(
    "model",
    [
        paper_model(),
        paper_model().with_effect("sensor_lowpass", time_constant_s=0.01),
        paper_model().with_effect("sensor_latency", delay_s=0.01).with_effect("sensor_scale", wheel=1.1),
    ],
    ids=["law", "a slow sensor", "a late sensor with a scale"],
)
def test_delays_are_found_to_a_part_of_the_laws_tick(
    model: Model, at_once: LinkClock, each_late: MakeLogs
) -> None:
    """The law takes a command that acts within a tick by its mean over the tick; sensors are not the link."""
    truth = at_once.tick_s * np.random.default_rng(3).uniform(2.0, 5.0, 12)
    delays = link_delays(model, each_late(truth).runs, at_once)
    np.testing.assert_allclose(delays.delay_s, np.repeat(truth, 2), atol=0.0015)
    assert delays.mean_s == pytest.approx(float(np.mean(truth)), abs=0.001)


def test_a_common_delay_is_no_spread(found) -> None:
    assert not found(np.full((10, 2), 0.12)).differ


def test_delays_up_to_half_a_second_are_found(found, spread_delays: MakeDelays) -> None:
    truth = spread_delays(2, spread_s=0.02, mean_s=0.42)
    np.testing.assert_allclose(found(truth).delay_s, truth.ravel(), atol=0.02)


def test_changes_that_go_with_their_direction_are_no_jitter(found) -> None:
    assert not found(np.column_stack([np.full(10, 0.14), np.full(10, 0.09)])).differ


def test_a_change_that_never_acts_is_lost(found, spread_delays: MakeDelays) -> None:
    truth = spread_delays(3)
    truth[4] = 100.0
    delays = found(truth)
    assert delays.lost[8]
    assert delays.loss == pytest.approx(0.05, abs=0.051)


def test_the_clock_of_arrivals_spans_the_common_delay() -> None:
    clock = LinkClock(1.0 / 60.0, None)
    periods = [clock.period_s(delay_s) for delay_s in (0.0, 0.2, 0.4)]
    assert periods == sorted(periods)
    np.testing.assert_allclose(clock.tick_s / np.array(periods), np.rint(clock.tick_s / np.array(periods)))
    assert LinkClock(1.0 / 60.0, None, 0.4).period_s() == periods[-1]


def test_logs_in_which_no_command_changes_have_no_delays(model: Model, at_once: LinkClock) -> None:
    time = np.arange(0.0, 3.0, 0.03)
    speed = 0.5 * np.random.default_rng(0).standard_normal(time.size)
    still = Run("still", "still", "fit", time, BenchCommand(np.zeros(time.size)), {"speed_rpm": speed})
    delays = link_delays(model, [still], at_once)
    assert (len(delays.changes), delays.loss, delays.differ) == (0, 0.0, False)
