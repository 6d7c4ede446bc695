"""What the robot's sensors tell: the observation, number by number.

Positions and velocities are in the robot's body frame (x forward, y left), velocities are over the floor.
All of it is as it was `Sensors.delay_s` ago, with normal noise of the given standard deviation.
Effects of the model on sensors act on 10-12 and 16-19, what the robot measures of itself
(`mecanum_env.tankendo.senses`).

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
