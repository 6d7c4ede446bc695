"""Effects of rollers, floor and body: what it carries, and dimensions that differ from the model's."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from mecanum_env.effects.definition import Effect, Load, Parameter, PlanarBody, PlantKind, Values
from mecanum_env.model import Model

if TYPE_CHECKING:
    import mujoco

_WEIGHT: Final = "the load under each wheel, on a scale"
_ANY: Final = (-math.inf, math.inf)
_FACTOR: Final = (0.1, 10.0)


def _payload(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    mass = values["mass_kg"]
    # The base's origin is at axle height.
    cube = spec.body("base").add_body(
        name="payload", pos=[0.0, 0.0, values["height_m"] - model.robot.wheel_radius_m]
    )
    cube.explicitinertial = True
    cube.mass, cube.ipos = mass, [0.0, 0.0, 0.0]
    cube.inertia = [_cube_inertia(mass)] * 3


def _cube_inertia(mass: float) -> float:
    """Return the moment [kg m^2] of a solid cube of 1000 kg/m^3, which is small beside the robot's."""
    side: float = (mass / 1000.0) ** (1 / 3)
    return mass * side**2 / 6


def _planar_payload(body: PlanarBody, values: Values) -> PlanarBody:
    mass = values["mass_kg"]
    return replace(
        body,
        middle_mass_kg=body.middle_mass_kg + mass,
        middle_yaw_inertia_kg_m2=body.middle_yaw_inertia_kg_m2 + _cube_inertia(mass),
    )


def _com_offset(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    """Move the base's centre of mass further than asked for, since wheels and rocker stay where they are."""
    base = spec.body("base")
    lever = model.robot.mass_kg / float(base.mass)
    x, y, z = (float(v) for v in base.ipos)
    base.ipos = [x + lever * values["x_m"], y + lever * values["y_m"], z]


def _radius(model: Model, values: Values) -> Model:
    robot = model.robot
    return replace(model, robot=replace(robot, wheel_radius_m=robot.wheel_radius_m * values["scale"]))


def _track(model: Model, values: Values) -> Model:
    """Scale both lengths alike: only their sum counts for the motion.

    The yaw inertia goes with their square, as that of the same masses further out does. With its old value a
    light robot, whose wheels have most of it, could not carry them any further out at all.
    """
    robot, scale = model.robot, values["scale"]
    wider = replace(
        robot,
        half_wheelbase_m=robot.half_wheelbase_m * scale,
        half_track_m=robot.half_track_m * scale,
        yaw_inertia_kg_m2=robot.yaw_inertia_kg_m2 * scale**2,
    )
    return replace(model, robot=wider)


def _rollers(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    """Brake the rollers' joints, which the planar plant has not: there it is `_planar_rollers`."""
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


def _planar_rollers(body: PlanarBody, values: Values) -> PlanarBody:
    return replace(
        body,
        roller_coulomb_n_m=body.roller_coulomb_n_m + values["torque_n_m"],
        roller_damping_n_m_s_rad=body.roller_damping_n_m_s_rad + values["damping_n_m_s_rad"],
    )


def _slope(spec: mujoco.MjSpec, values: Values, model: Model, plant: PlantKind) -> None:
    """Tilt gravity, so that the floor stays level in the world's coordinates."""
    spec.option.gravity = _tilted(-float(spec.option.gravity[2]), values)


def _tilted(g: float, values: Values) -> tuple[float, float, float]:
    slope, heading = math.radians(values["slope_deg"]), math.radians(values["heading_deg"])
    along = g * math.sin(slope)
    return along * math.cos(heading), along * math.sin(heading), -g * math.cos(slope)


def _planar_slope(body: PlanarBody, values: Values) -> PlanarBody:
    return replace(body, gravity_m_s2=_tilted(-body.gravity_m_s2[2], values))


def _slope_in_turned_axes(values: Values, yaw_rad: float) -> Values:
    return {**values, "heading_deg": values.get("heading_deg", 0.0) - math.degrees(yaw_rad)}


EFFECTS: Final = (
    Effect(
        name="roller_friction",
        station="body",
        acts_on="roller joints",
        parameters=(
            Parameter("torque_n_m", "N m", 0.0, (0.0, 0.13), relative=True),
            Parameter("damping_n_m_s_rad", "N m s/rad", 0.0, (0.0, 0.1), relative=True),
        ),
        summary="Friction in the rollers' own bearings, constant and in proportion to their speed.",
        signature="Sideways motion loses speed; straight motion, in which rollers hardly turn, does not.",
        direct_check="the force that pushes the robot sideways, with a spring balance",
        realistic=lambda _: {"torque_n_m": 0.02},
        absent_from=("bench",),
        change_spec=_rollers,
        change_planar=_planar_rollers,
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
            Parameter("heading_deg", "deg", None, (-180.0, 180.0), _ANY),
        ),
        vector=("slope_deg", "heading_deg"),
        summary="The floor falls towards this heading in the world.",
        signature="Speed is lost uphill and gained downhill, depending on the heading in the world.",
        direct_check="the floor, with a level",
        realistic=lambda _: {"slope_deg": 2.0},
        absent_from=("bench",),
        turned=_slope_in_turned_axes,
        change_spec=_slope,
        change_planar=_planar_slope,
    ),
    Effect(
        name="payload",
        station="body",
        acts_on="body",
        parameters=(
            Parameter("mass_kg", "kg", 0.0, (0.0, 30.0)),
            Parameter("height_m", "m", None, (0.0, 0.6), (0.0, 2.0), default=0.2),
        ),
        summary="A mass in the middle of the base, with its centre at this height above the floor.",
        signature="Slower starts and stops if torque or servo yield; the speed reached is unchanged.",
        direct_check=_WEIGHT,
        realistic=lambda model: {"mass_kg": 0.25 * model.robot.mass_kg},
        absent_from=("bench",),
        load=lambda values: Load(mass_kg=values["mass_kg"]),
        change_spec=_payload,
        change_planar=_planar_payload,
    ),
    Effect(
        name="com_offset",
        station="body",
        acts_on="body",
        parameters=(
            Parameter("x_m", "m", 0.0, (-0.1, 0.1), _ANY),
            Parameter("y_m", "m", 0.0, (-0.1, 0.1), _ANY),
        ),
        summary="The robot's centre of mass lies off the middle of its wheels.",
        signature="Hard starts and stops turn the robot, in opposite directions.",
        direct_check=_WEIGHT,
        realistic=lambda _: {"x_m": 0.03, "y_m": 0.03},
        absent_from=("bench",),
        understated_by=("planar",),
        change_spec=_com_offset,
        # All of the planar plant's mass is its base's.
        change_planar=lambda body, values: replace(
            body, com_x_m=body.com_x_m + values["x_m"], com_y_m=body.com_y_m + values["y_m"]
        ),
    ),
    Effect(
        name="wheel_radius",
        station="body",
        acts_on="geometry",
        exact=True,
        parameters=(Parameter("scale", "1", 1.0, (0.8, 1.2), _FACTOR),),
        summary="The wheels are larger than the model says by this factor.",
        signature="Body velocity is off in proportion in every direction and in rotation; "
        "wheel speeds are not.",
        direct_check="how far a wheel rolls in ten turns, with a tape",
        realistic=lambda _: {"scale": 0.97},
        absent_from=("bench",),
        undone_by="command",
        change_model=_radius,
    ),
    Effect(
        name="track_width",
        station="body",
        acts_on="geometry",
        exact=True,
        parameters=(Parameter("scale", "1", 1.0, (0.7, 1.4), _FACTOR),),
        summary="half_wheelbase + half_track is larger than the model says by this factor.",
        signature="Only rotation is off, by 1 / scale.",
        direct_check="wheelbase and track, with a tape",
        realistic=lambda _: {"scale": 1.1},
        absent_from=("bench",),
        undone_by="command",
        change_model=_track,
    ),
)
