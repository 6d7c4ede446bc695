"""The loop of a controller on a robot: an observation in, a command out, ten times a second."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Final

from training.controllers.interface import Controller
from training.drivers.interface import SILENCE_S, Driver, Outcome, RobotSilentError
from training.run.fight_log import FightLog

_ANSWER_S: Final = 2.0
"""How long a robot that stands still may take to answer that a fight begins [s]."""


@dataclass(frozen=True)
class Fight:
    """What the loop knows of a fight."""

    number: int
    outcome: Outcome
    commands: int
    """Commands that were decided."""
    missed: int
    """Observations that never came, so that the robot held the command before."""
    late: int
    """Commands that came too late for their period, so that the robot held the one before for longer."""
    intervals_s: tuple[float, ...]
    """Times between two decisions [s]: the command period and its jitter; those of missed ones are left
    out."""
    thinking_s: tuple[float, ...]
    """Time that the controller took for each command [s]."""


def play(
    driver: Driver,
    controller: Controller,
    number: int,
    log_file: Path,
    silence_s: float = SILENCE_S,
    now: Callable[[], float] = time.monotonic,
) -> Fight:
    """Fight once, and log it; whatever happens, the robot has been told to stop when this returns.

    Args:
        driver: of the robot.
        controller: what decides.
        number: of the fight.
        log_file: CSV file to write.
        silence_s: how long the robot may be silent [s].
        now: tells the time [s].

    Raises:
        RobotSilentError: nothing has been heard of the robot for `silence_s`, or it never answered.
        InputError: an observation that the controller does not take, or a log that cannot be written.
    """
    controller.reset()
    tick, missed, late = -1, 0, 0
    decided: list[tuple[int, float]] = []
    thinking: list[float] = []
    with FightLog(log_file) as log:
        try:
            driver.begin(number)
            heard_s, patience_s = now(), _ANSWER_S
            while True:
                until_s = heard_s + patience_s
                reading = driver.read(until_s - now())
                if reading is None:
                    if now() < until_s:
                        continue
                    raise RobotSilentError(
                        f"fight {number}: nothing heard of the robot for {patience_s:g} s; a stop was sent"
                    )
                heard_s, patience_s = now(), silence_s
                log.add(reading.samples)
                if reading.outcome not in ("ready", "fighting"):
                    break
                if reading.tick > tick:
                    missed += reading.tick - tick - 1
                    late += reading.held < reading.tick - 1
                    tick = reading.tick
                    began_s = now()
                    command = controller.act(reading.observation)
                    thinking.append(now() - began_s)
                    decided.append((tick, now()))
                driver.send(tick, command)
        finally:
            driver.stop()
    pairs = pairwise(decided)
    intervals = tuple(late - early for (first, early), (second, late) in pairs if second == first + 1)
    return Fight(number, reading.outcome, len(decided), missed, late, intervals, tuple(thinking))


def play_series(
    driver: Driver,
    controller: Controller,
    count: int,
    folder: Path,
    progress: Callable[[Fight], None],
    silence_s: float = SILENCE_S,
) -> list[Fight]:
    """Return a number of fights, `count`, one after the other; each is logged in the folder.

    `driver`, `controller` and `silence_s` are those of `play`; `progress` is called after each fight.

    Raises:
        RobotSilentError: as in `play`; the logs so far are there.
        InputError: as in `play`.
    """
    fights = []
    for number in range(count):
        fights.append(play(driver, controller, number, folder / f"fight_{number:04d}.csv", silence_s))
        progress(fights[-1])
    return fights
