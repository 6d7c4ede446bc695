"""The Tankendo field: 9 x 9 m of floor with lines, light and cameras."""

from __future__ import annotations

import mujoco

from mecanum_env.model import Robot

FIELD_M = 9.0
LINE_M = 0.05


def add_scene(spec: mujoco.MjSpec, robot: Robot, *, visuals: bool) -> None:
    """Add geom "floor", the field's lines, lights and cameras, and the size of offscreen pictures."""
    spec.visual.global_.offwidth = 1920
    spec.visual.global_.offheight = 1080
    spec.worldbody.add_geom(
        name="floor",
        type=mujoco.mjtGeom.mjGEOM_PLANE,
        size=[0, 0, 0.05],
        contype=0,
        conaffinity=0,
    )
