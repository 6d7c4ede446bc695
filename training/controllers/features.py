"""What a trained policy looks at: numbers made of an observation, in which a strike stands out.

An observation says where tip and opponent are. A sword that draws back 0.2 m is little beside the metre by
which distances differ, and one that sinks (do) looks like the opposite of one that rises. So the tip is given
relative to its place on guard, and how far it is from there as a number of its own.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Rules, read_observation
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.observation import SIZE
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from mecanum_env.units import FloatArray

NAMES: Final = (
    "distance - maai",
    "bearing",
    "opponent's velocity relative to the own, ahead",
    "the same, left",
    "tip seen from the opponent, ahead",
    "the same, left",
    "tip's height over guard",
    "how far the tip is from guard",
    "tip's velocity relative to the opponent, ahead",
    "the same, left",
    "tip's velocity upwards",
    "own velocity, ahead",
    "own velocity, left",
    "own yaw rate",
    "command held, ahead",
    "command held, left",
    "command held, turn",
    "own place, x",
    "own place, y",
    "cosine of the own heading",
    "sine of the own heading",
)
"""The features; what a task adds to an observation follows them as it is."""
ADDED: Final = len(NAMES) - SIZE
"""Features minus numbers of an observation."""


def features(observation: npt.NDArray[np.floating]) -> FloatArray:
    """Return the features, shape (..., k + 1), of observations, shape (..., k), k = 20 or more."""
    whole = np.asarray(observation, float)
    seen = read_observation(whole)
    tip_x, tip_y = seen.tip_x - seen.opponent_x, seen.tip_y - seen.opponent_y
    drawn, raised = np.hypot(tip_x, tip_y) - GUARD_TIP_M, seen.tip_height - GUARD_HEIGHT_M
    own = (
        np.hypot(seen.opponent_x, seen.opponent_y) - Rules.maai_m,
        np.arctan2(seen.opponent_y, seen.opponent_x),
        seen.opponent_vx - seen.vx,
        seen.opponent_vy - seen.vy,
        tip_x,
        tip_y,
        raised,
        np.hypot(drawn, raised),
        seen.tip_vx - seen.opponent_vx,
        seen.tip_vy - seen.opponent_vy,
        seen.tip_rising,
    )
    return np.concatenate([np.stack(own, axis=-1), whole[..., 10:]], axis=-1)
