"""Where a strike will be aimed at a robot that moves in some way, and by how much it misses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mecanum_env.tankendo import Opponent
from mecanum_env.units import FloatArray

_SHORTEST_M = 0.9  # the opponent strikes no nearer than this


@dataclass(frozen=True)
class Seen:
    """Robots at a time: place x, y [m], yaw [rad], velocity vx, vy [m/s]; arrays of one shape."""

    x: FloatArray
    y: FloatArray
    yaw: FloatArray
    vx: FloatArray
    vy: FloatArray


def miss_margin(
    opponent: Opponent,
    technique: npt.NDArray[np.intp],
    origin: FloatArray,
    seen: Seen,
    landed: Seen,
) -> FloatArray:
    """Return by how much strikes miss [m], negative where they hit, of the shape of the robots' arrays.

    The aim is the robot's target as the opponent saw it, moved on with the velocity seen, within reach.

    Args:
        opponent: reach, lead, sight delay and techniques.
        technique: index of each strike's, an integer array that broadcasts against the robots' arrays.
        origin: where the opponent stood when the strike began: x, y [m].
        seen: the robots when they were last seen, one sight delay before the sword goes forward.
        landed: the robots when the strikes land.
    """
    table = {
        name: np.array([getattr(t, name) for t in opponent.techniques])[technique]
        for name in ("swing_s", "reach_m", "width_m", "depth_m", "blade_m", "target_m")
    }
    ahead_s = opponent.lead * (table["swing_s"] + opponent.sight_delay_s)
    offset = table["target_m"]
    dx = seen.x + offset * np.cos(seen.yaw) + ahead_s * seen.vx - origin[0]
    dy = seen.y + offset * np.sin(seen.yaw) + ahead_s * seen.vy - origin[1]
    wanted = np.maximum(np.hypot(dx, dy), 1e-6)
    reach = np.maximum(table["reach_m"] + opponent.extra_reach_m, _SHORTEST_M)
    length = np.minimum(np.maximum(wanted, _SHORTEST_M), reach)
    along_x, along_y = dx / wanted, dy / wanted
    x = landed.x + offset * np.cos(landed.yaw) - origin[0] - length * along_x
    y = landed.y + offset * np.sin(landed.yaw) - origin[1] - length * along_y
    behind, across = x * along_x + y * along_y, y * along_x - x * along_y
    half_width = (table["width_m"] + opponent.extra_size_m) / 2
    depth = table["depth_m"] + opponent.extra_size_m
    margin: FloatArray = np.maximum(
        np.maximum(np.abs(across) - half_width, behind - depth), -table["blade_m"] - behind
    )
    return margin
