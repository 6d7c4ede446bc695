"""What the robot looks like: geoms without mass or contact (the rollers aside)."""

from __future__ import annotations

import mujoco

from mecanum_env.mjcf.geometry import WheelGeometry
from mecanum_env.model import Robot


def add_hub(hub: mujoco.MjsBody, geometry: WheelGeometry) -> None:
    """Add the hub."""


def add_roller(roller: mujoco.MjsBody, name: str, geometry: WheelGeometry, index: int) -> None:
    """Add the roller's geom `name`: the ellipsoid that touches the floor."""
    b, c = geometry.roller_radius, geometry.roller_half_length
    roller.add_geom(
        name=name, type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=[b, b, c], contype=0, conaffinity=0, group=1
    )


def dress_robot(base: mujoco.MjsBody, rocker: mujoco.MjsBody, robot: Robot, geometry: WheelGeometry) -> None:
    pass


def add_still_wheels(base: mujoco.MjsBody, robot: Robot, geometry: WheelGeometry) -> None:
    pass


def dress_bench(spec: mujoco.MjSpec, wheel: mujoco.MjsBody, geometry: WheelGeometry) -> None:
    pass
