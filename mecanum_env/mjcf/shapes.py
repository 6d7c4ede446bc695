"""Geoms that are only seen: no mass (the bodies have theirs outright), no contact.

Everywhere: `body` is the body they belong to, `material` a name of `mecanum_env.mjcf.materials`, positions
are of centres in the body's frame, and lengths in metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco

VISUAL_GROUP = 2
_LIE_ALONG_Y = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)


def add_visual(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    material: str,
    size: Sequence[float],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsGeom:
    """Add a geom of a kind, material, size (half-lengths, as MuJoCo has them), position and quaternion."""
    return body.add_geom(
        type=kind,
        material=material,
        size=[*size, *[0.0] * (3 - len(size))],
        pos=list(position),
        quat=list(quaternion),
        contype=0,
        conaffinity=0,
        group=VISUAL_GROUP,
    )


def box(body: mujoco.MjsBody, material: str, size: Sequence[float], position: Sequence[float]) -> None:
    """Add a box of a material, with the half-lengths `size`, at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_BOX, material, size, position)


def ball(body: mujoco.MjsBody, material: str, radius: float, position: Sequence[float]) -> None:
    """Add a sphere of a material and radius at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_SPHERE, material, [radius], position)


def disc_z(
    body: mujoco.MjsBody, material: str, radius: float, half_height: float, position: Sequence[float]
) -> None:
    """Add an upright cylinder of a material, radius and half-height at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_CYLINDER, material, [radius, half_height], position)


def disc_y(
    body: mujoco.MjsBody, material: str, radius: float, half_width: float, position: Sequence[float]
) -> None:
    """Add a cylinder along y, as wheels lie, of a material, radius and half-width at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_CYLINDER, material, [radius, half_width], position, _LIE_ALONG_Y)


def rod(
    body: mujoco.MjsBody,
    material: str,
    radius: float,
    start: Sequence[float],
    end: Sequence[float],
    *,
    rounded: bool = True,
) -> None:
    """Add a rod of a material and radius from start to end; its ends are rounded or flat."""
    kind = mujoco.mjtGeom.mjGEOM_CAPSULE if rounded else mujoco.mjtGeom.mjGEOM_CYLINDER
    body.add_geom(
        type=kind,
        material=material,
        size=[radius, 0.0, 0.0],
        fromto=[*start, *end],
        contype=0,
        conaffinity=0,
        group=VISUAL_GROUP,
    )
