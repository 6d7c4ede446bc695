"""What the friction of the rollers' bearings is where wheels never slip: a force against sideways motion.

A wheel whose centre moves sideways with the speed u turns the roller on the floor. While that is at the angle
phi from the lowest point, the floor passes under it with u sqrt(1 + 1 / cos^2 phi), square to its axis, and
touches it where its radius is rho (`WheelGeometry.contact_radius`). So it turns with x u, where
x = sqrt(1 + 1 / cos^2 phi) / rho, and a torque t in its bearing holds the wheel back with the force x t. The
planar plant, whose wheels have no angles, has the means of x and x^2 over a roller's turn.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Final

import numpy as np

from mecanum_env.effects.definition import PlanarBody
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.model import Robot

_ANGLES: Final = 201  # at which the mean is taken
_SLOWEST_M_S: Final = 1e-3
"""Least speed below which constant friction falls [m/s]. Assumed: no log shows it."""
_WHEELS: Final = 4


def sideways_friction(robot: Robot, body: PlanarBody, timestep_s: float) -> tuple[float, float, float, float]:
    """Return what the plugin "mecanum.rollers" has as user data, of a robot whose planar body is `body`.

    For each wheel the constant part [N] and the slope [N s/m] of its friction sideways; half the wheelbase
    [m]; and the speed below which the constant part falls [m/s], so that an explicit step of `timestep_s`
    cannot turn the motion round. All but the dimensions may be arrays.
    """
    once, twice = _turns_per_m(robot.rollers_per_wheel)
    radius, arm = robot.wheel_radius_m, robot.half_wheelbase_m
    rub = once / radius * body.roller_coulomb_n_m
    drag = twice / radius**2 * body.roller_damping_n_m_s_rad
    # Of one newton on each wheel: what it changes of the speed sideways, where the body moves or turns.
    moves = _WHEELS * np.maximum(1.0 / robot.mass_kg, arm**2 / robot.yaw_inertia_kg_m2)
    return rub, drag, arm, np.maximum(_SLOWEST_M_S, timestep_s * rub * moves)


@lru_cache(maxsize=64)
def _turns_per_m(rollers: int) -> tuple[float, float]:
    """Return the means of x and x^2 of the module docstring, of a wheel with a radius of 1 m."""
    phi = np.linspace(-np.pi / rollers, np.pi / rollers, _ANGLES)
    x = np.sqrt(1.0 + 1.0 / np.cos(phi) ** 2) / wheel_geometry(1.0, rollers).contact_radius(phi)
    return float(np.mean(x)), float(np.mean(x**2))
