"""Bench logs with each change of command where it acted, and models on both sides of that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.links import JITTER, LOSS, AlignedLogs, LinkClock, link_delays
from sysid.compare.measured import observe
from sysid.compare.predicted import Simulator
from sysid.logs import Dataset

from .conftest import LATE_NOISE_RPM

MakeLogs = Callable[[FloatArray], Dataset]
MakeDelays = Callable[..., FloatArray]


def error_rpm(logged: Dataset, model: Model) -> float:
    observations = observe(logged)
    predicted = Simulator(observations).predictions(model)
    parts = [block.value - p for block, p in zip(observations.blocks, predicted, strict=True)]
    return float(np.sqrt(np.mean(np.concatenate(parts) ** 2)))


@pytest.fixture
def aligned(model: Model, at_once: LinkClock, delayed: MakeLogs, spread_delays: MakeDelays) -> AlignedLogs:
    """Return logs through a link that jitters, aligned."""
    data = delayed(spread_delays(4))
    return AlignedLogs.of(data, model, at_once, link_delays(model, data.runs, at_once))


def test_aligned_logs_are_predicted_with_one_delay(
    aligned: AlignedLogs, model: Model, delayed: MakeLogs, spread_delays: MakeDelays
) -> None:
    late = model.with_effect("command_latency", delay_s=aligned.delays.mean_s)
    same = AlignedLogs.of(delayed(spread_delays(4)), late, aligned.clock, aligned.delays)
    assert error_rpm(same.dataset, same.model) < 0.5 * error_rpm(delayed(spread_delays(4)), late)


@pytest.mark.parametrize("own_s", [0.0, 0.003, 0.012], ids=["no delay", "under a tick", "over a tick"])
def test_changes_are_aligned_to_a_part_of_the_laws_tick(
    model: Model, each_late: MakeLogs, own_s: float
) -> None:
    given = model.with_effect("command_latency", delay_s=own_s)
    logs = each_late(np.random.default_rng(6).uniform(0.015, 0.06, 12))
    clock = LinkClock(model.wheel.law.sample_period_s, None, own_s)
    delays = replace(link_delays(given, logs.runs, clock), mean_s=own_s)
    aligned = AlignedLogs.of(logs, given, clock, delays)
    assert error_rpm(aligned.dataset, aligned.model) < 1.3 * LATE_NOISE_RPM


def test_a_stated_jitter_makes_no_change_far_later_than_the_others(
    model: Model, delayed: MakeLogs, spread_delays: MakeDelays
) -> None:
    delays = spread_delays(4, spread_s=0.01)
    delays[3, 1] += 0.25
    stated = model.with_effect("command_latency", "jitter", delay_s=0.12, jitter_s=0.01)
    late = AlignedLogs.stated(delayed(delays), stated)
    assert late is not None
    assert late.delays.delay_s[7] == pytest.approx(late.delays.mean_s + 0.04)


def test_logs_are_aligned_where_the_model_says_that_their_link_jitters_or_loses(
    model: Model, delayed: MakeLogs, spread_delays: MakeDelays
) -> None:
    data = delayed(spread_delays(4)[:3])
    assert AlignedLogs.stated(data, model) is None
    assert AlignedLogs.stated(data, model.with_effect("command_latency", delay_s=0.1)) is None
    found = AlignedLogs.stated(data, model.with_effect(LOSS, share=0.1))
    assert found is not None
    assert LOSS not in found.model.effects


def test_other_logs_of_the_link_are_aligned_on_the_same_clock(
    aligned: AlignedLogs, delayed: MakeLogs, spread_delays: MakeDelays
) -> None:
    (run,) = aligned.beside(delayed(spread_delays(5)[:1])).runs
    changes = run.time_s[np.flatnonzero(np.diff(run.command.wheels_rpm[:, 0])) + 1]
    np.testing.assert_allclose(changes / aligned.period_s, np.rint(changes / aligned.period_s), atol=1e-6)


def test_a_model_goes_back_through_the_link_of_the_given_one(
    aligned: AlignedLogs, model: Model, delayed: MakeLogs, spread_delays: MakeDelays
) -> None:
    given = model.with_effect(JITTER, delay_s=0.12, jitter_s=0.03).with_effect(LOSS, share=0.1)
    logs = AlignedLogs.of(delayed(spread_delays(4)), given, LinkClock.of(given), aligned.delays)
    assert logs.model.effects == {"command_latency": {"delay_s": 0.12}}
    assert logs.as_stated(logs.model) == given


def test_no_jitter_is_longer_than_a_drive_remembers(aligned: AlignedLogs) -> None:
    described = aligned.through_link(aligned.model, jitter_s=10.0, delay_s=0.1)
    assert 0.1 < described.effects[JITTER]["jitter_s"] < 10.0
