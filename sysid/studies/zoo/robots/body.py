"""The rigid body of a robot and its loads: masses, wheel places and weight transfer as numbers.

`Plant` holds what `contact.py` and `engine.py` need of a `Robot`, in SI units and wheel order fl, fr, rl, rr.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray
from sysid.studies.zoo.robots.robot import Robot

GRAVITY_M_S2: Final = 9.81
REST_M_S: Final = 0.004
"""Surface speed within which a Coulomb resistance of rollers and tyres passes from one sign to the other."""


class Plant(NamedTuple):
    """Everything but the drives: body, wheels, floor."""

    mass_kg: float
    inertia_kg_m2: float
    """About the vertical axis through the centre of mass, payload included."""
    com_m: FloatArray
    """Centre of mass (x, y) from the middle of the four wheels, shape (2,)."""
    height_m: float
    """Of the centre of mass above the floor."""
    place_m: FloatArray
    """Wheel centres from the centre of mass, shape (4, 2)."""
    arm_m: FloatArray
    """Half wheelbase and half track, shape (2,)."""
    heading: FloatArray
    """Rolling directions of the wheels (unit vectors), shape (4, 2)."""
    side: FloatArray
    """Sign of the sideways component of the axis of the roller that touches the floor, shape (4,)."""
    radius_m: FloatArray
    """Shape (4,)."""
    pitch_rad: float
    """Angle of the wheel from one roller to the next."""
    half_width_m: float
    handover: float
    """Share of the pitch over which two rollers carry."""
    axis_forward: float
    axis_side: float
    """Components of the axis of the lowest roller along and across the wheel (cosine and sine)."""
    grip: float
    creep_m_s: float
    roller_coulomb_n: float
    roller_viscous_n_s_m: FloatArray
    """Shape (4,)."""
    rolling_n: float
    twist: float
    """Share of the weight that the diagonal fl-rr carries beyond half."""
    weight_n: float
    """Force on the floor, square to it."""
    downhill_n: FloatArray
    """Weight along the slope in the world frame, shape (2,)."""
    wind_n: float
    wind_rad_s: float


def plant_of(robot: Robot) -> Plant:
    """Return the numbers of a robot's body, wheels and floor."""
    body, wheels, floor = robot.body, robot.wheels, robot.floor
    mass = body.mass_kg + body.payload_kg
    own, load = body.mass_kg / mass, body.payload_kg / mass
    com = own * np.array([body.com_x_m, body.com_y_m]) + load * np.array([body.payload_x_m, body.payload_y_m])
    # Two points of these masses turn about their common centre with the reduced mass.
    apart = math.hypot(body.payload_x_m - body.com_x_m, body.payload_y_m - body.com_y_m)
    inertia = body.yaw_inertia_kg_m2 + body.mass_kg * load * apart**2
    a, b = body.half_wheelbase_m, body.half_track_m
    toe = np.radians(wheels.toe_deg)
    slope, fall = math.radians(floor.slope_deg), math.radians(floor.downhill_deg)
    weight = mass * GRAVITY_M_S2
    viscous = np.full(4, robot.rollers.viscous_n_s_m)
    if robot.rollers.blocked_wheel >= 0:
        viscous[robot.rollers.blocked_wheel] += robot.rollers.blocked_n_s_m
    return Plant(
        mass_kg=mass,
        inertia_kg_m2=inertia,
        com_m=com,
        height_m=own * body.com_height_m + load * body.payload_height_m,
        place_m=np.array([[a, b], [a, -b], [-a, b], [-a, -b]]) - com,
        arm_m=np.array([a, b]),
        heading=np.column_stack([np.cos(toe), np.sin(toe)]),
        side=np.array([-1.0, 1.0, 1.0, -1.0]),
        radius_m=wheels.radius_m * np.array(wheels.radius_scale),
        pitch_rad=2.0 * math.pi / wheels.rollers,
        half_width_m=wheels.width_m / 2.0,
        handover=wheels.handover,
        axis_forward=math.cos(math.radians(wheels.angle_deg)),
        axis_side=math.sin(math.radians(wheels.angle_deg)),
        grip=floor.grip,
        creep_m_s=floor.creep_m_s,
        roller_coulomb_n=robot.rollers.coulomb_n,
        roller_viscous_n_s_m=viscous,
        rolling_n=floor.rolling_n,
        twist=body.twist,
        weight_n=weight * math.cos(slope),
        downhill_n=weight * math.sin(slope) * np.array([math.cos(fall), math.sin(fall)]),
        wind_n=floor.wind_n,
        wind_rad_s=2.0 * math.pi * floor.wind_hz,
    )


def body_rate_per_s(plant: Plant) -> float:
    """Return the fastest rate [1/s] at which the contacts change the body's velocity with the wheels held."""
    reach = float(np.max(np.sum(plant.place_m**2, axis=1)))
    mobility = 1.0 / plant.mass_kg + reach / plant.inertia_kg_m2
    bearings = 4.0 * plant.roller_coulomb_n / REST_M_S + float(np.sum(plant.roller_viscous_n_s_m))
    return mobility * (plant.grip * plant.weight_n / plant.creep_m_s + bearings)
