"""What the robot's sensors tell: the observation, number by number.

Positions and velocities are in the robot's body frame (x forward, y left), velocities are over the floor.
All of it is as it was `Sensors.delay_s` ago, with normal noise of the given standard deviation.

| index | quantity | unit | noise |
|---|---|---|---|
| 0, 1 | place of the opponent: ahead, left | m | 0.01 |
| 2, 3 | velocity of the opponent: ahead, left | m/s | 0.05 |
| 4, 5, 6 | tip of its sword: ahead, left, height over the floor | m | 0.01 |
| 7, 8, 9 | velocity of the tip: ahead, left, up | m/s | 0.1 |
| 10, 11, 12 | own velocity: ahead, left; yaw rate | m/s, m/s, rad/s | 0.02, 0.02, 0.02 |
| 13, 14, 15 | the command now held: V cos theta / 135, V sin theta / 135, VC / 100 | 1 | 0 |
| 16, 17 | own place in the field, from its centre: x, y | m | 0.02 |
| 18, 19 | cosine and sine of the own heading in the field | 1 | 0.01 |

The duel adds 20, 21: points of the robot and of the opponent; 22: 1 while the robot's own sword strikes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo.constants import Sensors
from mecanum_env.tankendo.sword import Sword
from mecanum_env.units import FloatArray

SIZE: Final = 20
"""Numbers that every task observes."""
NOISY: Final = 17
"""Of them with noise: all but the command."""
LIMITS: Final = np.array(
    [15.0] * 2
    + [5.0] * 2
    + [15.0] * 2
    + [3.0]
    + [40.0] * 3
    + [5.0, 5.0, 20.0]
    + [1.5] * 3
    + [7.0] * 2
    + [1.5] * 2
)
"""Largest absolute value of each number; observations are clipped to it."""
EXTRA_LIMIT: Final = 10.0
"""The same for what a task adds."""


@dataclass(frozen=True)
class Observed:
    """An observation by name; each field is a float, or an array (n,) of a batch."""

    opponent_x: npt.NDArray[np.floating]
    """Ahead of the robot [m]."""
    opponent_y: npt.NDArray[np.floating]
    """Left of the robot [m]."""
    opponent_vx: npt.NDArray[np.floating]
    """Over the floor, along the robot's axis [m/s]."""
    opponent_vy: npt.NDArray[np.floating]
    """Over the floor, to the robot's left [m/s]."""
    tip_x: npt.NDArray[np.floating]
    """[m]"""
    tip_y: npt.NDArray[np.floating]
    """[m]"""
    tip_height: npt.NDArray[np.floating]
    """[m]"""
    tip_vx: npt.NDArray[np.floating]
    """[m/s]"""
    tip_vy: npt.NDArray[np.floating]
    """[m/s]"""
    tip_rising: npt.NDArray[np.floating]
    """[m/s]"""
    vx: npt.NDArray[np.floating]
    """Own [m/s]."""
    vy: npt.NDArray[np.floating]
    """Own [m/s]."""
    yaw_rate: npt.NDArray[np.floating]
    """Own [rad/s]."""
    forward_share: npt.NDArray[np.floating]
    """Of the command now held, V cos theta / 135."""
    left_share: npt.NDArray[np.floating]
    """V sin theta / 135."""
    turn_share: npt.NDArray[np.floating]
    """VC / 100."""
    x: npt.NDArray[np.floating]
    """Own place in the field [m]."""
    y: npt.NDArray[np.floating]
    """Own place in the field [m]."""
    heading_cos: npt.NDArray[np.floating]
    heading_sin: npt.NDArray[np.floating]


def read_observation(observation: npt.NDArray[np.floating]) -> Observed:
    """Return the numbers of an observation, shape (..., 20 or more), by name."""
    return Observed(*(observation[..., i] for i in range(SIZE)))


def noise_sizes(sensors: Sensors) -> FloatArray:
    """Return the standard deviation of each noisy number, shape (17, 1), of these sensors."""
    s = sensors
    position, tip = [s.position_m] * 2, [s.position_m] * 3
    own = [s.own_velocity_m_s] * 2 + [s.own_yaw_rate_rad_s]
    rest = [s.place_m] * 2 + [s.heading_rad] * 2
    sizes = [*position, *[s.velocity_m_s] * 2, *tip, *[s.tip_velocity_m_s] * 3, *own, *rest]
    return np.array(sizes)[:, None]


def observe(
    seen: FloatArray,
    own: FloatArray,
    time_s: FloatArray,
    sword: Sword,
    held: FloatArray,
    noise: FloatArray,
    extra: FloatArray,
) -> npt.NDArray[np.float32]:
    """Return observations, shape (n, 20 + extra).

    Args:
        seen: the scene as the sensors show it, (11, n).
        own: the own velocity as the sensors show it, ahead, left [m/s], yaw rate [rad/s], (3, n).
        time_s: of the scene, (n,).
        sword: the opponent's.
        held: shares of the command now held, (3, n).
        noise: what the sensors add, (17, n).
        extra: what the task adds, (k, n).
    """
    cos, sin = np.cos(seen[2]), np.sin(seen[2])
    tip, tip_velocity = sword.tip_and_velocity(time_s, seen)
    shown = np.empty((SIZE + len(extra), len(time_s)))

    def put(index: int, x: FloatArray, y: FloatArray) -> None:
        """Write a vector, given in the field's frame, in the body's frame."""
        shown[index] = cos * x + sin * y
        shown[index + 1] = cos * y - sin * x

    put(0, seen[6] - seen[0], seen[7] - seen[1])
    put(2, seen[9], seen[10])
    put(4, tip[0] - seen[0], tip[1] - seen[1])
    shown[6] = tip[2]
    put(7, tip_velocity[0], tip_velocity[1])
    shown[9] = tip_velocity[2]
    shown[10:13] = own
    shown[13:16] = held
    shown[16:18] = seen[0:2]
    shown[18], shown[19] = cos, sin
    shown[:13] += noise[:13]
    shown[16:20] += noise[13:]
    shown[20:] = extra
    limits = np.concatenate([LIMITS, np.full(len(extra), EXTRA_LIMIT)])[:, None]
    return np.clip(shown, -limits, limits).T.astype(np.float32)
