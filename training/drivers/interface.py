"""What a robot's driver does: the one interface between the loop of a controller and a robot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, Protocol, get_args

from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import ROBOT_CHANNELS
from mecanum_env.units import FloatArray

CHANNELS: Final = ROBOT_CHANNELS
"""Measured columns of a log that a sample holds, in their order; what a robot does not measure is NaN."""
Outcome = Literal["ready", "fighting", "won", "lost", "stopped"]
"""How a fight stands: not begun, under way, ended; "stopped": by the robot's watchdog, or because it was
told."""
OUTCOMES: Final[tuple[Outcome, ...]] = get_args(Outcome)
STOPPED_S: Final = 0.3
"""Killing either side stops the robot within this time [s]."""
WATCHDOG_S: Final = 0.15
"""A robot that hears no command for this long stops, and stays still until the next fight begins [s].

A robot that takes commands every 0.1 s stands still a command period later: `STOPPED_S` less 0.05 s for
commands that are still under way.
"""
SILENCE_S: Final = 0.3
"""A controller that hears nothing of the robot for this long sends a stop and gives up [s]."""

DriveCommand = tuple[int, int, int]
"""V [rpm], theta [deg], VC [rpm]."""


class RobotSilentError(MecanumError):
    """The robot cannot be heard any more; it has been told to stop."""


@dataclass(frozen=True)
class Sample:
    """What the robot's own sensors measured at one time."""

    time_s: float
    """Since the first command of the fight was due [s], by the robot's clock."""
    values: tuple[float, ...]
    """In the order of `CHANNELS`."""
    command: DriveCommand = (0, 0, 0)
    """The command that the robot held from this time on, as it took it."""


@dataclass(frozen=True)
class Reading:
    """What a robot reports: its latest observation, and samples that it may have reported before."""

    tick: int
    """Number of the command that the observation is for, from 0."""
    held: int
    """Tick of the command that the robot now holds; one before `tick` unless that came too late."""
    outcome: Outcome
    observation: FloatArray
    """As `mecanum_env.tankendo.observation` describes it, shape (k,)."""
    samples: tuple[Sample, ...]
    """The newest samples, in the order of their times."""


class Driver(Protocol):
    """A robot as the loop sees it."""

    def begin(self, fight: int) -> None:
        """Tell the robot that a fight, by its number, begins: from now on it may move.

        Only readings of this fight are returned from now on.
        """
        ...

    def read(self, timeout_s: float) -> Reading | None:
        """Return the next reading, waiting for it at most `timeout_s` [s]; None: there was none.

        Raises:
            RobotSilentError: the connection is gone for good.
        """
        ...

    def send(self, tick: int, command: DriveCommand) -> None:
        """Send the command of a tick, which the robot holds until the next.

        The loop answers every reading, with the last command if the tick is the same: that feeds the robot's
        watchdog and makes up for lost packets.
        """
        ...

    def stop(self) -> None:
        """Tell the robot to stand still at once, and until the next fight begins."""
        ...

    def close(self) -> None:
        """Stop the robot and free the connection."""
        ...
