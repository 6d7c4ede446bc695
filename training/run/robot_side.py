"""The robot's side of the packets: its clock, its watchdog and its reports, around a simulated world.

What is here is what the firmware of a real robot does; `World` stands for motors, sensors and opponent. Time
passes in quarters of a command period. A period's command is taken at its start: the newest that has come, or
none once the watchdog has tripped. The observation for a command is reported before that, as long as the
sensors' delay is.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Final, NoReturn

import numpy as np

from training.drivers.interface import WATCHDOG_S, DriveCommand, Outcome, Sample
from training.drivers.packets import Begin, Order, Packet, Report, Stop, decode, encode
from training.drivers.transport import Transport
from training.run.link import Link, LinkQuality
from training.run.world import SAMPLES, World

_STILL: Final[DriveCommand] = (0, 0, 0)
_AT_ONCE: Final = 2
"""Newest samples in a report: each is sent twice, since one packet may be lost."""

_IDLE_S: Final = 1.0
"""How long a robot waits for packets while nothing happens [s]."""
_ANSWER_S: Final = 30.0
"""How long a robot in step waits for an answer [s]."""
_PAUSE_S: Final = 0.01
"""How long a robot in step waits for packets between two fights [s]."""

Journal = Callable[[float, DriveCommand, str], None]
"""Called with the time [s], the motors' new command, and why."""


class RobotSide:
    """A robot that fights in a world; fight number n has the seed `first_seed` + n.

    The `journal` is told what the motors do.
    """

    def __init__(self, world: World, first_seed: int, journal: Journal) -> None:
        self._world, self._first_seed, self._journal = world, first_seed, journal
        lead_s = min(world.observation_delay_s, world.period_s)
        self._lead = round(lead_s / world.period_s * SAMPLES)  # in quarters
        self._quarter_s = world.period_s / SAMPLES
        self._session: int | None = None
        self._fight = -1
        self._outcome: Outcome = "ready"
        self._motors, self._newest = _STILL, _STILL
        self._newest_tick, self._held_tick = -1, -1
        self._heard_s, self._began_s = 0.0, 0.0
        self._samples: list[Sample] = []
        self._ahead: list[Sample] = []
        self._observation, self._tick, self._quarters = world.observation, 0, 0
        self.next_s = float("inf")
        """When time passes next [s]; infinite before the first fight."""

    def awaits_answer(self, report: bytes) -> bool:
        """Return whether a `report` is of the fight under way, so that the controller answers it."""
        packet = decode(report)
        return self._outcome == "fighting" and packet is not None and packet.fight == self._fight

    def hear(self, packet: Packet, now_s: float) -> None:
        """Obey a packet that has come at a time [s]."""
        body = packet.body
        if isinstance(body, Begin):
            # The same is told several times, and packets may overtake each other.
            if packet.session != self._session or packet.fight > self._fight:
                self._begin(packet, now_s)
            return
        if (packet.session, packet.fight) != (self._session, self._fight):
            return
        if isinstance(body, Stop):
            self._stop()
        elif isinstance(body, Order):
            self._heard_s = now_s
            # Packets may overtake each other.
            if self._outcome == "fighting" and body.tick >= self._newest_tick:
                self._newest_tick, self._newest = body.tick, body.command

    def pass_time(self, now_s: float) -> list[Packet]:
        """Let time pass until now [s]; return the reports that are due.

        In a process that could not run for longer than a quarter of a period no time has passed.
        """
        reports = []
        if (stalled_s := now_s - self.next_s) > self._quarter_s:
            self._began_s, self._heard_s = self._began_s + stalled_s, self._heard_s + stalled_s
            self.next_s = now_s
        while self.next_s <= now_s:
            if self._outcome == "fighting" and now_s - self._heard_s > WATCHDOG_S:
                self._stop()
            reports.append(self._quarter())
            self.next_s = self._began_s + (self._quarters + 1) * self._quarter_s
        return reports

    def _begin(self, packet: Packet, now_s: float) -> None:
        self._session, self._fight = packet.session, packet.fight
        self._ahead = self._world.begin(self._first_seed + packet.fight)
        self._samples = []
        self._observation, self._tick = self._world.observation, 0
        self._outcome, self._newest = "fighting", _STILL
        self._newest_tick, self._held_tick, self._heard_s = -1, -1, now_s
        # The first observation is reported at once, and the first command taken when it is due.
        self._quarters = -self._lead - 1
        self._began_s = now_s + self._lead * self._quarter_s
        self.next_s = now_s

    def _stop(self) -> None:
        self._newest = _STILL
        if self._outcome == "fighting":
            self._outcome = "stopped"

    def _quarter(self) -> Packet:
        """Let a quarter of a period pass; return the report at its end."""
        self._quarters += 1
        tick, quarter = divmod(self._quarters, SAMPLES)
        if self._quarters >= 0:
            if quarter == 0:
                self._take_command()
            taken = [replace(sample, command=self._motors) for sample in self._ahead[:1]]
            self._samples = [*self._samples, *taken][-_AT_ONCE:]
            del self._ahead[:1]
        if quarter >= SAMPLES - self._lead and self._tick <= tick:
            # What the sensors show of this time is what the next command may depend on.
            self._tick, self._observation = tick + 1, self._world.observation
        time_s = self._quarters * self._quarter_s
        samples = tuple(self._samples)
        report = Report(self._tick, self._held_tick, self._outcome, self._observation, samples, time_s)
        assert self._session is not None
        return Packet(self._session, self._fight, report)

    def _take_command(self) -> None:
        """Begin a command period, with the newest command; what ended in the last period is now known."""
        if self._world.outcome == "fighting":
            before, self._motors = self._motors, self._newest
            self._held_tick = self._newest_tick
            if before != self._motors:
                why = "command" if self._outcome == "fighting" else self._outcome
                self._journal(self._began_s + self._quarters * self._quarter_s, self._motors, why)
            self._ahead += self._world.step(self._motors)
        elif self._outcome == "fighting":
            self._outcome = self._world.outcome
            if self._motors != _STILL:
                self._motors = _STILL
                self._journal(self._began_s + self._quarters * self._quarter_s, _STILL, self._outcome)


def serve(robot: RobotSide, transport: Transport, quality: LinkQuality, rng: np.random.Generator) -> NoReturn:
    """Let a robot hear and report for ever over a transport, through links of a quality and its `rng`."""
    to_robot, from_robot = Link(quality, rng), Link(quality, rng)
    while True:
        next_s = min(robot.next_s, to_robot.next_s, from_robot.next_s)
        heard = transport.receive(min(max(next_s - time.monotonic(), 0.0), _IDLE_S))
        now_s = time.monotonic()
        if heard is not None:
            to_robot.put(heard, now_s)
        for data in _passed(robot, to_robot, from_robot, now_s):
            transport.send(data)


def serve_in_step(
    robot: RobotSide, transport: Transport, quality: LinkQuality, rng: np.random.Generator
) -> NoReturn:
    """Do the same in a time of its own, which stands still while the controller computes its answer.

    Each report of a fight under way is answered, so the robot waits for that before it lets time pass.
    """
    to_robot, from_robot = Link(quality, rng), Link(quality, rng)
    now_s = 0.0
    while True:
        next_s = min(robot.next_s, to_robot.next_s, from_robot.next_s)
        while heard := transport.receive(0.0 if next_s < float("inf") else _IDLE_S):
            to_robot.put(heard, now_s)
            next_s = min(next_s, to_robot.next_s)
        if next_s == float("inf"):
            continue
        now_s = max(now_s, next_s)
        for data in _passed(robot, to_robot, from_robot, now_s):
            transport.send(data)
            # After the fight nothing but the next one is waited for, in real time.
            answer = transport.receive(_ANSWER_S if robot.awaits_answer(data) else _PAUSE_S)
            if answer is not None:
                to_robot.put(answer, now_s)


def _passed(robot: RobotSide, to_robot: Link, from_robot: Link, now_s: float) -> list[bytes]:
    """Let the robot hear what has come by now [s], and time pass; return what has left the link."""
    for data in to_robot.due(now_s):
        if (packet := decode(data)) is not None:
            robot.hear(packet, now_s)
    for report in robot.pass_time(now_s):
        from_robot.put(encode(report), now_s)
    return from_robot.due(now_s)
