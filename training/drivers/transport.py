"""How packets travel: UDP datagrams, or frames on a serial line. Both may lose packets; neither blocks."""

from __future__ import annotations

import contextlib
import os
import select
import socket
import termios
import time
import tty
from typing import Final, Protocol

from mecanum_env.errors import InputError
from training.drivers.interface import RobotSilentError

_LARGEST: Final = 2048
"""Bytes of the largest packet, or frame."""


class Transport(Protocol):
    """A line on which packets travel."""

    def send(self, packet: bytes) -> None:
        """Send a packet; it may be lost."""
        ...

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next packet, waiting at most `timeout_s` of real time [s]; None: there was none."""
        ...

    def close(self) -> None:
        """Free the line."""
        ...


class Udp:
    """Datagrams to and from one peer.

    The controller names the robot's `host` and `port`. A robot names its own port, or 0 for a free one, with
    `serves`; its peer is whoever spoke last.

    Raises:
        InputError: no such host, or the port is taken.
    """

    def __init__(self, host: str, port: int, serves: bool = False) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._peer: tuple[str, int] | None = None
        try:
            if serves:
                self._socket.bind((host, port))
            else:
                self._peer = socket.gethostbyname(host), port
        except OSError as error:
            self._socket.close()
            raise InputError(f"udp:{host}:{port}: {error.strerror}; choose another host or port") from error
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """The own port."""
        return int(self._socket.getsockname()[1])

    def send(self, packet: bytes) -> None:
        """Send a packet to the peer, if there is one; it may be lost."""
        if self._peer is not None:
            # A peer that has gone, or a full buffer, is a lost packet.
            with contextlib.suppress(OSError):
                self._socket.sendto(packet, self._peer)

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next packet, waiting at most `timeout_s` of real time [s]; None: there was none."""
        if not select.select([self._socket], [], [], max(timeout_s, 0.0))[0]:
            return None
        try:
            packet, self._peer = self._socket.recvfrom(_LARGEST)
        except OSError:
            return None
        return packet

    def close(self) -> None:
        """Free the port."""
        self._socket.close()


class Serial:
    """Frames on a serial line: consistent overhead byte stuffing (S. Cheshire and M. Baker 1999), 0 between.

    The line is that of a device's `path`, or of a file descriptor that is open already, at a baud rate.

    Raises:
        InputError: no such device, or a baud rate that the system does not know.
    """

    def __init__(self, path: str | int, baud: int) -> None:
        rate = getattr(termios, f"B{baud}", None)
        if rate is None:
            raise InputError(
                f"serial: baud rate {baud}, must be one of this system, such as 115200 or 921600"
            )
        try:
            flags = os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK
            self._line = path if isinstance(path, int) else os.open(path, flags)
            os.set_blocking(self._line, False)
            tty.setraw(self._line, termios.TCSANOW)
            attributes = termios.tcgetattr(self._line)
            attributes[4] = attributes[5] = rate
            termios.tcsetattr(self._line, termios.TCSANOW, attributes)
        except (OSError, termios.error) as error:
            raise InputError(f"serial:{path}: {error.args[-1]}; name a serial device") from error
        self._heard = bytearray()

    def send(self, packet: bytes) -> None:
        """Send a packet; it is lost if the line is full or gone."""
        with contextlib.suppress(OSError):
            os.write(self._line, b"\0" + stuffed(packet) + b"\0")

    def receive(self, timeout_s: float) -> bytes | None:
        """Return the next packet, waiting at most `timeout_s` of real time [s]; None: there was none.

        Raises:
            RobotSilentError: the line is gone, as when a plug is pulled.
        """
        until = time.monotonic() + timeout_s
        while (frame := self._frame()) is None:
            if not select.select([self._line], [], [], max(until - time.monotonic(), 0.0))[0]:
                return None
            try:
                heard = os.read(self._line, _LARGEST)
            except BlockingIOError:
                continue
            except OSError as error:
                raise RobotSilentError(f"the serial line is gone ({error.strerror})") from error
            if not heard:
                raise RobotSilentError("the serial line is gone (it was closed at the other end)")
            self._heard += heard
        return frame

    def close(self) -> None:
        """Free the line."""
        os.close(self._line)

    def _frame(self) -> bytes | None:
        """Return the next whole frame that was heard, unstuffed; what is no frame is thrown away."""
        while (end := self._heard.find(0)) >= 0:
            frame = bytes(self._heard[:end])
            del self._heard[: end + 1]
            if frame and (packet := unstuffed(frame)) is not None:
                return packet
        if len(self._heard) > 2 * _LARGEST:
            self._heard.clear()
        return None


def stuffed(packet: bytes) -> bytes:
    """Return a packet without zeros: each block of up to 254 other bytes is preceded by its length + 1."""
    out = bytearray()
    for number, block in enumerate(blocks := packet.split(b"\0")):
        while len(block) >= 254:
            out += b"\xff" + block[:254]
            block = block[254:]
            if not block and number == len(blocks) - 1:
                return bytes(out)
        out += bytes([len(block) + 1]) + block
    return bytes(out)


def unstuffed(frame: bytes) -> bytes | None:
    """Return the packet of a frame; None if the frame is torn."""
    out, place = bytearray(), 0
    while place < len(frame):
        length = frame[place]
        block = frame[place + 1 : place + length]
        if length == 0 or len(block) != length - 1:
            return None
        out += block
        place += length
        if length < 255 and place < len(frame):
            out.append(0)
    return bytes(out)
