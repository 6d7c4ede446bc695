"""The link to a drive: delays that jitter, commands that are lost, and the hash behind both."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mecanum_env.errors import InputError
from mecanum_env.model import paper_model
from mecanum_env.simulator import BodyCommands, drive
from mecanum_env.wheel_drive.link import SPREAD, Link, _mixed

PLAIN = Link(period_s=0.1, delay_s=0.12, jitter_s=0.03, loss=0.0, seed=7)
LINKS = st.builds(
    Link,
    period_s=st.sampled_from([0.1, 0.02]),
    delay_s=st.floats(0.0, 0.2),
    jitter_s=st.floats(0.001, 0.1),
    loss=st.just(0.0) | st.floats(0.0, 1.0),
    seed=st.integers(0, 2**53),
)


def ever_new(count):
    return np.arange(count + 1.0)


def test_the_hash_is_splitmix64():
    """The first three numbers from seed 0 that its authors' program prints."""
    step = np.uint64(0x9E3779B97F4A7C15)
    found = _mixed(np.arange(1, 4, dtype=np.uint64) * step)
    assert [int(one) for one in found] == [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]


def test_delays_have_the_mean_and_the_spread_that_are_asked_for():
    delays = PLAIN.arrivals(0, ever_new(20_000), 0.0)[1:] - 0.1 * np.arange(20_000)
    assert delays.mean() == pytest.approx(0.12, abs=0.001)
    assert delays.std() == pytest.approx(0.03, abs=0.001)
    assert np.abs(delays - 0.12).max() <= SPREAD * 0.03 + 1e-9
    # One delay says nothing of the next.
    assert abs(np.corrcoef(delays[1:], delays[:-1])[0, 1]) < 0.03


@given(link=LINKS, seed=st.integers(0, 2**32 - 1))
def test_commands_arrive_in_order_and_not_before_they_are_sent(link, seed):
    rng = np.random.default_rng(seed)
    sent = np.repeat(rng.uniform(-100.0, 100.0, 40), rng.integers(0, 4, 40))
    arrivals = link.arrivals(0, sent, 0.0)
    assert np.all(np.diff(arrivals) >= 0.0)
    changes = np.flatnonzero(np.diff(sent))
    assert np.all(arrivals[changes + 1] >= changes * link.period_s)
    same = np.flatnonzero(np.diff(sent) == 0.0)
    np.testing.assert_array_equal(arrivals[same + 1], arrivals[same])


@given(link=LINKS, cut=st.integers(0, 30))
def test_a_run_in_two_parts_is_the_whole_run(link, cut):
    sent = ever_new(30)
    whole, first = link.arrivals(0, sent, 0.0), link.arrivals(0, sent[: cut + 1], 0.0)
    np.testing.assert_array_equal(link.arrivals(cut, sent[cut:], first[-1]), whole[cut:])


def test_the_share_of_commands_is_lost_and_the_one_before_goes_on():
    kept = replace(PLAIN, loss=0.2).kept(0, 20_000)
    assert np.mean(kept != np.arange(20_001)) == pytest.approx(0.2, abs=0.01)
    assert np.all(kept <= np.arange(20_001))
    assert np.all(np.diff(kept) >= 0)
    np.testing.assert_array_equal(replace(PLAIN, loss=1.0).kept(0, 5), 0)
    np.testing.assert_array_equal(PLAIN.kept(0, 5), np.arange(6))


def test_seeds_and_losses_are_independent():
    one, other = (replace(PLAIN, seed=seed).arrivals(0, ever_new(5000), 0.0) for seed in (1, 2))
    assert abs(np.corrcoef(one - 0.1 * ever_new(5000), other - 0.1 * ever_new(5000))[0, 1]) < 0.05
    lost = replace(PLAIN, loss=0.5).kept(0, 5000)[1:] != np.arange(1, 5001)
    delays = PLAIN.arrivals(0, ever_new(5000), 0.0)[1:] - 0.1 * np.arange(5000)
    assert delays[lost].mean() == pytest.approx(delays[~lost].mean(), abs=0.003)


def test_limits_on_the_whole_robot_come_behind_the_same_link(paper):
    """They apply the link themselves; beyond reach, they leave the motion as the drives make it."""
    late = paper.with_effect("command_latency", "jitter", delay_s=0.05, jitter_s=0.1).with_effect(
        "command_loss", share=0.3
    )
    rows = [(0.3 * k, 60.0 - 15.0 * k, 30.0 * k, 4.0 * k) for k in range(8)]
    plain, limited, in_time = (
        drive(model, BodyCommands.from_rows(rows), 2.5, plant="planar").wheels_rpm
        for model in (late, late.with_effect("body_speed_limit", v_rpm=500.0), paper)
    )
    np.testing.assert_allclose(limited, plain, atol=1e-6)
    assert np.abs(plain - in_time).max() > 10.0


@pytest.mark.parametrize(
    ("name", "value"), [("jitter_s", -0.1), ("jitter_s", 7.0), ("loss", 1.1), ("link_seed", -1)]
)
def test_impossible_links_are_refused(name, value):
    with pytest.raises(InputError, match=name):
        replace(paper_model().wheel.drive_parameters(), **{name: value})
