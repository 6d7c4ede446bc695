"""Where the robot's mass and inertia sit, so that the compiled model has exactly the model file's totals."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mecanum_env.errors import InputError
from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf.geometry import WheelGeometry, wheel_geometry, wheel_position
from mecanum_env.model import Robot

# Shares of the whole mass; ours, like the mass itself. At 20 kg: hubs of 0.4 kg, and rollers of 40 g, which
# is what rubber of density 1 g/cm^3 weighs in their volume.
HUB_SHARE = 0.02
ROLLERS_SHARE = 0.02
ROCKER_SHARE = 0.025

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Inertia:
    """Mass [kg] and principal moments [kg m^2] about the centre of mass, axes along the body's frame."""

    mass: float
    moments: Vector


@dataclass(frozen=True)
class Masses:
    """Inertias of every kind of body of the robot."""

    hub: Inertia
    """Axis of the wheel along y."""
    roller: Inertia
    """Axis of the roller along z."""
    rocker: Inertia
    base: Inertia

    def wheel_spin_inertia(self, geometry: WheelGeometry) -> float:
        """Return the moment [kg m^2] of hub and rollers about the axle, with the rollers not spinning."""
        return self.hub.moments[1] + geometry.rollers * self._roller_about_axle(geometry)

    def _roller_about_axle(self, geometry: WheelGeometry) -> float:
        # The roller's axis is at 45 degrees to the axle.
        across, _, along = self.roller.moments
        return self.roller.mass * geometry.roller_circle**2 + (across + along) / 2


def robot_masses(robot: Robot) -> Masses:
    """Share out the robot's mass and yaw inertia.

    The base takes what the wheels and the rocker leave.

    Raises:
        InputError: the yaw inertia is less than that of the wheels where they are.
    """
    geometry = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel)
    total = robot.mass_kg
    hub = _cylinder_y(HUB_SHARE * total, geometry.roller_circle, 0.6 * geometry.half_width)
    roller = _ellipsoid(
        ROLLERS_SHARE * total / geometry.rollers, geometry.roller_radius, geometry.roller_half_length
    )
    rocker = _box(
        ROCKER_SHARE * total, 0.3 * robot.wheel_radius_m, robot.half_track_m, 0.3 * robot.wheel_radius_m
    )
    masses = Masses(hub, roller, rocker, Inertia(0.0, (0.0, 0.0, 0.0)))
    others = rocker.moments[2] + rocker.mass * robot.half_wheelbase_m**2
    for wheel in WHEELS:
        distance2 = sum(v**2 for v in wheel_position(robot, wheel))
        others += (hub.mass + geometry.rollers * roller.mass) * distance2
        others += _wheel_yaw(masses, geometry)
    left = robot.yaw_inertia_kg_m2 - others
    # The base sits behind the robot's centre by what balances the rocker, hence its own distance counts.
    mass = total * (1 - ROCKER_SHARE - 4 * (HUB_SHARE + ROLLERS_SHARE))
    left -= mass * base_offset(robot) ** 2
    if left <= 0.0:
        raise InputError(
            f"robot.yaw_inertia_kg_m2 = {robot.yaw_inertia_kg_m2:g} is less than the wheels alone have at "
            f"their places, {robot.yaw_inertia_kg_m2 - left:.4g}; a solid plate of the robot's size has "
            f"{robot.plate_yaw_inertia_kg_m2:.4g}"
        )
    # A plate of the robot's proportions, scaled to the moment that is left, and somewhat thick.
    a, b = robot.half_wheelbase_m, robot.half_track_m
    unit = left / (a**2 + b**2)
    tilt = unit * (robot.wheel_radius_m * 1.2) ** 2
    base = Inertia(mass, (unit * b**2 + tilt, unit * a**2 + tilt, left))
    return Masses(hub, roller, rocker, base)


def base_offset(robot: Robot) -> float:
    """Return x [m] of the base's centre of mass: behind the centre by what balances the front rocker."""
    base_share = 1 - ROCKER_SHARE - 4 * (HUB_SHARE + ROLLERS_SHARE)
    return -ROCKER_SHARE / base_share * robot.half_wheelbase_m


def _wheel_yaw(masses: Masses, geometry: WheelGeometry) -> float:
    """Moment [kg m^2] of hub and rollers about the vertical through the wheel's centre."""
    across, _, along = masses.roller.moments
    roller = masses.roller
    total = masses.hub.moments[2]
    for i in range(geometry.rollers):
        phi = 2 * math.pi * i / geometry.rollers
        # Parallel axis: the roller's centre is r sin phi off the vertical; its own axis has the vertical
        # part sin phi / sqrt 2. The sum over three or more even angles does not depend on the phase.
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
    """Half-sizes a, b, c."""
    return Inertia(mass, (mass * (b**2 + c**2) / 3, mass * (a**2 + c**2) / 3, mass * (a**2 + b**2) / 3))
