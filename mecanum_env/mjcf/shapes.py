"""Materials, and geoms that are only seen: without contact, and without mass, which bodies have explicitly.

In all functions `body` is the body that the geom belongs to, `material` one of `add_materials`, a position
that of the centre in the body's frame, and lengths are in metres.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import mujoco

_VISUAL_GROUP = 2
"""MuJoCo's geom group of what is only seen."""
_ONLY_SEEN = {"contype": 0, "conaffinity": 0, "group": _VISUAL_GROUP}
_MATERIALS: dict[str, tuple[tuple[float, float, float], float, float, float, float]] = {
    "mat": ((1.0, 1.0, 1.0), 0.2, 0.2, 0.06, 0.0),
    "ground": ((0.50, 0.54, 0.60), 0.0, 0.0, 0.0, 0.0),
    "line": ((0.95, 0.95, 0.93), 0.1, 0.1, 0.0, 0.1),
    "frame": ((0.20, 0.22, 0.25), 0.4, 0.4, 0.0, 0.0),
    "shell": ((0.90, 0.91, 0.92), 0.6, 0.7, 0.05, 0.0),
    "accent": ((0.80, 0.16, 0.13), 0.6, 0.7, 0.05, 0.0),
    "metal": ((0.72, 0.74, 0.77), 0.9, 0.8, 0.1, 0.0),
    "dark_metal": ((0.34, 0.35, 0.38), 0.8, 0.7, 0.05, 0.0),
    "roller": ((0.24, 0.24, 0.26), 0.3, 0.3, 0.0, 0.0),
    "roller_marked": ((0.96, 0.55, 0.10), 0.3, 0.3, 0.0, 0.0),
    "lens": ((0.10, 0.25, 0.40), 1.0, 0.9, 0.2, 0.0),
    "lamp": ((1.00, 0.97, 0.85), 0.5, 0.5, 0.0, 0.8),
    "bamboo": ((0.86, 0.72, 0.42), 0.4, 0.4, 0.0, 0.0),
    "leather": ((0.93, 0.91, 0.85), 0.1, 0.1, 0.0, 0.0),
}
"""Name -> (red, green, blue), specular, shininess, reflectance, emission."""


def add_materials(spec: mujoco.MjSpec) -> None:
    """Add every material to the spec; the mat has a pattern of squares of 1 m."""
    spec.add_texture(
        name="squares",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        rgb1=[0.80, 0.67, 0.49],
        rgb2=[0.76, 0.63, 0.45],
        width=256,
        height=256,
    )
    for name, (rgb, *numbers) in _MATERIALS.items():
        shine = dict(zip(("specular", "shininess", "reflectance", "emission"), numbers, strict=True))
        spec.add_material(name=name, rgba=[*rgb, 1.0], **shine)
    mat = spec.material("mat")
    mat.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "squares"
    mat.texuniform = True
    mat.texrepeat = [1.0, 1.0]


def add_visual(
    body: mujoco.MjsBody,
    kind: mujoco.mjtGeom,
    material: str,
    size: Sequence[float],
    position: Sequence[float] = (0.0, 0.0, 0.0),
    quaternion: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
) -> mujoco.MjsGeom:
    """Add a geom of a kind and material, with its size (half-lengths), position and quaternion."""
    size = [*size, *[0.0] * (3 - len(size))]
    place = {"size": size, "pos": list(position), "quat": list(quaternion)}
    return body.add_geom(type=kind, material=material, **place, **_ONLY_SEEN)


def box(body: mujoco.MjsBody, material: str, size: Sequence[float], position: Sequence[float]) -> None:
    """Add a box of a material, with the half-lengths `size`, at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_BOX, material, size, position)


def ellipsoid(body: mujoco.MjsBody, material: str, size: Sequence[float], position: Sequence[float]) -> None:
    """Add an ellipsoid of a material, with the semi-axes `size`, at a position."""
    add_visual(body, mujoco.mjtGeom.mjGEOM_ELLIPSOID, material, size, position)


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
    z_to_y = (math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0)
    add_visual(body, mujoco.mjtGeom.mjGEOM_CYLINDER, material, [radius, half_width], position, z_to_y)


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
    place = {"size": [radius, 0.0, 0.0], "fromto": [*start, *end]}
    body.add_geom(type=kind, material=material, **place, **_ONLY_SEEN)
