"""The oracle: it looks into the simulator and knows when the strike starts and lands; an upper bound."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import read_observation
from mecanum_env.tankendo.arena import Arena
from training.controllers.hold import Hold
from training.controllers.interface import Command, twist_command


class Oracle:
    """Holds the far edge of maai, is gone when the strike starts, and back after it.

    Args:
        arena: what it looks into; `env.unwrapped.arena`.
        row: which of its episodes.
    """

    def __init__(self, arena: Arena, row: int = 0) -> None:
        self._arena, self._row = arena, row
        self._far, self._near = Hold(distance_m=1.86), Hold()

    def reset(self) -> None:
        """Forget nothing: the simulator remembers."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        sword, row = self._arena.fighter.sword, self._row
        now = self._arena.step_count[row] * self._arena.step_s
        seen = read_observation(observation)
        vx, vy, turn = self._far.twist(seen)
        if self._arena.fighter.pending[row] and not sword.is_feint[row]:
            x, y = float(seen.opponent_x), float(seen.opponent_y)
            distance = max(float(np.hypot(x, y)), 1e-6)
            vx, vy = -1.07 * x / distance, -1.07 * y / distance
        elif now > sword.land_s[row] and not sword.is_feint[row]:
            vx, vy, turn = self._near.twist(seen)
        return twist_command(vx, vy, turn, self._far.robot)
