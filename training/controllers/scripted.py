"""Baselines: standing still, random commands, and scripts that evade once the sword rises."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Observed, action_to_command, read_observation
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.interface import Command
from training.controllers.tracking import Proportional, opponent_place

_RISEN_M = 0.07
"""Distance of the tip from its place on guard above which it has risen [m]; five times the sensors' noise."""


class Still:
    """Never moves."""

    def reset(self) -> None:
        """Do nothing: the controller has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command to stand, for any observation."""
        return 0, 0, 0


class RandomMotion:
    """Draws actions uniformly, as `env.action_space.sample()` does; its generator goes on over episodes."""

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)

    def reset(self) -> None:
        """Do nothing: the generator goes on."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return a random command, for any observation."""
        v, theta, vc = action_to_command(self._rng.uniform(-1.0, 1.0, 3), "cartesian")
        return int(v), int(theta), int(vc)


@dataclass
class Retreat:
    """Backs off at full speed once the sword has left its guard, then returns to its distance."""

    hold: Proportional = field(default_factory=Proportional)
    """Controller of the remaining time."""
    speed_m_s: float = 1.07
    """Speed of the evasion [m/s]; the paper's robot reaches 1.08."""
    commands: int = 4
    """Duration of the evasion, in commands of 0.1 s."""

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._since, self._side = 0, 1.0

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = read_observation(observation)
        vx, vy, turn = self.hold.twist(seen)
        self._since = self._since + 1 if _has_risen(seen) else 0
        x, y, distance = opponent_place(seen)
        if 0 < self._since <= self.commands:
            x, y = self.direction(seen, x / distance, y / distance)
            vx, vy = self.speed_m_s * x, self.speed_m_s * y
        elif self._since == 0:
            ahead, left = self.waiting(x / distance, y / distance)
            vx, vy = vx + ahead, vy + left
        return self.hold.command(vx, vy, turn)

    def waiting(self, x: float, y: float) -> tuple[float, float]:
        """Return the velocity [m/s] that is added while the sword is on guard, the opponent towards x, y."""
        return 0.0, 0.0

    def direction(self, seen: Observed, x: float, y: float) -> tuple[float, float]:
        """Return the direction of the evasion; the opponent, as it is `seen`, is in the direction x, y."""
        return -x, -y


class SideStep(Retreat):
    """Moves across the line to the opponent once its sword has left its guard, then returns to its distance.

    It moves to the side on which the middle of the field lies, where there is room.
    """

    def direction(self, seen: Observed, x: float, y: float) -> tuple[float, float]:
        """Return the direction of the evasion; the opponent, as it is `seen`, is in the direction x, y."""
        if self._since == 1:
            # The middle of the field in the frame of the robot.
            cos, sin = float(seen.heading_cos), float(seen.heading_sin)
            ahead = -(cos * float(seen.x) + sin * float(seen.y))
            left = -(cos * float(seen.y) - sin * float(seen.x))
            self._side = 1.0 if x * left - y * ahead >= 0.0 else -1.0
        return -self._side * y, self._side * x


@dataclass
class Creep(Retreat):
    """Moves slowly across the line to the opponent, and the other way at full speed once its sword rises.

    A robot that is slow enough still offers an opening. An opponent that extrapolates the waiting motion aims
    to the wrong side, and a wheel that follows a linear law changes its speed the faster the larger the
    change. The script is a baseline for waiting in motion.
    """

    creep_m_s: float = 0.2
    """Speed of the waiting motion to the left [m/s]; below `Rules.slow_m_s`, negative to the right."""
    onward: bool = False
    """Evades onward in the direction of the waiting motion instead of reversing it."""

    def waiting(self, x: float, y: float) -> tuple[float, float]:
        """Return the velocity of the waiting motion [m/s], across the direction x, y of the opponent."""
        return -self.creep_m_s * y, self.creep_m_s * x

    def direction(self, seen: Observed, x: float, y: float) -> tuple[float, float]:
        """Return the direction of the evasion; the opponent, as it is `seen`, is in the direction x, y."""
        left = (self.creep_m_s >= 0.0) == self.onward
        return (-y, x) if left else (y, -x)


def _has_risen(seen: Observed) -> bool:
    """Return whether the opponent's tip has left its place on guard."""
    ahead = float(np.hypot(seen.tip_x - seen.opponent_x, seen.tip_y - seen.opponent_y))
    return max(abs(ahead - GUARD_TIP_M), abs(float(seen.tip_height) - GUARD_HEIGHT_M)) > _RISEN_M
