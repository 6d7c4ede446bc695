"""One roller wheel as MuJoCo bodies: a hub on a hinge, and its rollers on passive hinges."""

from __future__ import annotations

import math

import mujoco
import numpy as np

from mecanum_env.kinematics import WHEELS
from mecanum_env.mjcf import look
from mecanum_env.mjcf.geometry import ROLLER_SIDE, WheelGeometry
from mecanum_env.mjcf.masses import Inertia, Masses

ROLLER_DAMPING = 1e-5
"""Of a roller's bearing [N m s/rad]; enough that a roller in the air comes to rest."""

PHASE_SHARE = {"fl": 0.0, "fr": 0.111, "rl": 0.302, "rr": 0.414}
"""Where each wheel starts, in parts of the angle between rollers.

Wheels in step would pass their loads from roller to roller at the same moments and bounce the body together.
"""


def add_wheel(
    parent: mujoco.MjsBody,
    wheel: str,
    name: str,
    position: tuple[float, float, float],
    geometry: WheelGeometry,
    masses: Masses,
) -> list[str]:
    """Add the wheel `wheel` (fl, fr, rl, rr: decides its hand and phase) as body and joint `name`.

    Returns:
        The names of the roller geoms, for contact pairs with the floor.
    """
    if wheel not in WHEELS:
        raise ValueError(f"wheel {wheel!r}, must be one of {WHEELS}")
    side = ROLLER_SIDE[wheel]
    hub = parent.add_body(name=name, pos=position)
    set_inertia(hub, masses.hub)
    hub.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    look.add_hub(hub, geometry)
    rollers = []
    for i in range(geometry.rollers):
        roller_name = f"{name}_roller_{i}"
        position_i, quaternion = roller_pose(geometry, side, roller_angle(geometry, wheel, i))
        roller = hub.add_body(name=roller_name, pos=position_i, quat=quaternion)
        set_inertia(roller, masses.roller)
        roller.add_joint(
            name=roller_name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1], damping=ROLLER_DAMPING
        )
        look.add_roller(roller, roller_name, geometry, i)
        rollers.append(roller_name)
    return rollers


def roller_angle(geometry: WheelGeometry, wheel: str, index: int) -> float:
    """Return the angle [rad] of roller `index` from the lowest point, at wheel angle 0."""
    return 2 * math.pi / geometry.rollers * (index + PHASE_SHARE[wheel])


def roller_pose(geometry: WheelGeometry, side: float, phi: float) -> tuple[list[float], list[float]]:
    """Return position and quaternion, in the hub's frame, of the roller at `phi` [rad]; its axis is its z."""
    position = [-geometry.roller_circle * math.sin(phi), 0.0, -geometry.roller_circle * math.cos(phi)]
    turn = np.array([math.cos(phi / 2), 0.0, math.sin(phi / 2), 0.0])
    # z onto (1, side, 0)/sqrt 2: a quarter turn about the horizontal axis (-side, 1, 0)/sqrt 2.
    half = math.sqrt(0.5)
    lay_down = np.array([half, -side * half * half, half * half, 0.0])
    quaternion = np.empty(4)
    mujoco.mju_mulQuat(quaternion, turn, lay_down)
    return position, [float(x) for x in quaternion]


def set_inertia(
    body: mujoco.MjsBody, inertia: Inertia, position: tuple[float, float, float] = (0, 0, 0)
) -> None:
    """Give a body its mass and moments outright, so that what it looks like does not weigh."""
    body.explicitinertial = True
    body.mass = inertia.mass
    body.ipos = position
    body.inertia = inertia.moments
