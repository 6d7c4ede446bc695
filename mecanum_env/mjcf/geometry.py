"""Geometry of a 45-degree Mecanum wheel with a round envelope, and the motion such a wheel gives on average.

A wheel of radius R carries N ellipsoid rollers (semi-axes b, b, c, with c along the roller's axis) whose
centres lie on a circle of radius r, so R = r + b. The roller at the angle phi from the lowest point has the
axis (cos phi, s, -sin phi) / sqrt 2, so the support function of an ellipsoid gives how far it reaches below
the axle:

    reach(phi) = r cos phi + sqrt(b^2 + (c^2 - b^2) sin^2(phi) / 2)

With p = pi / N, half the angle between rollers, two conditions fix r and c:

1. reach(0) = reach(p) = R: as high in the middle of a roller as where the load passes to the next one, so
   c^2 = b^2 + 2 ((R - r cos p)^2 - b^2) / sin^2 p.
2. Neighbouring rollers keep a gap of 1 % of their distance. Their axes, two skew lines, pass each other at
   the distance 2 r sin p / sqrt(1 + cos^2 p), at t = sqrt 2 r sin p cos p / (1 + cos^2 p) from their
   middles, where each roller has the radius b sqrt(1 - t^2 / c^2).

N = 10 and R = 76.2 mm give r = 61.9, b = 14.3, c = 47.0 mm, and a reach that is round to 91 um. The fewer
rollers, the less round: with N = 8 to 0.23 % of R, with N = 4 to 1.7 %, and a robot would have to climb each
of them with 13 % of its weight. Below N = 8 the rollers are therefore barrels with the reach R throughout,
though they look like ellipsoids. At the latitude asin(u) above its equator a barrel reaches, from its middle,

    R - r sqrt(1 - 2 u^2),

since the floor lies at u = sin(phi) / sqrt 2. MuJoCo has no such shape: the plugin's library finds where it
touches the floor (`mecanum_env/plugin/roller_contact.c`); engines without it see the ellipsoids.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from scipy.optimize import brentq

from mecanum_env.kinematics import WHEELS
from mecanum_env.model import Robot
from mecanum_env.units import FloatArray

ROLLER_SIDE = {"fl": -1.0, "fr": 1.0, "rl": 1.0, "rr": -1.0}
"""s in the axis (1, s, 0) / sqrt 2 of the roller on the floor; seen from above, the four axes form an X."""
_ELLIPSOIDS_FROM = 8
"""Fewest rollers on a wheel that are ellipsoids."""
_PHASE_SHARE = {"fl": 0.875, "fr": 0.375, "rl": 0.625, "rr": 0.125}
"""Initial angle of each wheel's first roller, relative to the angle between rollers.

Wheels in phase would pass their loads from roller to roller at the same moments and bounce the body; a
quarter apart, they take turns. The two wheels on a diagonal start as mirror images (+-1/8, +-3/8): when they
stand still during a 45-degree drive, both allow the same direction. Otherwise the robot would turn.
"""


@dataclass(frozen=True)
class WheelGeometry:
    """Lengths of one roller wheel [m]; `wheel_geometry` derives them."""

    radius: float
    """R: radius of the round envelope."""
    rollers: int
    """N: number of rollers."""
    roller_circle: float
    """r: radius of the circle of the rollers' centres."""
    roller_radius: float
    """b: the two short semi-axes of a roller."""
    roller_half_length: float
    """c: the semi-axis along the roller's own axis."""

    def reach(self, phi: FloatArray) -> FloatArray:
        """Return how far [m] the roller at `phi` [rad] from the lowest point reaches below the axle."""
        if self.barrels:
            return np.full(np.shape(phi), self.radius)
        b2, c2 = self.roller_radius**2, self.roller_half_length**2
        return np.asarray(self.roller_circle * np.cos(phi) + np.sqrt(b2 + (c2 - b2) * np.sin(phi) ** 2 / 2))

    @property
    def barrels(self) -> bool:
        """Whether the rollers touch the floor as barrels, since ellipsoids would not be round enough."""
        return self.rollers < _ELLIPSOIDS_FROM

    @property
    def barrel(self) -> tuple[float, float]:
        """What the plugin has as user data of a barrel: r [m], and the largest sine of its latitude."""
        return self.roller_circle, math.sin(math.pi / self.rollers) / math.sqrt(2)

    def contact_radius(self, phi: FloatArray) -> FloatArray:
        """Return the radius [m] at which a roller at `phi` [rad] from the lowest point touches the floor."""
        u = np.sin(phi) / math.sqrt(2)
        if self.barrels:
            cosine, root = np.sqrt(1 - u**2), np.cos(phi)
            slope = 2 * self.roller_circle * u / root * cosine
            return np.asarray((self.radius - self.roller_circle * root) * cosine - slope * u)
        b2, c2 = self.roller_radius**2, self.roller_half_length**2
        return np.asarray(b2 * np.sqrt(1 - u**2) / np.sqrt(b2 + (c2 - b2) * u**2))

    @property
    def half_width(self) -> float:
        """Half the width of the wheel [m]: the rollers' support along the axle."""
        return math.sqrt((self.roller_radius**2 + self.roller_half_length**2) / 2)


@lru_cache(maxsize=64)
def wheel_geometry(radius: float, rollers: int) -> WheelGeometry:
    """Derive the wheel of radius R [m] with N rollers by the two conditions of the module docstring."""
    p = math.pi / rollers

    def roller_half_length(r: float) -> float:
        b = radius - r
        return math.sqrt(b**2 + 2 * ((radius - r * math.cos(p)) ** 2 - b**2) / math.sin(p) ** 2)

    def clearance(r: float) -> float:
        turn = 1 + math.cos(p) ** 2
        half_distance = r * math.sin(p) / math.sqrt(turn)
        t = math.sqrt(2) * r * math.sin(p) * math.cos(p) / turn
        return (1 - 0.01) * half_distance - (radius - r) * math.sqrt(1 - (t / roller_half_length(r)) ** 2)

    r = float(brentq(clearance, 0.4 * radius, 0.999 * radius, xtol=1e-15 * radius))
    return WheelGeometry(radius, rollers, r, radius - r, roller_half_length(r))


def sideways_ratio(rollers: int) -> float:
    """Return sin(pi/N) / (pi/N): mean sideways motion of a 45-degree wheel relative to ideal kinematics.

    The floor stops a wheel from moving along the axis of the roller that touches it. That axis is at 45
    degrees only for a roller in its lowest position; at the angle phi its direction on the floor is
    (cos phi, s), and the mean of cos phi over -pi/N .. pi/N is the ratio.
    """
    return math.sin(math.pi / rollers) / (math.pi / rollers)


def wheel_position(robot: Robot, wheel: str) -> tuple[float, float]:
    """Return x, y [m] of a wheel's centre in the body frame."""
    return _corner(robot.half_wheelbase_m, robot.half_track_m, wheel)


def _corner(x: float, y: float, wheel: str) -> tuple[float, float]:
    return x if wheel[0] == "f" else -x, y if wheel[1] == "l" else -y


def no_slip_rows(robot: Robot) -> FloatArray:
    """Return the matrix (4, 3) from body velocity (vx, vy, yaw rate) to wheel speeds fl, fr, rl, rr [rad/s].

    This matches the planar plant to the rollers: a wheel whose centre moves with (ux, uy) turns at
    (ux + s uy / sideways_ratio) / R. For infinitely many rollers it is the matrix of
    `mecanum_env.kinematics`.
    """
    return _rows(*_dimensions(robot))


def _dimensions(robot: Robot) -> tuple[float, float, float, int]:
    return robot.wheel_radius_m, robot.half_wheelbase_m, robot.half_track_m, robot.rollers_per_wheel


# Robots that are drawn for episodes differ in mass or friction more often than in their dimensions.
@lru_cache(maxsize=64)
def _rows(radius_m: float, half_wheelbase_m: float, half_track_m: float, rollers: int) -> FloatArray:
    """Return what `no_slip_rows` does, read-only."""
    ratio = sideways_ratio(rollers)
    found = []
    for wheel in WHEELS:
        x, y = _corner(half_wheelbase_m, half_track_m, wheel)
        s = ROLLER_SIDE[wheel] / ratio
        # ux = vx - yaw y, uy = vy + yaw x.
        found.append([1.0, s, s * x - y])
    rows = np.array(found) / radius_m
    rows.flags.writeable = False
    return rows


@lru_cache(maxsize=64)
def _squares(radius_m: float, half_wheelbase_m: float, half_track_m: float, rollers: int) -> list[float]:
    """Return the diagonal of G'G, G being the matrix of `no_slip_rows`."""
    rows = _rows(radius_m, half_wheelbase_m, half_track_m, rollers)
    return list(np.diag(rows.T @ rows).tolist())


def wheels_on_body(robot: Robot, per_wheel: float) -> tuple[float, float]:
    """Return what four wheels that never slip add to the body's translation and yaw.

    With wheel speeds w = G (vx, vy, yaw rate), the energy J |w|^2 / 2 of four inertias J, or the power of
    four dampers, has the diagonal matrix J G'G: 4 J / R^2 forward, slightly more sideways (`sideways_ratio`),
    and about 4 J k^2 / R^2 in yaw, k being half_wheelbase + half_track. The planar plant's joints lie along
    the world's axes, so both directions get the mean (they differ by 3.3 % for ten rollers).

    `per_wheel` is the inertia [kg m^2] or damping [N m s/rad] of one wheel.
    """
    forward, sideways, yaw = (per_wheel * square for square in _squares(*_dimensions(robot)))
    return (forward + sideways) / 2, yaw


def roller_angle(geometry: WheelGeometry, wheel: str, index: int) -> float:
    """Return the angle [rad] of roller `index` from the lowest point, at wheel angle 0."""
    return 2 * math.pi / geometry.rollers * (index + _PHASE_SHARE[wheel])


def roller_pose(geometry: WheelGeometry, side: float, phi: float) -> tuple[list[float], list[float]]:
    """Return position [m] and quaternion, in the hub's frame, of the roller at `phi` [rad].

    The roller's axis is its z. `side` is s of the module docstring.
    """
    position = [-geometry.roller_circle * math.sin(phi), 0.0, -geometry.roller_circle * math.cos(phi)]
    turn = np.array([math.cos(phi / 2), 0.0, math.sin(phi / 2), 0.0])
    # z onto (1, side, 0)/sqrt 2: a quarter turn about the horizontal axis (-side, 1, 0)/sqrt 2.
    lay_down = np.array([math.sqrt(0.5), -side / 2, 0.5, 0.0])
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, turn, lay_down)
    return position, [float(x) for x in quaternion]
