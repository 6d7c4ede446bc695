"""Keeping the distance and facing the opponent: a proportional controller."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Robot, Wheel
from mecanum_env.tankendo import Observed, Rules, read_observation
from training.controllers.interface import Command, twist_command


@dataclass(frozen=True)
class Proportional:
    """Twist asked for = gains * (distance error, bearing)."""

    distance_m: float = Rules.maai_m
    """Distance to keep [m]."""
    gain_per_s: float = 2.0
    """Correction of the distance [1/s]."""
    turn_gain_per_s: float = 2.0
    """Correction of the bearing [1/s]."""
    robot: Robot = field(default_factory=Robot)
    """Dimensions of the robot, for its kinematics."""
    limit_rpm: float = Wheel.saturation_rpm
    """Ceiling of its wheels [rpm]."""

    def reset(self) -> None:
        """Forget nothing: it has no memory."""

    def act(self, observation: npt.NDArray[np.floating]) -> Command:
        """Return the command for an observation, shape (20 or more,)."""
        seen = read_observation(observation)
        return self.command(*self.twist(seen))

    def command(self, vx_m_s: float, vy_m_s: float, yaw_rate_rad_s: float) -> Command:
        """Return the robot's command for a twist: ahead, left [m/s], turn [rad/s]."""
        return twist_command(vx_m_s, vy_m_s, yaw_rate_rad_s, self.robot, self.limit_rpm)

    def twist(self, seen: Observed) -> tuple[float, float, float]:
        """Return the wanted twist: ahead, left [m/s], turn [rad/s]; `seen` is one observation."""
        x, y = float(seen.opponent_x), float(seen.opponent_y)
        distance = max(float(np.hypot(x, y)), 1e-6)
        speed = self.gain_per_s * (distance - self.distance_m)
        turn = self.turn_gain_per_s * float(np.arctan2(y, x))
        return speed * x / distance, speed * y / distance, turn
