"""Lines carry packets; one that is gone says so."""

import os

import pytest

from mecanum_env.errors import InputError
from training.drivers import RobotSilentError, open_driver
from training.drivers.transport import Serial, Udp

BAUD = 115200


@pytest.fixture
def line():
    """Return both ends of a serial line: a pseudo-terminal."""
    one, other = os.openpty()
    ends = Serial(one, BAUD), Serial(os.ttyname(other), BAUD)
    os.close(other)
    yield ends
    for end in ends:
        try:
            end.close()
        except OSError:
            continue


def test_a_serial_line_carries_packets_both_ways_in_order(line):
    robot, controller = line
    for packet in (b"\0first\0", b"second"):
        controller.send(packet)
    robot.send(b"back\x03\x11\r\n")
    assert [robot.receive(1.0), robot.receive(1.0)] == [b"\0first\0", b"second"]
    assert controller.receive(1.0) == b"back\x03\x11\r\n"


def test_noise_on_a_serial_line_costs_no_later_packet(line):
    robot, controller = line
    os.write(controller._line, b"\x09noise")
    controller.send(b"packet")
    assert robot.receive(1.0) == b"packet"


def test_a_serial_line_that_is_gone_says_so(line):
    robot, controller = line
    robot.close()
    with pytest.raises(RobotSilentError, match="the serial line is gone"):
        controller.receive(1.0)


def test_a_silent_line_returns_nothing(line):
    assert line[0].receive(0.0) is None


def test_udp_carries_packets_and_a_robot_answers_who_spoke_last():
    robot = Udp("127.0.0.1", 0, serves=True)
    controller = Udp("127.0.0.1", robot.port)
    robot.send(b"nobody hears this")
    controller.send(b"one")
    assert robot.receive(1.0) == b"one"
    robot.send(b"two")
    assert controller.receive(1.0) == b"two"
    robot.close()
    controller.send(b"lost, without an error")
    controller.close()


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("udp", "must be udp:HOST"),
        ("udp:127.0.0.1:port", "'port' must be a whole number"),
        ("serial:/dev/there-is-none", "name a serial device"),
        ("serial:/dev/null:12345", "baud rate 12345"),
        ("no_such_module:Robot", "MODULE:CLASS"),
    ],
)
def test_a_driver_that_is_not_there_is_refused_with_what_would_be_right(name, said):
    with pytest.raises(InputError, match=said):
        open_driver(name)


def test_a_driver_of_ones_own_is_found_by_module_and_class(tmp_path, monkeypatch):
    (tmp_path / "own_robot.py").write_text("class Robot:\n    own = True\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    assert open_driver("own_robot:Robot").own
