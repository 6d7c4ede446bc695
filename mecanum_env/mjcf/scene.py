"""The Tankendo field: 9 x 9 m of mat with lines, light, and cameras."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from mecanum_env.mjcf import shapes
from mecanum_env.model import Robot

FIELD_M = 9.0
"""Side of the square field [m]."""
_LINE_M = 0.05
"""Width of the lines on the mat [m]."""
_SHADOWS: Final = hasattr(mujoco.MjsGeom, "castshadow")
"""Whether lights cast shadows. In MuJoCo 3 the mat casts one, too, which falls on it as dark specks."""


def add_scene(spec: mujoco.MjSpec, *, visuals: bool) -> None:
    """Add the geom "floor", an infinite plane for contacts; with `visuals` it looks like a mat with lines."""
    world = spec.worldbody
    half = FIELD_M / 2
    floor = world.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[half + 0.5, half + 0.5, 0.05],
        contype=0,
        conaffinity=0,
    )
    if not visuals:
        return
    add_appearance(spec)
    floor.material = "mat"
    ground = shapes.add_visual(world, mujoco.mjtGeom.mjGEOM_PLANE, "ground", (0, 0, 0.05), (0, 0, -0.01))
    if _SHADOWS:
        floor.castshadow = ground.castshadow = 0
    edge = half - _LINE_M / 2
    wide, up = _LINE_M / 2, 0.001 / 2  # half the width and height of a line
    edges = ((half, wide, 0, edge), (half, wide, 0, -edge), (wide, half, edge, 0), (wide, half, -edge, 0))
    centre = ((0.15, wide, 0.0, 0.0), (wide, 0.15, 0.0, 0.0))
    starts = ((wide, 0.4, 1.4, 0.0), (wide, 0.4, -1.4, 0.0))
    for half_x, half_y, x, y in (*edges, *centre, *starts):
        shapes.box(world, "line", (half_x, half_y, up), (x, y, up))


def add_appearance(spec: mujoco.MjSpec) -> None:
    """Add materials, sky, picture size, shadow quality and a soft light from all sides."""
    spec.visual.global_.offwidth = 1920
    spec.visual.global_.offheight = 1080
    spec.visual.quality.shadowsize = 4096
    spec.visual.headlight.ambient = [0.38, 0.38, 0.40]
    spec.visual.headlight.diffuse = [0.25, 0.25, 0.25]
    spec.visual.headlight.specular = [0.1, 0.1, 0.1]
    spec.visual.rgba.haze = [0.80, 0.84, 0.90, 1.0]
    spec.visual.map.znear = 0.02
    spec.visual.map.zfar = 60.0
    # Fixed, so that shadows and clipping do not depend on the contents of the scene.
    spec.stat.extent = 1.5
    spec.stat.center = [0.0, 0.0, 0.3]
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.90, 0.93, 0.96],
        rgb2=[0.60, 0.70, 0.82],
        width=256,
        height=1536,
    )
    shapes.add_materials(spec)


def add_views(spec: mujoco.MjSpec, base: mujoco.MjsBody, robot: Robot) -> None:
    """Add the cameras and a light that follows the robot, so that its shadow is sharp anywhere.

    | camera | sees |
    |---|---|
    | `track` | the robot from behind and beside, following it |
    | `close` | the same, near enough to see the rollers |
    | `side` | the robot from the world's -y side, following it |
    | `overview` | the whole field from above one side |
    | `top` | the whole field from straight above |
    """
    s = (robot.half_wheelbase_m + robot.half_track_m) / 0.38
    base.add_light(
        name="key",
        mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACK,
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[0.9, -1.8, 4.0],
        dir=_unit((-0.9, 1.8, -4.0)),
        diffuse=[0.65, 0.64, 0.60],
        specular=[0.3, 0.3, 0.3],
        castshadow=_SHADOWS,
    )
    for name, position, target, fovy in (
        ("track", (1.25 * s, -1.55 * s, 0.90 * s), (0.08 * s, 0.0, 0.23 * s), 36.0),
        ("close", (0.75 * s, -0.85 * s, 0.30 * s), (0.05 * s, -0.05 * s, 0.05 * s), 38.0),
        ("side", (0.0, -2.4 * s, 0.45 * s), (0.05 * s, 0.0, 0.22 * s), 30.0),
    ):
        follows = mujoco.mjtCamLight.mjCAMLIGHT_TRACK
        base.add_camera(name=name, mode=follows, pos=position, quat=_look_at(position, target), fovy=fovy)
    for name, position, target, fovy in (
        ("overview", (-1.5, -8.6, 6.2), (0.0, -0.35, 0.0), 46.0),
        ("top", (0.0, -0.001, 12.0), (0.0, 0.0, 0.0), 46.0),
    ):
        spec.worldbody.add_camera(name=name, pos=position, quat=_look_at(position, target), fovy=fovy)


def add_bench_view(spec: mujoco.MjSpec, radius: float) -> None:
    """Add a light and the camera `track` for a bench whose wheel has this radius [m]."""
    spec.stat.extent = 8 * radius
    spec.worldbody.add_light(
        name="key",
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL,
        pos=[4.0 * radius, -9.0 * radius, 20 * radius],
        dir=_unit((-0.2, 0.45, -1.0)),
        diffuse=[0.65, 0.64, 0.60],
        castshadow=_SHADOWS,
    )
    shapes.add_visual(spec.worldbody, mujoco.mjtGeom.mjGEOM_PLANE, "ground", (0, 0, 0.05))
    position, target = (4.0 * radius, -5.5 * radius, 4.0 * radius), (0.0, 0.7 * radius, 1.5 * radius)
    spec.worldbody.add_camera(name="track", pos=position, quat=_look_at(position, target), fovy=36.0)


def _look_at(position: tuple[float, float, float], target: tuple[float, float, float]) -> list[float]:
    """Return the quaternion of a camera at `position` that looks at `target` with z up."""
    back = np.subtract(position, target)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back)
    right /= np.linalg.norm(right)
    rotation = np.column_stack([right, np.cross(back, right), back])
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, rotation.ravel())
    return [float(x) for x in quaternion]


def _unit(vector: tuple[float, float, float]) -> list[float]:
    length = float(np.linalg.norm(vector))
    return [x / length for x in vector]
