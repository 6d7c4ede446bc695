"""Forces between four roller wheels and the floor, for one instant of the motion (compiled).

A roller turns freely about its own axis and grips along it. The floor therefore resists slip along the axis
with up to `grip N`, and slip across it with the bearing's friction only.

Two things change while a wheel turns from one roller to the next. The touching roller's axis is straight, so
with the roller's centre at the angle phi from the lowest point the axis projects on the floor as
(cos(angle) cos(phi), +-sin(angle)), longest in the middle of a roller. And the contact runs across the wheel
from one end of the roller to the other and back within the handover, which moves the force's line of action.
"""

from __future__ import annotations

import math

from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.robots.body import REST_M_S, Plant


@compiled
def normal_loads(plant: Plant, force_x_n: float, force_y_n: float, loads_n: FloatArray) -> None:
    """Write the wheels' normal forces [N], shape (4,), for a horizontal force of the floor on the body.

    A rigid body on four equal springs: the loads are linear in the wheel's place, carry the weight and
    balance its moments and those of the horizontal force, which acts `height_m` below the centre of mass. A
    wheel that would pull on the floor hangs in the air, and the others share the weight.
    """
    a, b = plant.arm_m[0], plant.arm_m[1]
    pitching = plant.weight_n * plant.com_m[0] - force_x_n * plant.height_m
    rolling = plant.weight_n * plant.com_m[1] - force_y_n * plant.height_m
    total = 0.0
    for i in range(4):
        x = plant.place_m[i, 0] + plant.com_m[0]
        y = plant.place_m[i, 1] + plant.com_m[1]
        diagonal = 1.0 if x * y > 0.0 else -1.0
        load = 0.25 * (plant.weight_n * (1.0 + 2.0 * plant.twist * diagonal))
        load += 0.25 * (pitching * x / (a * a) + rolling * y / (b * b))
        loads_n[i] = max(load, 0.0)
        total += loads_n[i]
    for i in range(4):
        loads_n[i] *= plant.weight_n / total


@compiled
def contact_across_m(plant: Plant, turn: float) -> float:
    """Return where [m] across a wheel the contact is, -1 to 1 half widths; `turn` as in `roller_turn`."""
    band = 0.5 * plant.handover
    edge = 0.5 - band
    if abs(turn) <= edge:
        return 2.0 * turn * plant.half_width_m
    return math.copysign(2.0 * edge * (0.5 - abs(turn)) / band, turn) * plant.half_width_m


@compiled
def roller_turn(plant: Plant, angle_rad: float) -> float:
    """Return how far the touching roller is past its middle, in pitches, -0.5 to 0.5."""
    share = angle_rad / plant.pitch_rad
    return share - math.floor(share + 0.5)


@compiled
def contact_forces(
    plant: Plant,
    twist: FloatArray,
    angle_rad: FloatArray,
    speed_rad_s: FloatArray,
    loads_n: FloatArray,
    wheels: FloatArray,
    wrench: FloatArray,
) -> None:
    """Write what the floor does to body and wheels.

    Args:
        plant: the robot.
        twist: velocity of the centre of mass in the body frame and yaw rate (m/s, m/s, rad/s).
        angle_rad: wheel angles, shape (4,).
        speed_rad_s: wheel speeds, shape (4,).
        loads_n: normal forces, shape (4,).
        wheels: written: for each wheel the torque on its shaft, positive drives forward [N m], by how much
            this falls per rad/s that the wheel gains [N m s], and by how much the body's wrench grows per
            rad/s that the wheel gains (N s, N s, N m s), shape (4, 5).
        wrench: written: force in the body frame and moment about the centre of mass (N, N, N m).
    """
    wrench[:] = 0.0
    for i in range(4):
        ex, ey = plant.heading[i, 0], plant.heading[i, 1]
        turn = roller_turn(plant, angle_rad[i])
        across = plant.side[i] * contact_across_m(plant, turn)
        x, y = plant.place_m[i, 0] - across * ey, plant.place_m[i, 1] + across * ex
        vx, vy = twist[0] - twist[2] * y, twist[1] + twist[2] * x
        radius = plant.radius_m[i]
        surface = radius * speed_rad_s[i]
        # In the wheel's frame: along its rolling direction (e) and along its axle (n).
        slip_e, slip_n = vx * ex + vy * ey - surface, vy * ex - vx * ey
        axis_e = plant.axis_forward * math.cos(turn * plant.pitch_rad)
        axis_n = plant.side[i] * plant.axis_side
        length = math.sqrt(axis_e * axis_e + axis_n * axis_n)
        axis_e, axis_n = axis_e / length, axis_n / length
        along, over = slip_e * axis_e + slip_n * axis_n, slip_n * axis_e - slip_e * axis_n
        most = plant.grip * loads_n[i]
        gripped, rubbed = math.tanh(along / plant.creep_m_s), math.tanh(over / REST_M_S)
        gripping = -most * gripped
        bearing = -plant.roller_viscous_n_s_m[i] * over - plant.roller_coulomb_n * rubbed
        size = math.sqrt(gripping * gripping + bearing * bearing)
        share = min(1.0, most / size) if size > 0.0 else 1.0
        gripping, bearing = share * gripping, share * bearing
        force_e, force_n = gripping * axis_e - bearing * axis_n, gripping * axis_n + bearing * axis_e
        force_x, force_y = force_e * ex - force_n * ey, force_e * ey + force_n * ex
        wrench[0] += force_x
        wrench[1] += force_y
        wrench[2] += x * force_y - y * force_x
        # Slopes of the resistances, for a step that is implicit in the wheel's speed.
        grip_slope = share * most * (1.0 - gripped * gripped) / plant.creep_m_s
        bearing_slope = share * (
            plant.roller_viscous_n_s_m[i] + plant.roller_coulomb_n * (1.0 - rubbed * rubbed) / REST_M_S
        )
        slope_e = radius * (grip_slope * axis_e * axis_e + bearing_slope * axis_n * axis_n)
        slope_n = radius * (grip_slope - bearing_slope) * axis_e * axis_n
        slope_x, slope_y = slope_e * ex - slope_n * ey, slope_e * ey + slope_n * ex
        rolling = math.tanh(surface / REST_M_S)
        wheels[i, 0] = -radius * (force_e + plant.rolling_n * rolling)
        rolling_slope = radius * plant.rolling_n * (1.0 - rolling * rolling) / REST_M_S
        wheels[i, 1] = radius * (slope_e + rolling_slope)
        wheels[i, 2] = slope_x
        wheels[i, 3] = slope_y
        wheels[i, 4] = x * slope_y - y * slope_x
