"""Packets arrive as they were sent, or not at all."""

import numpy as np
import pytest

from training.drivers.interface import CHANNELS, Sample
from training.drivers.packets import Begin, Order, Packet, Report, Stop, decode, encode
from training.drivers.transport import stuffed, unstuffed

REPORT = Report(
    tick=7,
    held=6,
    outcome="fighting",
    observation=np.arange(20, dtype=float) / 8.0,
    samples=(
        Sample(0.65, tuple(np.arange(10) / 4.0), (120, -90, 3)),
        Sample(0.675, tuple(np.arange(10) / 2.0), (-135, 180, -100)),
    ),
    sent_s=0.675,
)


@pytest.mark.parametrize("body", [Begin(), Stop(), Order(4, (-135, 180, -100))])
def test_what_a_controller_says_arrives(body):
    assert decode(encode(Packet(3, 9, body))) == Packet(3, 9, body)


def test_a_report_arrives():
    arrived = decode(encode(Packet(3, 9, REPORT)))
    assert arrived is not None
    found = arrived.body
    assert (found.tick, found.held, found.outcome, found.sent_s) == (7, 6, "fighting", 0.675)
    np.testing.assert_array_equal(found.observation, REPORT.observation)
    assert [sample.time_s for sample in found.samples] == [0.65, 0.675]
    assert found.samples == REPORT.samples


def test_what_a_robot_does_not_measure_arrives_as_nan():
    nothing = Sample(0.0, (float("nan"),) * len(CHANNELS))
    report = Report(0, -1, "ready", np.zeros(20), (nothing,), 0.0)
    (sample,) = decode(encode(Packet(1, 1, report))).body.samples
    assert np.isnan(sample.values).all()


@pytest.mark.parametrize("place", range(0, 100, 7))
def test_a_changed_byte_is_no_packet(place):
    data = bytearray(encode(Packet(3, 9, REPORT)))
    data[place] ^= 0x10
    assert decode(bytes(data)) is None


@pytest.mark.parametrize("length", [0, 3, 15, 40])
def test_a_torn_packet_is_no_packet(length):
    assert decode(encode(Packet(3, 9, REPORT))[:length]) is None


@pytest.mark.parametrize("size", [0, 1, 2, 253, 254, 255, 256, 508, 509, 1000])
@pytest.mark.parametrize("most", [1, 2, 256])
def test_a_frame_has_no_zeros_and_gives_its_packet_back(size, most):
    packet = np.random.default_rng(size).integers(0, most, size).astype(np.uint8).tobytes()
    for one in (packet, packet.replace(b"\0", b"\1")):
        assert 0 not in stuffed(one)
        assert unstuffed(stuffed(one)) == one


def test_a_torn_frame_gives_nothing():
    assert unstuffed(stuffed(b"12345")[:-1]) is None
