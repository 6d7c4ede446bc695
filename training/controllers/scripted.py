"""Standing still.

A new random command every time.

The scripted retreat: hold the distance; when the sword rises, straight back; then return.

The scripted side-step: hold the distance; when the sword rises, straight to one side; then return.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Observed, action_to_command, read_observation
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.interface import Command
from training.controllers.tracking import Proportional


class Still:
    """Never moves."""

    def reset(self) -> None:
        """Forget the episode."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command to stand, whatever the observation."""
        return 0, 0, 0


class RandomMotion:
    """Draws actions evenly, as `env.action_space.sample()` does.

    Args:
        seed: of its generator; each episode goes on with it.
    """

    def __init__(self, seed: int = 0) -> None:
        self._rng = np.random.default_rng(seed)

    def reset(self) -> None:
        """Forget nothing: chance has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return a random command, whatever the observation."""
        v, theta, vc = action_to_command(self._rng.uniform(-1.0, 1.0, 3), "cartesian")
        return int(v), int(theta), int(vc)


@dataclass
class Retreat:
    """Backs off at full speed for a while once the sword has left its guard, then returns to its distance."""

    hold: Proportional = field(default_factory=Proportional)
    """What it does otherwise."""
    speed_m_s: float = 1.07
    """Of the retreat [m/s]; the paper's robot reaches 1.08."""
    commands: int = 4
    """Length of the retreat, in commands of 0.1 s."""
    tip_m: float = 0.07
    """A tip this far from its place on guard has risen [m]; five times the sensors' noise."""

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._since = 0

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = read_observation(observation)
        vx, vy, turn = self.hold.twist(seen)
        self._since = self._since + 1 if self.is_threatened(seen) else 0
        if 0 < self._since <= self.commands:
            x, y = float(seen.opponent_x), float(seen.opponent_y)
            distance = max(float(np.hypot(x, y)), 1e-6)
            vx, vy = -self.speed_m_s * x / distance, -self.speed_m_s * y / distance
        return self.hold.command(vx, vy, turn)

    def is_threatened(self, seen: Observed) -> bool:
        """Return whether the opponent, as `seen`, has left its guard."""
        ahead = float(np.hypot(seen.tip_x - seen.opponent_x, seen.tip_y - seen.opponent_y))
        return max(abs(ahead - GUARD_TIP_M), abs(float(seen.tip_height) - GUARD_HEIGHT_M)) > self.tip_m


@dataclass
class SideStep:
    """Goes across the line to the opponent once its sword has left its guard, then returns to its distance.

    To which side: where the middle of the field is, so that there is room.
    """

    hold: Proportional = field(default_factory=Proportional)
    """What it does otherwise."""
    speed_m_s: float = 1.07
    """Of the step [m/s]; the paper's robot reaches 1.08."""
    commands: int = 4
    """Length of the step, in commands of 0.1 s."""
    wait: int = 0
    """Commands from the first sign to the step."""
    back_share: float = 0.0
    """Part of the step that goes away from the opponent, 0 to 1."""

    def __post_init__(self) -> None:
        self._watch = Retreat(self.hold)
        self.reset()

    def reset(self) -> None:
        """Forget the episode."""
        self._since, self._side = 0, 1.0

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = read_observation(observation)
        vx, vy, turn = self.hold.twist(seen)
        self._since = self._since + 1 if self._watch.is_threatened(seen) else 0
        x, y = float(seen.opponent_x), float(seen.opponent_y)
        distance = max(float(np.hypot(x, y)), 1e-6)
        x, y = x / distance, y / distance
        if self._since == 1:
            # The middle of the field, from the robot, lies along -place: which side of the line is it on?
            cos, sin = float(seen.heading_cos), float(seen.heading_sin)
            left = -(cos * float(seen.y) - sin * float(seen.x))
            ahead = -(cos * float(seen.x) + sin * float(seen.y))
            self._side = 1.0 if x * left - y * ahead >= 0.0 else -1.0
        if self.wait < self._since <= self.wait + self.commands:
            back = self.back_share
            across = self._side * float(np.sqrt(1.0 - back * back))
            vx, vy = (self.speed_m_s * (-across * y - back * x), self.speed_m_s * (across * x - back * y))
        return self.hold.command(vx, vy, turn)
