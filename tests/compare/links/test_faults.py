"""What the delays of single changes say of a link: nothing, that it jitters, or that it loses commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mecanum_env.units import FloatArray
from sysid.compare.links import LinkDelays, known_state, link_fault
from sysid.compare.links.changes import GRID_S, Change

SURE_S = 0.004
KNOWN = known_state(None, 0.01)


def seen(
    delay_s: FloatArray, hold_s: float = 1.0, to_rpm: FloatArray | None = None, lost: Sequence[int] = ()
) -> LinkDelays:
    """Return changes, `hold_s` apart, of which the logs show each delay to within 4 ms.

    They go to 10 rpm or `to_rpm`; those that are `lost` never act.
    """
    to = np.full(delay_s.size, 10.0) if to_rpm is None else to_rpm
    likelihood = -0.5 * ((GRID_S - delay_s[:, None]) / SURE_S) ** 2
    changes = tuple(
        Change(0, hold_s * i, before, after)
        for i, (before, after) in enumerate(pairwise([0.0, *to.tolist()]))
    )
    zero, none = np.zeros(delay_s.size), np.zeros(delay_s.size, bool)
    never = np.full(delay_s.size, -200.0)
    likelihood[list(lost)] -= 200.0
    never[list(lost)] = 0.0
    return LinkDelays(changes, zero, none, (), 0.05, 0.0, 0.0, likelihood, never, likelihood)


def measured(seed: int, true_s: FloatArray) -> LinkDelays:
    """Return changes whose delays were seen with an error."""
    return seen(true_s + SURE_S * np.random.default_rng(seed).standard_normal(true_s.size))


@pytest.mark.parametrize("seed", range(4))
def test_a_steady_link_has_no_fault(seed: int) -> None:
    found = measured(seed, np.full(60, 0.05))
    assert link_fault(found, KNOWN, 0.9, np.random.default_rng(0)) is None


@pytest.mark.parametrize("seed", range(4))
def test_a_jitter_is_found_with_its_size(seed: int) -> None:
    true = 0.1 + 0.03 * np.random.default_rng(seed + 100).standard_normal(60)
    fault = link_fault(measured(seed, true), KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert fault.kind == "jitter"
    assert fault.size[1] < 0.03 < fault.size[2]
    assert fault.delay_s[1] < 0.1 < fault.delay_s[2]
    assert fault.frequency > 0.9


@pytest.mark.parametrize("seed", range(4))
def test_lost_commands_are_found_with_their_share(seed: int) -> None:
    rng = np.random.default_rng(seed + 200)
    true = 0.05 + 0.1 * (rng.geometric(0.9, 100) - 1)
    fault = link_fault(measured(seed, true), KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert fault.kind == "loss"
    assert fault.size[1] < 0.1 < fault.size[2]
    assert fault.period_s == pytest.approx(0.1, rel=0.1)


@pytest.mark.parametrize("seed", range(4))
def test_lost_commands_are_told_from_a_jitter_under_a_model_that_errs(seed: int) -> None:
    """Its delays spread by more than any link makes them, but repetitions stand apart."""
    rng = np.random.default_rng(seed + 300)
    true = 0.05 + 0.08 * (rng.geometric(0.75, 100) - 1) + 0.012 * rng.standard_normal(100)
    fault = link_fault(measured(seed, np.abs(true)), KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert (fault.kind, fault.rival) == ("loss", None)
    assert fault.size[1] < 0.25 < fault.size[2]
    assert fault.period_s == pytest.approx(0.08, rel=0.1)
    assert fault.spread_s == pytest.approx(0.012, rel=0.5)


def test_a_jitter_of_a_link_that_loses_half_of_its_commands_anyway_is_found() -> None:
    """No larger share is tried."""
    true = 0.1 + 0.04 * np.random.default_rng(0).standard_normal(60)
    lossy = replace(KNOWN, share=0.5)
    fault = link_fault(measured(0, true), lossy, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert fault.kind == "jitter"


def test_commands_that_are_sent_as_often_as_they_are_logged_may_be_late_or_lost() -> None:
    rng = np.random.default_rng(0)
    fault = link_fault(measured(0, 0.01 * (rng.geometric(0.6, 60) - 1)), KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert {fault.kind, fault.rival} == {"jitter", "loss"}


@pytest.mark.parametrize("seed", range(4))
def test_a_jitter_alone_is_no_loss(seed: int) -> None:
    true = 0.1 + 0.04 * np.random.default_rng(seed + 400).uniform(-1.7, 1.7, 100)
    fault = link_fault(measured(seed, true), KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert (fault.kind, fault.rival) == ("jitter", None)


def test_what_the_logs_of_the_fit_show_too_is_no_fault() -> None:
    jitters = [0.1 + 0.03 * np.random.default_rng(seed).standard_normal(60) for seed in (1, 2)]
    before, after = (measured(seed, true) for seed, true in enumerate(jitters))
    known = known_state(before, 0.0)
    assert known.spread_s == pytest.approx(0.03, rel=0.4)
    assert link_fault(after, known, 0.9, np.random.default_rng(0)) is None


@pytest.mark.parametrize(("lost_before", "lost_now", "more"), [(0, 1, False), (0, 8, True), (8, 10, False)])
def test_a_loss_is_more_than_before_only_if_it_is_more_than_chance(
    lost_before: int, lost_now: int, more: bool
) -> None:
    def of(count: int) -> LinkDelays:
        to = np.tile([60.0, -30.0, 90.0, 0.0, 40.0], 12)
        return seen(np.zeros(to.size), hold_s=0.05, to_rpm=to, lost=range(3, 3 + 5 * count, 5))

    known = known_state(of(lost_before), 0.01)
    assert max(likelihood for _, likelihood in known.losses) == 0.0
    without = replace(known, share=0.0)
    fault = link_fault(of(lost_now), without, 0.9, np.random.default_rng(0))
    assert fault is not None
    assert fault.kind == "loss"
    assert (fault.surplus > 5.4) is more
    alone = link_fault(of(lost_now), KNOWN, 0.9, np.random.default_rng(0))
    assert alone is not None
    assert alone.surplus == np.inf


def test_few_changes_show_nothing() -> None:
    assert link_fault(seen(np.linspace(0.0, 0.4, 5)), KNOWN, 0.9, np.random.default_rng(0)) is None


def test_changes_are_moved_by_whole_periods_where_commands_are_lost() -> None:
    true = 0.05 + 0.1 * (np.random.default_rng(3).geometric(0.8, 60) - 1)
    found = measured(3, true)
    fault = link_fault(found, KNOWN, 0.9, np.random.default_rng(0))
    assert fault is not None
    np.testing.assert_allclose(fault.delays(found).delay_s, true, atol=0.025)


def test_starts_to_small_speeds_that_are_ignored_are_no_lost_commands() -> None:
    """A wheel that sticks does so. Where other changes are lost, too, it is the link."""
    to = np.tile([8.0, 60.0, 0.0, 12.0, 90.0, 0.0], 4)
    starts = np.flatnonzero((to > 0.0) & (to < 20.0)).tolist()
    rng, on_time = np.random.default_rng(0), np.zeros(to.size)
    assert link_fault(seen(on_time, to_rpm=to, lost=starts), KNOWN, 0.9, rng) is None
    fault = link_fault(seen(on_time, to_rpm=to, lost=[0, 2, 4, 9, 13, 17]), KNOWN, 0.9, rng)
    assert fault is not None
    assert fault.kind == "loss"
