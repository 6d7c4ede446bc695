"""Effects of the body: what it carries and where its weight is."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Parameter, PlantKind, Values

if TYPE_CHECKING:
    import mujoco

    from mecanum_env.model import Model

PAYLOAD_DENSITY_KG_M3: Final = 1000.0
"""A payload is a solid cube of this density; what it adds to the yaw inertia is small beside the robot's."""


def _payload(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    mass = values["mass_kg"]
    side = (mass / PAYLOAD_DENSITY_KG_M3) ** (1 / 3)
    # The base's origin is at axle height.
    cube = spec.body("base").add_body(
        name="payload", pos=[0.0, 0.0, values["height_m"] - model.robot.wheel_radius_m]
    )
    cube.explicitinertial = True
    cube.mass, cube.ipos = mass, [0.0, 0.0, 0.0]
    cube.inertia = [mass * side**2 / 6] * 3


def _com_offset(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    """Move the base, and further than the whole, since wheels and rocker stay where they are."""
    base = spec.body("base")
    lever = model.robot.mass_kg / float(base.mass)
    x, y, z = (float(v) for v in base.ipos)
    base.ipos = [x + lever * values["x_m"], y + lever * values["y_m"], z]


PAYLOAD: Final = Effect(
    name="payload",
    acts_on="body",
    parameters=(
        Parameter("mass_kg", "kg", 0.0, (0.0, 30.0)),
        Parameter("height_m", "m", None, (0.0, 0.6), (0.0, 2.0), default=0.2),
    ),
    summary="A mass in the middle of the base, its centre this high above the floor.",
    signature="Slower to rise and to stop where torque or servo yield; the speed reached is the same.",
    absent_from=("bench",),
    change_spec=_payload,
)

COM_OFFSET: Final = Effect(
    name="com_offset",
    acts_on="body",
    parameters=(
        Parameter("x_m", "m", 0.0, (-0.1, 0.1), (-math.inf, math.inf)),
        Parameter("y_m", "m", 0.0, (-0.1, 0.1), (-math.inf, math.inf)),
    ),
    summary="The whole robot's centre of mass lies off the middle of its wheels.",
    signature="Hard starts and stops turn the robot, one way in starting and the other in stopping.",
    absent_from=("bench",),
    change_spec=_com_offset,
)
