"""A bad link is as bad as it says."""

import numpy as np
import pytest

from mecanum_env.errors import InputError
from training.run.link import Link, LinkQuality


def arrivals(quality, count=2000):
    """Return the time that each packet took which arrived; they are sent far apart."""
    link, took = Link(quality, np.random.default_rng(1)), []
    for number in range(count):
        link.put(b"packet", 10.0 * number)
        if link.next_s < float("inf"):
            took.append(link.next_s - 10.0 * number)
            assert link.due(link.next_s) == [b"packet"]
    return np.array(took)


def test_a_perfect_link_delivers_at_once():
    assert set(arrivals(LinkQuality(), 10)) == {0.0}


def test_latency_and_jitter_add_up():
    took = arrivals(LinkQuality(0.01, 0.002))
    assert took.min() >= 0.01
    assert took.mean() == pytest.approx(0.012, abs=2e-4)


def test_packets_are_lost_as_often_as_it_says():
    assert len(arrivals(LinkQuality(loss=0.2))) == pytest.approx(1600, abs=60)


def test_a_packet_does_not_arrive_before_its_time():
    link = Link(LinkQuality(0.01), np.random.default_rng(0))
    link.put(b"packet", 5.0)
    assert link.due(5.009) == []


def test_a_link_that_loses_everything_is_refused():
    with pytest.raises(InputError, match="from 0 to below 1"):
        LinkQuality(loss=1.0)
