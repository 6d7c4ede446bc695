"""One roller wheel as MuJoCo bodies: a hub on a hinge, and its rollers on passive hinges."""

from __future__ import annotations

import mujoco

from mecanum_env.mjcf import wheel_look
from mecanum_env.mjcf.geometry import ROLLER_SIDE, WheelGeometry, roller_angle, roller_pose
from mecanum_env.mjcf.masses import Inertia, Masses

ROLLER_DAMPING = 1e-5
"""Of a roller's bearing [N m s/rad]; enough that a roller in the air comes to rest."""
ROLLER_GROUP = 1


def add_wheel(
    parent: mujoco.MjsBody,
    wheel: str,
    position: tuple[float, float, float],
    geometry: WheelGeometry,
    masses: Masses,
    *,
    visuals: bool,
) -> list[str]:
    """Add the wheel fl, fr, rl or rr at a position [m] as body and joint "wheel_fl" .. with its rollers.

    Without `visuals` the rollers are all there is to see.

    Returns:
        The names of the roller geoms, for contact pairs with the floor.
    """
    name = f"wheel_{wheel}"
    hub = parent.add_body(name=name, pos=position)
    set_inertia(hub, masses.hub)
    hub.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    if visuals:
        wheel_look.add_hub(hub, geometry)
    b, c = geometry.roller_radius, geometry.roller_half_length
    rollers = []
    for i in range(geometry.rollers):
        roller_name = f"{name}_roller_{i}"
        place, quaternion = roller_pose(geometry, ROLLER_SIDE[wheel], roller_angle(geometry, wheel, i))
        roller = hub.add_body(name=roller_name, pos=place, quat=quaternion)
        set_inertia(roller, masses.roller)
        roller.add_joint(
            name=roller_name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], damping=ROLLER_DAMPING
        )
        geom = roller.add_geom(
            name=roller_name,
            type=mujoco.mjtGeom.mjGEOM_ELLIPSOID,
            size=[b, b, c],
            contype=0,
            conaffinity=0,
            group=ROLLER_GROUP,
        )
        if visuals:
            geom.material = wheel_look.roller_material(i)
        rollers.append(roller_name)
    return rollers


def set_inertia(
    body: mujoco.MjsBody, inertia: Inertia, position: tuple[float, float, float] = (0.0, 0.0, 0.0)
) -> None:
    """Give a body its mass and moments outright, so that what it looks like does not weigh.

    Args:
        body: of the spec.
        inertia: mass and moments, axes along the body's frame.
        position: of the centre of mass in the body's frame [m].
    """
    body.explicitinertial = True
    body.mass = inertia.mass
    body.ipos = position
    body.inertia = inertia.moments
