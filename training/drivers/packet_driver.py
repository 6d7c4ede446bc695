"""The driver of robots that speak this project's packets, over UDP or a serial line."""

from __future__ import annotations

import secrets
from typing import Final

from training.drivers.interface import Clock, DriveCommand, Reading
from training.drivers.packets import NO_ECHO, Begin, Body, Order, Packet, Report, Stop, decode, encode
from training.drivers.transport import Transport

_AGAIN_S: Final = 0.05
"""Time after which a robot that has not answered is told again that a fight begins [s]."""
_STOPS: Final = 3
"""How often a stop is sent, since one packet may be lost."""
_REMEMBERED: Final = 64
"""Commands whose echo is waited for."""


class PacketDriver:
    """A robot at the other end of a transport.

    It compares the clocks of controller and robot by the fastest round trip of the fight (D. L. Mills, RFC
    5905): the way there and the way back are taken to be equally long.
    """

    def __init__(self, transport: Transport, clock: Clock) -> None:
        self._transport, self._clock = transport, clock
        self._session = secrets.randbits(32)
        self._number = 0
        self._forget(0)

    def begin(self, fight: int) -> None:
        """Tell the robot that a fight, by its number, begins, as soon as readings are waited for."""
        self._forget(fight)

    def read(self, timeout_s: float) -> Reading | None:
        """Return the next reading of the fight, waiting at most `timeout_s` [s]; None: there was none.

        Raises:
            RobotSilentError: the connection is gone for good.
        """
        until = self._clock.now() + timeout_s
        while True:
            now = self._clock.now()
            if not self._answered and now >= self._again_s:
                self._tell(Begin())
                self._again_s = now + _AGAIN_S
            wait = until - now if self._answered else min(until, self._again_s) - now
            data = self._transport.receive(self._clock.real(max(wait, 0.0)))
            packet = None if data is None else decode(data)
            # Until the robot has heard that a fight begins, it still reports the one before.
            if (
                packet is not None
                and (packet.session, packet.fight) == (self._session, self._fight)
                and isinstance(packet.body, Report)
            ):
                return self._reading(packet.body)
            if self._clock.now() >= until:
                return None

    def send(self, tick: int, command: DriveCommand) -> float:
        """Send the command of a tick; return when, by the robot's clock [s]."""
        self._number = (self._number + 1) % NO_ECHO
        now = self._clock.now()
        self._tell(Order(self._number, tick, command))
        self._sent[self._number] = now
        if len(self._sent) > _REMEMBERED:
            del self._sent[next(iter(self._sent))]
        return now - self._offset_s

    def stop(self) -> None:
        """Tell the robot to stand still."""
        for _ in range(_STOPS):
            self._tell(Stop())

    def close(self) -> None:
        """Stop the robot and free the connection."""
        self.stop()
        self._transport.close()

    def _forget(self, fight: int) -> None:
        self._fight, self._answered = fight, False
        self._again_s = float("-inf")  # when to tell again that the fight begins
        self._sent: dict[int, float] = {}
        self._fastest_s = float("inf")
        self._offset_s = 0.0  # this clock minus the robot's

    def _tell(self, body: Body) -> None:
        self._transport.send(encode(Packet(self._session, self._fight, body)))

    def _reading(self, report: Report) -> Reading:
        now = self._clock.now()
        if not self._answered:
            self._offset_s = now - report.sent_s  # until a command has been echoed
        self._answered = True
        if (sent := self._sent.get(report.echo)) is not None:
            round_trip_s = now - sent - report.echo_age_s
            if round_trip_s < self._fastest_s:
                self._fastest_s = round_trip_s
                self._offset_s = now - 0.5 * round_trip_s - report.sent_s
        return Reading(report.tick, report.outcome, report.observation, report.samples)
