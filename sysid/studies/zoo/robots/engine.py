"""The robot's motion: four drives, contacts and a planar body, stepped together (compiled).

Semi-implicit: within a step the contacts' forces come from the speeds at its beginning, linearised in the
speed of each wheel, because a light wheel follows the floor within less than a step; the wheels' new speeds
then give the force on the body, whose new velocity moves it. Wheel loads follow the floor's force through a
first-order lag, the time that tyres and frame need to tilt.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.drives.kernel import (
    GAP,
    LOAD_SLOPE,
    MOTOR_SPEED,
    SUPPLY,
    WHEEL_ANGLE,
    WHEEL_SPEED,
    controller_tick,
    new_state,
    pack,
    plant_substep,
)
from sysid.studies.zoo.drives.sensor import Motion
from sysid.studies.zoo.robots.body import Plant, body_rate_per_s, plant_of
from sysid.studies.zoo.robots.contact import contact_forces, normal_loads
from sysid.studies.zoo.robots.robot import Robot

STEP_S: Final = 1e-4
"""Largest step of the physics."""
_RATE: Final = 0.5
"""Largest product of step and the rate of the body's contacts; explicit integration is stable below 2."""
_HISTORY_S: Final = 1e-3
"""Time between two recorded points of the motion, about."""
_TILT_S: Final = 0.015
"""Lag of the wheel loads behind the forces that shift them."""


@dataclass(frozen=True)
class RobotMotion:
    """The true motion on an even clock from a little before time 0, the start of the run."""

    time_s: FloatArray
    """Shape (n,)."""
    pose: FloatArray
    """x, y, yaw of the middle of the wheels in the frame where it is at time 0 (m, m, rad), shape (n, 3)."""
    twist: FloatArray
    """Velocity of the middle in the body frame and yaw rate (m/s, m/s, rad/s), shape (n, 3)."""
    wheels: tuple[Motion, Motion, Motion, Motion]
    """Of the wheels with their motors."""


def drive_robot(
    robot: Robot,
    set_points_rad_s: FloatArray,
    ticks_s: FloatArray,
    gap_share: FloatArray,
    wind_phase_rad: float = 0.0,
    step_s: float = STEP_S,
) -> RobotMotion:
    """Return the motion of a robot from rest, in the frame where it is at time 0.

    Args:
        robot: the robot; `wheels.start_deg` are the wheels' angles at the first tick.
        set_points_rad_s: what the drives' speed loops follow, one column per tick, shape (4, m).
        ticks_s: evenly spaced times at which the loops run; the run starts at 0, shape (m,).
        gap_share: where each motor begins within its gear's play, -1 to 1, shape (4,).
        wind_phase_rad: phase of the wind at time 0.
        step_s: largest step of the physics; it is made to divide the loop's tick.
    """
    p, plant = pack(robot.drive), plant_of(robot)
    states = np.stack(
        [
            new_state(p, math.radians(angle), float(gap))
            for angle, gap in zip(robot.wheels.start_deg, gap_share, strict=True)
        ]
    )
    tick_s = 1.0 / robot.drive.controller.loop_hz
    substeps = math.ceil(tick_s / min(step_s, _RATE / body_rate_per_s(plant)) - 1e-9)
    every = max(1, round(_HISTORY_S * substeps / tick_s))
    rows = _run(
        plant,
        states,
        p,
        set_points_rad_s,
        float(ticks_s[0]),
        tick_s / substeps,
        substeps,
        every,
        wind_phase_rad,
    )
    time_s = ticks_s[0] + np.arange(len(rows)) * (every * tick_s / substeps)
    start = np.array([np.interp(0.0, time_s, column) for column in rows[:, 0:3].T])
    cos, sin = math.cos(start[2]), math.sin(start[2])
    pose = (rows[:, 0:3] - start) @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    fl, fr, rl, rr = (Motion(time_s, *np.ascontiguousarray(rows[:, 6 + i :: 4].T)) for i in range(4))
    return RobotMotion(time_s, pose=pose, twist=rows[:, 3:6], wheels=(fl, fr, rl, rr))


@compiled
def _record(
    row: FloatArray, plant: Plant, place: FloatArray, velocity: FloatArray, states: FloatArray
) -> None:
    """Write pose and twist of the middle of the wheels, and the wheels' state, shape (26,)."""
    cos, sin = math.cos(place[2]), math.sin(place[2])
    com_x, com_y = plant.com_m[0], plant.com_m[1]
    # The frame of the log begins in the middle of the wheels, the centre of mass beside it.
    row[0] = place[0] + com_x - cos * com_x + sin * com_y
    row[1] = place[1] + com_y - sin * com_x - cos * com_y
    row[2] = place[2]
    row[3] = cos * velocity[0] + sin * velocity[1] + velocity[2] * com_y
    row[4] = cos * velocity[1] - sin * velocity[0] - velocity[2] * com_x
    row[5] = velocity[2]
    for i in range(4):
        row[6 + i] = states[i, WHEEL_ANGLE]
        row[10 + i] = states[i, WHEEL_SPEED]
        row[14 + i] = states[i, WHEEL_ANGLE] + states[i, GAP]
        row[18 + i] = states[i, MOTOR_SPEED]
        row[22 + i] = states[i, SUPPLY]


@compiled
def _run(
    plant: Plant,
    states: FloatArray,
    p: FloatArray,
    set_points: FloatArray,
    start_s: float,
    h: float,
    substeps: int,
    every: int,
    wind_phase: float,
) -> FloatArray:
    """Return the rows of `_record` at every `every`th step of `h` seconds, the start included."""
    steps = set_points.shape[1] * substeps
    rows = np.empty((steps // every + 1, 26))
    place, velocity = np.zeros(3), np.zeros(3)  # of the centre of mass, in the world frame
    twist, wrench, tilting = np.zeros(3), np.zeros(3), np.zeros(2)
    angles, speeds, loads, wheels = np.zeros(4), np.zeros(4), np.zeros(4), np.zeros((4, 5))
    # At rest the floor holds the weight's part along the slope.
    tilting[0], tilting[1] = -plant.downhill_n[0], -plant.downhill_n[1]
    lag = -math.expm1(-h / _TILT_S)
    _record(rows[0], plant, place, velocity, states)
    for step in range(steps):
        if step % substeps == 0:
            for i in range(4):
                controller_tick(states[i], p, set_points[i, step // substeps])
        time_s = start_s + step * h
        cos, sin = math.cos(place[2]), math.sin(place[2])
        twist[0] = cos * velocity[0] + sin * velocity[1]
        twist[1] = cos * velocity[1] - sin * velocity[0]
        twist[2] = velocity[2]
        for i in range(4):
            angles[i] = states[i, WHEEL_ANGLE]
            speeds[i] = states[i, WHEEL_SPEED]
        normal_loads(plant, tilting[0], tilting[1], loads)
        contact_forces(plant, twist, angles, speeds, loads, wheels, wrench)
        for i in range(4):
            states[i, LOAD_SLOPE] = wheels[i, 1]
            plant_substep(states[i], p, wheels[i, 0], h, max(time_s, 0.0))
            gained = states[i, WHEEL_SPEED] - speeds[i]
            for k in range(3):
                wrench[k] += wheels[i, 2 + k] * gained
        tilting[0] += lag * (wrench[0] - tilting[0])
        tilting[1] += lag * (wrench[1] - tilting[1])
        wind = plant.wind_n * math.sin(plant.wind_rad_s * time_s + wind_phase)
        velocity[0] += h * (cos * wrench[0] - sin * wrench[1] + plant.downhill_n[0] + wind) / plant.mass_kg
        velocity[1] += h * (sin * wrench[0] + cos * wrench[1] + plant.downhill_n[1]) / plant.mass_kg
        velocity[2] += h * wrench[2] / plant.inertia_kg_m2
        for k in range(3):
            place[k] += h * velocity[k]
        if (step + 1) % every == 0:
            _record(rows[(step + 1) // every], plant, place, velocity, states)
    return rows
