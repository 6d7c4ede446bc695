"""The driver of packets begins fights for certain, and hears its own robot alone."""

import numpy as np
import pytest

from training.drivers import packet_driver
from training.drivers.packet_driver import PacketDriver
from training.drivers.packets import Begin, Order, Packet, Report, Stop, decode, encode


class FakeTime:
    """A clock that only waiting moves, and a line on which a robot answers."""

    def __init__(self):
        self.time_s = 100.0
        self.sent, self.coming = [], []

    def now(self):
        return self.time_s

    def send(self, data):
        self.sent.append((self.time_s, decode(data)))

    def receive(self, timeout_s):
        if self.coming and self.coming[0][0] <= self.time_s + timeout_s:
            self.time_s, packet = self.coming.pop(0)
            return encode(packet)
        self.time_s += timeout_s
        return None

    def close(self):
        self.closed = True

    def bodies(self, kind):
        return [packet for _, packet in self.sent if isinstance(packet.body, kind)]


@pytest.fixture
def world():
    return FakeTime()


@pytest.fixture
def driver(world, monkeypatch):
    monkeypatch.setattr(packet_driver.secrets, "randbits", lambda _: 77)
    return PacketDriver(world, world.now)


def report(tick=0):
    return Report(tick, tick - 1, "fighting", np.zeros(20), (), 0.0)


def test_a_begin_that_is_lost_is_told_again_even_while_the_robot_reports_the_fight_before(driver, world):
    driver.begin(3)
    world.coming = [(100.0 + 0.025 * i, Packet(77, 2, report())) for i in range(1, 20)]
    assert driver.read(0.5) is None
    assert len(world.bodies(Begin)) >= 5
    assert {packet.fight for packet in world.bodies(Begin)} == {3}


def test_reports_for_another_session_are_not_heard(driver, world):
    driver.begin(0)
    world.coming = [(100.1, Packet(78, 0, report(tick=9))), (100.2, Packet(77, 0, report(tick=4)))]
    assert driver.read(0.5).tick == 4


def test_a_command_names_its_tick_and_fight(driver, world):
    driver.begin(5)
    driver.send(8, (135, -90, 20))
    (packet,) = world.bodies(Order)
    assert (packet.session, packet.fight, packet.body.tick, packet.body.command) == (77, 5, 8, (135, -90, 20))


def test_closing_stops_the_robot_more_than_once(driver, world):
    driver.close()
    assert len(world.bodies(Stop)) == 3
    assert world.closed
