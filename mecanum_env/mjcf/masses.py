"""How the robot's mass and yaw inertia are distributed over its bodies; the totals are the model file's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.geometry import WheelGeometry, wheel_geometry, wheel_position
from mecanum_env.model import Robot

_HUB_SHARE = 0.02
"""Mass of one hub over that of the robot: 0.4 kg of 20 kg. The shares are estimates, like the mass."""
_ROLLERS_SHARE = 0.02
"""Mass of the rollers of one wheel over that of the robot: 40 g each at 20 kg, as rubber of 1 g/cm^3 has."""
_ROCKER_SHARE = 0.025
"""Mass of the front rocker over that of the robot."""

_LARGE = 1e3  # a yaw inertia that a robot of 1 kg may have [kg m^2]
_MARGIN = 1e-9  # above the rounding of the sum of all inertias


class Inertia(NamedTuple):
    """Mass [kg] and principal moments [kg m^2] about the centre of mass, axes along the body's frame."""

    mass: float
    moments: tuple[float, float, float]


@dataclass(frozen=True)
class Masses:
    """Inertia of each kind of body of the robot."""

    hub: Inertia
    """Wheel axis along y."""
    roller: Inertia
    """Roller axis along z."""
    rocker: Inertia
    base: Inertia

    def wheel_spin_inertia(self, geometry: WheelGeometry) -> float:
        """Return the moment [kg m^2] of hub and rollers about the axle, with the rollers not spinning."""
        return _spin_inertia(self.hub, self.roller, geometry)


def robot_masses(robot: Robot) -> Masses:
    """Distribute the robot's mass and yaw inertia; the base gets what wheels and rocker leave.

    Raises:
        InputError: the yaw inertia is less than that of wheels and rocker at their places.
    """
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    total = robot.mass_kg
    hub, roller = _wheel_masses(total, geometry)
    thickness = 0.3 * robot.wheel_radius_m
    rocker = _box(_ROCKER_SHARE * total, thickness, robot.half_track_m, thickness)
    masses = Masses(hub, roller, rocker, Inertia(0.0, (0.0, 0.0, 0.0)))
    others = rocker.moments[2] + rocker.mass * robot.half_wheelbase_m**2
    wheel_yaw = _wheel_yaw(masses, geometry)
    for wheel in WHEELS:
        distance2 = sum(v**2 for v in wheel_position(robot, wheel))
        others += (hub.mass + geometry.rollers * roller.mass) * distance2
        others += wheel_yaw
    left = robot.yaw_inertia_kg_m2 - others
    # The base's centre of mass is behind the robot's centre, where it balances the rocker.
    mass = total * (1 - _ROCKER_SHARE - 4 * (_HUB_SHARE + _ROLLERS_SHARE))
    left -= mass * base_offset(robot) ** 2
    if left <= 0.0:
        raise InputError(
            f"robot.yaw_inertia_kg_m2 = {robot.yaw_inertia_kg_m2:g} is less than the wheels alone have at "
            f"their places, {robot.yaw_inertia_kg_m2 - left:.4g}; a solid plate of the robot's size has "
            f"{robot.plate_yaw_inertia_kg_m2:.4g}"
        )
    # The base is a thick plate of the robot's proportions, scaled to the remaining moment.
    a, b = robot.half_wheelbase_m, robot.half_track_m
    unit = left / (a**2 + b**2)
    tilt = unit * (robot.wheel_radius_m * 1.2) ** 2
    base = Inertia(mass, (unit * b**2 + tilt, unit * a**2 + tilt, left))
    return Masses(hub, roller, rocker, base)


def surely_possible(robot: Robot) -> Any:
    """Return whether the yaw inertia is clearly above that of wheels and rocker, as `robot_masses` asks.

    It takes a fraction of the time. Mass and yaw inertia may be arrays (m,), those of many robots.
    """
    least_m2 = _least_yaw_m2(
        robot.wheel_radius_m, robot.half_wheelbase_m, robot.half_track_m, robot.rollers_per_wheel
    )
    return robot.yaw_inertia_kg_m2 > (1.0 + _MARGIN) * least_m2 * robot.mass_kg


@lru_cache(maxsize=64)
def _least_yaw_m2(radius_m: float, half_wheelbase_m: float, half_track_m: float, rollers: int) -> float:
    """Return the yaw inertia of all but the base, at its place, over the robot's mass."""
    robot = Robot(radius_m, half_wheelbase_m, half_track_m, 1.0, _LARGE, rollers)
    return _LARGE - robot_masses(robot).base.moments[2]


def spin_inertia(mass_kg: float, geometry: WheelGeometry) -> float:
    """Return the `wheel_spin_inertia` of a robot of this mass, or of many of masses (m,)."""
    return _spin_inertia(*_wheel_masses(mass_kg, geometry), geometry)


def _wheel_masses(mass_kg: float, geometry: WheelGeometry) -> tuple[Inertia, Inertia]:
    """Return hub and roller of a robot of this mass."""
    hub = _cylinder_y(_HUB_SHARE * mass_kg, geometry.roller_circle, 0.6 * geometry.half_width)
    roller = _ROLLERS_SHARE * mass_kg / geometry.rollers
    return hub, _ellipsoid(roller, geometry.roller_radius, geometry.roller_half_length)


def _spin_inertia(hub: Inertia, roller: Inertia, geometry: WheelGeometry) -> float:
    # The roller's axis is at 45 degrees to the axle.
    across, _, along = roller.moments
    about_axle = roller.mass * geometry.roller_circle**2 + (across + along) / 2
    return hub.moments[1] + geometry.rollers * about_axle


def base_offset(robot: Robot) -> float:
    """Return x [m] of the base's centre of mass, behind the robot's centre, where it balances the rocker."""
    base_share = 1 - _ROCKER_SHARE - 4 * (_HUB_SHARE + _ROLLERS_SHARE)
    return -_ROCKER_SHARE / base_share * robot.half_wheelbase_m


def _wheel_yaw(masses: Masses, geometry: WheelGeometry) -> float:
    """Return the moment [kg m^2] of hub and rollers about the vertical through the wheel's centre."""
    across, _, along = masses.roller.moments
    roller = masses.roller
    total = masses.hub.moments[2]
    for i in range(geometry.rollers):
        phi = 2 * math.pi * i / geometry.rollers
        # Parallel axis theorem: the roller's centre is r sin phi off the vertical, and its axis has the
        # vertical component sin phi / sqrt 2. The sum over three or more even angles is independent of phase.
        vertical2 = math.sin(phi) ** 2 / 2
        total += roller.mass * (geometry.roller_circle * math.sin(phi)) ** 2
        total += across * (1 - vertical2) + along * vertical2
    return total


def _cylinder_y(mass: float, radius: float, half_width: float) -> Inertia:
    across = mass * (3 * radius**2 + (2 * half_width) ** 2) / 12
    return Inertia(mass, (across, mass * radius**2 / 2, across))


def _ellipsoid(mass: float, b: float, c: float) -> Inertia:
    across = mass * (b**2 + c**2) / 5
    return Inertia(mass, (across, across, mass * 2 * b**2 / 5))


def _box(mass: float, a: float, b: float, c: float) -> Inertia:
    """Return the inertia of a box with the half-sizes a, b, c."""
    return Inertia(mass, (mass * (b**2 + c**2) / 3, mass * (a**2 + c**2) / 3, mass * (a**2 + b**2) / 3))
