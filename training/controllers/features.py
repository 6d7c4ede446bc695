"""What a policy's network sees: features of an observation in which a strike stands out.

They are the position of the tip relative to its place on guard, and its distance from there. In the raw
observation, a sword that is drawn back by 0.2 m hardly shows beside distances that vary by a metre, and a
sword that sinks (do) looks like the opposite of one that rises.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Rules, read_observation
from mecanum_env.tankendo.constants import GUARD_TIP_M, TECHNIQUES
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from mecanum_env.units import FloatArray

KEPT: Final = 10
"""From this number on an observation (own motion, held command, own place) is kept unchanged."""
FEATURE_NAMES: Final = (
    "distance - maai",
    "bearing",
    "opponent's relative velocity, ahead",
    "opponent's relative velocity, left",
    "tip relative to the opponent, ahead",
    "tip relative to the opponent, left",
    "tip's height above guard",
    "tip's distance from guard",
    "tip's velocity relative to the opponent, ahead",
    "tip's velocity relative to the opponent, left",
    "tip's velocity, up",
)
"""The features that replace the numbers before."""
EXTRA_FEATURES: Final = len(FEATURE_NAMES) - KEPT
"""Number of features minus the size of an observation, without the time to the cut."""
TIME_TO_CUT: Final = "time to cut"
"""Name of the last feature of a network that has it."""
FAR_S: Final = 0.6
"""The time to the cut is at most this [s], and this while the sword does not rise. An evasion takes less."""
LEAST_SHARE, LEAST_RATE_PER_S, DRAWN_SHARE = 0.02, 0.1, 0.9
"""The sword rises from the first share of its way on, if at least with this rate [1/s]: the sensors' noise
seldom reaches both. Slower, and beyond the last share, it is drawn. The techniques are taken as known."""
_WAYS = np.array(
    [(one.raised_tip_m - GUARD_TIP_M, one.raised_height_m - GUARD_HEIGHT_M) for one in TECHNIQUES]
)
WAY_LENGTHS_M: Final[FloatArray] = np.hypot(_WAYS[:, 0], _WAYS[:, 1])
"""How far the tip moves from guard until the sword is drawn, in each technique, shape (4,)."""
WAY_DIRECTIONS: Final[FloatArray] = _WAYS / WAY_LENGTHS_M[:, None]
"""In which direction: away from the opponent and up, shape (4, 2)."""


def time_to_cut(observation: npt.NDArray[np.floating]) -> FloatArray:
    """Return how long the sword of an observation (..., k) still rises [s], shape (...), 0 to `FAR_S`.

    With the share r of the way from guard that the tip has come and its rate r', along the direction of the
    technique that fits best: r = s^2 (3 - 2 s), where s is the share of the time
    (`mecanum_env.tankendo.sword`), so that the rise takes T = 6 s (1 - s) / r' and (1 - s) T is left.
    """
    seen = read_observation(np.asarray(observation, float))
    tip_x, tip_y = seen.tip_x - seen.opponent_x, seen.tip_y - seen.opponent_y
    away = np.hypot(tip_x, tip_y)
    drawn, raised = away - GUARD_TIP_M, seen.tip_height - GUARD_HEIGHT_M
    along = (seen.tip_vx - seen.opponent_vx) * tip_x + (seen.tip_vy - seen.opponent_vy) * tip_y
    drawing = along / np.maximum(away, 1e-6)
    # Sums of two products, since those of a matrix product are rounded otherwise for many than for one.
    ahead, up = WAY_DIRECTIONS.T
    ways = np.multiply.outer(drawn, ahead) + np.multiply.outer(raised, up)
    rates = np.multiply.outer(drawing, ahead) + np.multiply.outer(seen.tip_rising, up)
    technique = np.argmax(ways, axis=-1)[..., None]
    share = np.take_along_axis(ways / WAY_LENGTHS_M, technique, -1)[..., 0]
    rate = np.take_along_axis(rates / WAY_LENGTHS_M, technique, -1)[..., 0]
    elapsed = 0.5 - np.sin(np.arcsin(1.0 - 2.0 * np.clip(share, 0.0, 1.0)) / 3.0)
    rises = (share > LEAST_SHARE) & (rate > LEAST_RATE_PER_S)
    left = 6.0 * elapsed * (1.0 - elapsed) ** 2 / np.where(rises, rate, 1.0)
    still = np.where(share > DRAWN_SHARE, 0.0, FAR_S)
    return np.asarray(np.where(rises, np.clip(left, 0.0, FAR_S), still))


def features(
    observation: npt.NDArray[np.floating], maai_m: float = Rules.maai_m, *, has_time_to_cut: bool = False
) -> FloatArray:
    """Return the features of one or more observations.

    Args:
        observation: of shape (..., k), k >= 20.
        maai_m: striking distance [m].
        has_time_to_cut: whether the time to the cut follows.

    Returns:
        An array of shape (..., k + 1), or (..., k + 2) with the time to the cut.
    """
    whole = np.asarray(observation, float)
    seen = read_observation(whole)
    tip_x, tip_y = seen.tip_x - seen.opponent_x, seen.tip_y - seen.opponent_y
    drawn, raised = np.hypot(tip_x, tip_y) - GUARD_TIP_M, seen.tip_height - GUARD_HEIGHT_M
    own = (
        np.hypot(seen.opponent_x, seen.opponent_y) - maai_m,
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
    parts = [np.stack(own, axis=-1), whole[..., KEPT:]]
    if has_time_to_cut:
        parts.append(time_to_cut(whole)[..., None])
    return np.concatenate(parts, axis=-1)


def stack_features(memory: FloatArray | None, newest: FloatArray, stack: int) -> FloatArray:
    """Return the features of the last `stack` observations, oldest first, shape (..., stack * k).

    `newest` are those of the new observation, shape (..., k), and `memory` is the previous result, or None
    at the start of an episode: then `newest` is repeated.
    """
    if memory is None:
        return np.concatenate([newest] * stack, axis=-1)
    return np.concatenate([memory[..., newest.shape[-1] :], newest], axis=-1)
