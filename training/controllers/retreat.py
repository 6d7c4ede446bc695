"""The scripted retreat: hold the distance; when the sword rises, straight back; then return."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Observed, read_observation
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.interface import Command
from training.controllers.proportional import Proportional


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
