"""The scripted side-step: hold the distance; when the sword rises, straight to one side; then return."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import read_observation
from training.controllers.interface import Command
from training.controllers.proportional import Proportional
from training.controllers.retreat import Retreat


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
