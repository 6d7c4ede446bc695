"""A roller wheel: a hub on a hinge, its rollers on passive hinges, and what both look like."""

from __future__ import annotations

import math

import mujoco

from mecanum_env.mjcf import shapes
from mecanum_env.mjcf.geometry import ROLLER_SIDE, WheelGeometry, roller_angle, roller_pose
from mecanum_env.mjcf.masses import Inertia, Masses

_ROLLER_GROUP = 1
"""MuJoCo's geom group of the rollers, which touch the floor."""
_BOLTS = 5
"""Visible bolts on each side of a hub; one is red, to show the wheel turning."""


def add_wheel(
    parent: mujoco.MjsBody,
    wheel: str,
    position: tuple[float, float, float],
    geometry: WheelGeometry,
    masses: Masses,
    *,
    visuals: bool,
) -> list[str]:
    """Add the wheel fl, fr, rl or rr with its rollers to a parent, at a position in its frame [m].

    Body and joint are called "wheel_fl" .., bodies, joints and geoms of the rollers "wheel_fl_roller_0" ..
    Without `visuals` the hub is invisible, and the rollers have no colour.

    Returns:
        The names of the roller geoms, which touch the floor only through contact pairs.
    """
    name = f"wheel_{wheel}"
    hub = parent.add_body(name=name, pos=position)
    set_inertia(hub, masses.hub)
    hub.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    if visuals:
        _add_hub(hub, geometry)
    b, c = geometry.roller_radius, geometry.roller_half_length
    rollers = []
    for i in range(geometry.rollers):
        roller_name = f"{name}_roller_{i}"
        place, quaternion = roller_pose(geometry, ROLLER_SIDE[wheel], roller_angle(geometry, wheel, i))
        roller = hub.add_body(name=roller_name, pos=place, quat=quaternion)
        set_inertia(roller, masses.roller)
        # The damping is just enough for a roller in the air to come to rest.
        roller.add_joint(name=roller_name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], damping=1e-5)
        geom = roller.add_geom(
            name=roller_name,
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[b, b, c],
            contype=0,
            conaffinity=0,
            group=_ROLLER_GROUP,
        )
        if geometry.barrels:
            geom.userdata = geometry.barrel
        if visuals:
            geom.material = _roller_material(i)
        rollers.append(roller_name)
    return rollers


def set_inertia(
    body: mujoco.MjsBody, inertia: Inertia, position: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> None:
    """Set a body's mass, moments and, at a position [m], its centre of mass, so that its geoms add none."""
    body.explicitinertial = True
    body.mass, body.ipos, body.inertia = inertia.mass, position, inertia.moments


def _add_hub(
    body: mujoco.MjsBody, geometry: WheelGeometry, centre: tuple[float, float, float] = (0, 0, 0)
) -> None:
    """Add core, side plates and bolts of a wheel's hub about a centre in the body's frame [m]."""
    x, y, z = centre
    plate = 0.82 * geometry.half_width
    shapes.disc_y(body, "dark_metal", geometry.roller_circle - geometry.roller_radius, plate, centre)
    for side in (-1, 1):
        face = y + side * plate
        shapes.disc_y(body, "metal", 0.98 * geometry.roller_circle, 0.03 * geometry.radius, (x, face, z))
        shapes.disc_y(body, "dark_metal", 0.30 * geometry.radius, 0.06 * geometry.radius, (x, face, z))
        for i in range(_BOLTS):
            angle = 2 * math.pi * i / _BOLTS
            out = 0.55 * geometry.radius
            place = (x + out * math.sin(angle), face, z + out * math.cos(angle))
            material = "accent" if i == 0 else "dark_metal"
            shapes.disc_y(body, material, 0.075 * geometry.radius, 0.05 * geometry.radius, place)


def _roller_material(index: int) -> str:
    """Return the material of roller `index`; one roller of each wheel is marked, to show it turning."""
    return "roller_marked" if index == 0 else "roller"


def add_still_wheel(
    body: mujoco.MjsBody, wheel: str, geometry: WheelGeometry, centre: tuple[float, float, float]
) -> None:
    """Add the look of the wheel fl, fr, rl or rr as a rigid part of `body`, about a centre [m]."""
    _add_hub(body, geometry, centre)
    b, c = geometry.roller_radius, geometry.roller_half_length
    for i in range(geometry.rollers):
        position, quaternion = roller_pose(geometry, ROLLER_SIDE[wheel], roller_angle(geometry, wheel, i))
        place = [p + q for p, q in zip(position, centre, strict=True)]
        kind = mujoco.mjtGeom.mjGEOM_ELLIPSOID
        shapes.add_visual(body, kind, _roller_material(i), [b, b, c], place, quaternion)


def dress_bench(world: mujoco.MjsBody, wheel: mujoco.MjsBody, geometry: WheelGeometry) -> None:
    """Add the look of the bench: the wheel with its rollers, and the stand with motor and axle."""
    add_still_wheel(wheel, "fl", geometry, (0.0, 0.0, 0.0))
    r, height, side = geometry.radius, 2 * geometry.radius, 1.9 * geometry.radius
    shapes.box(world, "shell", (1.5 * r, 1.6 * r, 0.06 * r), (0.0, 1.0 * r, 0.06 * r))
    shapes.box(world, "frame", (0.45 * r, 0.12 * r, 1.15 * r), (0.0, 1.2 * r, 1.2 * r))
    shapes.disc_y(world, "metal", 0.09 * r, 0.7 * r, (0.0, 0.7 * r, height))
    shapes.disc_y(world, "dark_metal", 0.34 * r, 0.55 * r, (0.0, side, height))
    shapes.disc_y(world, "accent", 0.35 * r, 0.08 * r, (0.0, side + 0.5 * r, height))
