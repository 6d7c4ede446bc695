"""What the robot looks like above its wheels: frame, deck, torso with a head, and two arms with a sword.

Everything scales with the robot's dimensions except the sword, whose length the sport fixes at 53 cm.
"""

from __future__ import annotations

import math

import mujoco

from mecanum_env.mjcf import shapes
from mecanum_env.mjcf.geometry import WheelGeometry
from mecanum_env.model import Robot

SWORD_M = 0.53
"""Length of the sword [m]."""
_SWORD_RISE_RAD = math.radians(32)
"""Angle of the sword above the horizontal [rad]."""


def dress_robot(base: mujoco.MjsBody, rocker: mujoco.MjsBody, robot: Robot, geometry: WheelGeometry) -> None:
    """Add the visible parts of a robot to its base and, for the front axle, its rocker.

    The planar plant has no rocker and passes its base for both. `geometry` is that of the wheels.
    """
    r, a = geometry.radius, robot.half_wheelbase_m
    inside = robot.half_track_m - geometry.half_width - 0.12 * r
    front = a + 0.75 * r
    deck = 1.15 * r
    _frame(base, rocker, robot, inside, front, r)
    shapes.box(base, "shell", (front, inside + 0.05 * r, 0.06 * r), (0, 0, deck))
    _deck(base, inside, front, deck, r)
    _torso(base, deck, robot)


def _frame(
    base: mujoco.MjsBody, rocker: mujoco.MjsBody, robot: Robot, inside: float, front: float, r: float
) -> None:
    """Add tub, bumpers, motors and axles."""
    a, b = robot.half_wheelbase_m, robot.half_track_m
    shapes.box(base, "frame", (front, inside, 0.42 * r), (0, 0, 0.10 * r))
    shapes.box(base, "accent", (front + 0.03 * r, inside + 0.02 * r, 0.07 * r), (0, 0, 0.30 * r))
    shapes.box(base, "dark_metal", (0.9 * front, 0.92 * inside, 0.20 * r), (0, 0, 0.85 * r))
    shapes.box(base, "dark_metal", (0.10 * r, 1.05 * inside, 0.16 * r), (front + 0.12 * r, 0, -0.05 * r))
    shapes.box(base, "dark_metal", (0.10 * r, 1.05 * inside, 0.16 * r), (-front - 0.12 * r, 0, -0.05 * r))
    # The rocker's origin is on the front axle, that of the planar plant's base in the middle.
    x_front = a if rocker is base else 0.0
    for body, x in ((rocker, x_front), (base, -a)):
        shapes.disc_y(body, "metal", 0.10 * r, b, (x, 0, 0))
        for side in (-1, 1):
            shapes.disc_y(body, "dark_metal", 0.30 * r, 0.10 * r, (x, side * (inside + 0.05 * r), 0))


def _deck(base: mujoco.MjsBody, inside: float, front: float, deck: float, r: float) -> None:
    """Add lamps at the front, a lidar, a stop button and the housing of the electronics."""
    for side in (-1, 1):
        place = (front + 0.03 * r, side * 0.62 * inside, 0.55 * r)
        shapes.ellipsoid(base, "lamp", (0.05 * r, 0.22 * r, 0.13 * r), place)
    shapes.box(base, "frame", (0.02 * r, 0.35 * inside, 0.10 * r), (front + 0.02 * r, 0, 0.55 * r))
    shapes.box(base, "accent", (0.30 * front, 0.72 * inside, 0.22 * r), (-0.55 * front, 0, deck + 0.28 * r))
    shapes.disc_z(base, "frame", 0.42 * r, 0.10 * r, (0.68 * front, 0, deck + 0.16 * r))
    shapes.disc_z(base, "lens", 0.40 * r, 0.14 * r, (0.68 * front, 0, deck + 0.38 * r))
    shapes.disc_z(base, "frame", 0.42 * r, 0.05 * r, (0.68 * front, 0, deck + 0.56 * r))
    stop = deck + 0.50 * r
    shapes.disc_z(base, "bamboo", 0.20 * r, 0.06 * r, (-0.72 * front, 0.35 * inside, stop + 0.04 * r))
    shapes.disc_z(base, "accent", 0.13 * r, 0.14 * r, (-0.72 * front, 0.35 * inside, stop + 0.10 * r))


def _torso(base: mujoco.MjsBody, deck: float, robot: Robot) -> None:
    """Add column, shoulders, head, and two arms that hold the sword in front of the body."""
    s = (robot.half_wheelbase_m + robot.half_track_m) / 0.38
    x = 0.02 * s
    shoulder, half_shoulder = deck + 0.36 * s, 0.105 * s
    shapes.disc_z(base, "dark_metal", 0.070 * s, 0.012 * s, (x, 0, deck + 0.016 * s))
    shapes.disc_z(base, "metal", 0.034 * s, 0.10 * s, (x, 0, deck + 0.11 * s))
    shapes.ellipsoid(base, "shell", (0.062 * s, 0.092 * s, 0.115 * s), (x, 0, deck + 0.29 * s))
    shapes.ellipsoid(base, "accent", (0.066 * s, 0.075 * s, 0.050 * s), (x, 0, deck + 0.24 * s))
    shapes.rod(base, "dark_metal", 0.022 * s, (x, -half_shoulder, shoulder), (x, half_shoulder, shoulder))
    head = shoulder + 0.125 * s
    shapes.disc_z(base, "dark_metal", 0.022 * s, 0.03 * s, (x, 0, shoulder + 0.05 * s))
    shapes.ellipsoid(base, "shell", (0.062 * s, 0.056 * s, 0.066 * s), (x, 0, head))
    visor = (x + 0.042 * s, 0, head + 0.008 * s)
    shapes.ellipsoid(base, "lens", (0.028 * s, 0.046 * s, 0.026 * s), visor)
    along = (math.cos(_SWORD_RISE_RAD), 0.0, math.sin(_SWORD_RISE_RAD))
    grip = (x + 0.21 * s, 0.0, shoulder - 0.12 * s)
    _sword(base, grip, along)
    for side, back in ((-1, 0.10), (1, 0.02)):
        hand = tuple(g + back * d for g, d in zip(grip, along, strict=True))
        elbow = (x + 0.07 * s, side * 0.15 * s, shoulder - 0.15 * s)
        top = (x, side * (half_shoulder + 0.012 * s), shoulder)
        shapes.ball(base, "accent", 0.038 * s, top)
        shapes.rod(base, "shell", 0.024 * s, top, elbow)
        shapes.ball(base, "dark_metal", 0.027 * s, elbow)
        shapes.rod(base, "shell", 0.020 * s, elbow, hand)
        shapes.ball(base, "dark_metal", 0.026 * s, hand)


def _sword(
    base: mujoco.MjsBody, pommel: tuple[float, float, float], along: tuple[float, float, float]
) -> None:
    """Add the 53 cm bamboo sword from its pommel: grip, guard, blade in two strengths, leather tip."""

    def at(distance: float) -> tuple[float, float, float]:
        x, y, z = (p + distance * d for p, d in zip(pommel, along, strict=True))
        return x, y, z

    shapes.rod(base, "leather", 0.0130, at(0.013), at(0.14))
    shapes.rod(base, "leather", 0.0300, at(0.145), at(0.150), rounded=False)
    shapes.rod(base, "bamboo", 0.0120, at(0.150), at(0.36))
    shapes.rod(base, "leather", 0.0128, at(0.36), at(0.368), rounded=False)
    shapes.rod(base, "bamboo", 0.0108, at(0.36), at(0.50))
    shapes.rod(base, "leather", 0.0115, at(0.48), at(SWORD_M - 0.0115))
