"""Whether a robot is of any use: a short drive forwards, sideways, round, and to a stop."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.simulate import move

_SHARE: Final = 0.7
"""Of the top speed, which the trial drives at: the rest is for turning while driving."""
_HOLD_S, _LOOK_S = 2.5, 0.6
"""Length of a part, and of its end, where the robot is looked at."""
LEAST_REACHED: Final = 0.6
MOST_REACHED: Final = 1.3
LARGEST_RIPPLE: Final = 0.12
LARGEST_REST: Final = 0.03


@dataclass(frozen=True)
class Trial:
    """What a robot did in its trial; speeds as shares of what rigid wheels without slip would give."""

    forwards: float
    sideways: float
    round: float
    """Yaw rate."""
    ripple_forwards: float
    """Standard deviation of the speed forwards."""
    ripple_sideways: float
    wheels: float
    """Mean size of the wheels' speeds over their commands, of the part that is farthest from 1."""
    wheel_ripple: float
    """Largest standard deviation of a wheel's speed."""
    rest: float
    """Largest size of a wheel's mean speed after the last command of 0."""

    @property
    def useful(self) -> bool:
        """Whether the robot goes where it is sent, steadily, and stops."""
        shares = (self.forwards, self.sideways, self.round, self.wheels)
        return bool(
            min(shares) >= LEAST_REACHED
            and max(shares) <= MOST_REACHED
            and self.wheel_ripple <= LARGEST_RIPPLE
            and self.rest <= LARGEST_REST
        )


def try_out(robot: Robot) -> Trial:
    """Return what a robot does that is sent forwards, left, round counter-clockwise, and to rest."""
    top, period_s = _SHARE * robot.drive.top_rpm, robot.drive.link.period_s
    parts = ((top, 0.0, 0.0), (0.0, 0.0, 0.0), (top, 90.0, 0.0), (0.0, 0.0, top), (0.0, 0.0, 0.0))
    held = round(_HOLD_S / period_s)
    motion = move(robot, np.repeat(np.array(parts), held, axis=0), np.random.default_rng(0))
    top_rad_s = top * 2.0 * math.pi / 60.0
    arm = robot.body.half_wheelbase_m + robot.body.half_track_m
    surface_m_s = robot.wheels.radius_m * top_rad_s
    wheels = np.column_stack([wheel.wheel_rad_s for wheel in motion.wheels]) / top_rad_s
    twist = motion.twist / np.array([surface_m_s, surface_m_s, surface_m_s / arm])
    ends_s = period_s * held * np.arange(1, len(parts) + 1)
    looks = [(motion.time_s >= end - _LOOK_S) & (motion.time_s < end) for end in ends_s]
    ahead, _, left, turning, stopped = looks
    reached = [float(np.abs(wheels[look].mean(axis=0)).mean()) for look in (ahead, left, turning)]
    return Trial(
        forwards=float(twist[ahead, 0].mean()),
        sideways=float(twist[left, 1].mean()),
        round=float(twist[turning, 2].mean()),
        ripple_forwards=float(twist[ahead, 0].std()),
        ripple_sideways=float(twist[left, 1].std()),
        wheels=max(reached, key=lambda share: abs(share - 1.0)),
        wheel_ripple=max(float(wheels[look].std(axis=0).max()) for look in looks),
        rest=float(np.abs(wheels[stopped].mean(axis=0)).max()),
    )
