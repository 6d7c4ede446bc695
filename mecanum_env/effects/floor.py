"""Effects of rollers and floor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Parameter, PlantKind, Values
from mecanum_env.model import Model

if TYPE_CHECKING:
    import mujoco


def _rollers(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    for joint in spec.joints:
        if "_roller_" not in joint.name:
            continue
        joint.damping[0] += values["damping_n_m_s_rad"]
        if values["torque_n_m"] > 0.0:
            # MuJoCo's friction is a soft constraint: by default a loaded joint creeps visibly. Two timesteps
            # and an impedance near 1 hold it.
            joint.frictionloss += values["torque_n_m"]
            joint.solref_friction = [2 * spec.option.timestep, 1.0]
            joint.solimp_friction = [0.999, 0.9999, 0.001, 0.5, 2.0]


def _slope(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    """Tilt gravity, so that the floor stays level in the world's coordinates."""
    slope, heading = math.radians(values["slope_deg"]), math.radians(values["heading_deg"])
    g = -float(spec.option.gravity[2])
    along = math.sin(slope)
    spec.option.gravity = [g * along * math.cos(heading), g * along * math.sin(heading), -g * math.cos(slope)]


def _slope_in_turned_axes(values: Values, yaw_rad: float) -> Values:
    return {**values, "heading_deg": values.get("heading_deg", 0.0) - math.degrees(yaw_rad)}


EFFECTS: Final = (
    Effect(
        name="roller_friction",
        station="body",
        acts_on="roller joints",
        parameters=(
            Parameter("torque_n_m", "N m", 0.0, (0.0, 0.2)),
            Parameter("damping_n_m_s_rad", "N m s/rad", 0.0, (0.0, 0.01)),
        ),
        summary="Friction in the rollers' own bearings, constant and in proportion to their speed.",
        signature="Sideways motion loses speed; straight motion, in which rollers hardly turn, does not.",
        direct_check="the force that pushes the robot sideways, with a spring balance",
        realistic=lambda _: {"torque_n_m": 0.02},
        absent_from=("bench",),
        refused_by=("planar",),
        change_spec=_rollers,
    ),
    Effect(
        name="low_grip",
        station="body",
        acts_on="floor contact",
        parameters=(
            Parameter(
                "friction", "1", "robot.friction", (0.02, 1.2), (1e-3, 10.0), scan=(0.05, 0.1, 0.2, 0.3, 0.5)
            ),
        ),
        summary="The floor grips with this coefficient instead of the model's.",
        signature="Wheels spin or slide in hard starts and stops; gentle ones are unchanged.",
        direct_check="the force at which the robot with locked wheels slides, with a spring balance",
        realistic=lambda model: {"friction": 0.5 * model.robot.friction},
        absent_from=("bench",),
        refused_by=("planar",),
        change_model=lambda model, values: replace(
            model, robot=replace(model.robot, friction=values["friction"])
        ),
    ),
    Effect(
        name="floor_slope",
        station="body",
        acts_on="world",
        parameters=(
            Parameter("slope_deg", "deg", 0.0, (0.0, 10.0), (0.0, 45.0)),
            Parameter(
                "heading_deg",
                "deg",
                None,
                (-180.0, 180.0),
                (-math.inf, math.inf),
                scan=(-135, -90, -45, 0, 45, 90, 135, 180),
            ),
        ),
        summary="The floor falls towards this heading in the world.",
        signature="Speed is lost uphill and gained downhill, depending on the heading in the world.",
        direct_check="the floor, with a level",
        realistic=lambda _: {"slope_deg": 2.0},
        absent_from=("bench",),
        turned=_slope_in_turned_axes,
        change_spec=_slope,
    ),
)
