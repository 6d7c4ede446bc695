"""The driver of robots that speak this project's packets, over UDP or a serial line."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import Final

from training.drivers.interface import DriveCommand, Reading
from training.drivers.packets import Begin, Body, Order, Packet, Report, Stop, decode, encode
from training.drivers.transport import Transport

_AGAIN_S: Final = 0.05
"""Time after which a robot that has not answered is told again that a fight begins [s]."""
_STOPS: Final = 3
"""How often a stop is sent, since one packet may be lost."""


class PacketDriver:
    """A robot at the other end of a transport; `now` tells the time [s]."""

    def __init__(self, transport: Transport, now: Callable[[], float] = time.monotonic) -> None:
        self._transport, self._now = transport, now
        self._session = secrets.randbits(32)
        self._fight, self._answered = 0, False
        self._again_s = float("-inf")  # when to tell again that the fight begins

    def begin(self, fight: int) -> None:
        """Tell the robot that a fight, by its number, begins, as soon as readings are waited for."""
        self._fight, self._answered, self._again_s = fight, False, float("-inf")

    def read(self, timeout_s: float) -> Reading | None:
        """Return the next reading of the fight, waiting at most `timeout_s` [s]; None: there was none.

        Raises:
            RobotSilentError: the connection is gone for good.
        """
        until = self._now() + timeout_s
        while True:
            now = self._now()
            if not self._answered and now >= self._again_s:
                self._tell(Begin())
                self._again_s = now + _AGAIN_S
            wait = until - now if self._answered else min(until, self._again_s) - now
            data = self._transport.receive(max(wait, 0.0))
            packet = None if data is None else decode(data)
            # Until the robot has heard that a fight begins, it still reports the one before.
            if (
                packet is not None
                and (packet.session, packet.fight) == (self._session, self._fight)
                and isinstance(packet.body, Report)
            ):
                self._answered = True
                said = packet.body
                return Reading(said.tick, said.held, said.outcome, said.observation, said.samples)
            if self._now() >= until:
                return None

    def send(self, tick: int, command: DriveCommand) -> None:
        """Send the command of a tick."""
        self._tell(Order(tick, command))

    def stop(self) -> None:
        """Tell the robot to stand still."""
        for _ in range(_STOPS):
            self._tell(Stop())

    def close(self) -> None:
        """Stop the robot and free the connection."""
        self.stop()
        self._transport.close()

    def _tell(self, body: Body) -> None:
        self._transport.send(encode(Packet(self._session, self._fight, body)))
