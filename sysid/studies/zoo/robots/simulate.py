"""A run of a robot: commands in, rows of a log out."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray
from sysid.studies.zoo.robots.commands import wheel_set_points
from sysid.studies.zoo.robots.engine import STEP_S, RobotMotion, drive_robot
from sysid.studies.zoo.robots.robot import Robot
from sysid.studies.zoo.robots.sensors import pose_channels, velocity_channels, wheel_channels

_SETTLING_S: Final = 0.2
"""Time before the run in which wheels and frame find their rest."""
_BATTERY_STEP_V: Final = 0.01


@dataclass(frozen=True, eq=False)
class RobotLog:
    """A robot log as its user keeps it."""

    time_s: FloatArray
    """Stamps, strictly rising from 0, shape (n,)."""
    commands: FloatArray
    """V [rpm], theta [deg], VC [rpm] that were sent last at each stamp, shape (n, 3)."""
    channels: dict[str, FloatArray]
    """Measured channels by their column's name, shape (n,); NaN is a missing sample."""


def move(
    robot: Robot, commands: FloatArray, rng: np.random.Generator, *, step_s: float = STEP_S
) -> RobotMotion:
    """Return the motion of a robot that starts at rest, with wheels at angles that `rng` draws.

    Args:
        robot: what moves.
        commands: V [rpm], theta [deg], VC [rpm], one row per `drive.link.period_s`, shape (m, 3).
        rng: draws the wheels' angles (added to `wheels.start_deg`), the places within the gears' play, the
            phases of the loops' clock and of the wind, and the link's luck.
        step_s: largest step of the physics.
    """
    start_deg, gap_share = rng.uniform(0.0, 360.0, 4), rng.uniform(-1.0, 1.0, 4)
    phase, wind_phase_rad = rng.random(), rng.uniform(0.0, 2.0 * math.pi)
    fl, fr, rl, rr = (float(x) for x in start_deg + np.array(robot.wheels.start_deg))
    put_down = replace(robot, wheels=replace(robot.wheels, start_deg=(fl, fr, rl, rr)))
    drive, sensors = robot.drive, robot.sensors
    # Before the run: time to settle, and what windows, filters and delays look back on.
    wheels_back = drive.sensor.window_s + drive.sensor.late_s + sensors.wheels_late_s
    body_back = sensors.window_s + max(sensors.late_s, sensors.pose_late_s)
    tick_s = 1.0 / drive.controller.loop_hz
    before = math.ceil((_SETTLING_S + max(wheels_back, body_back)) / tick_s) + phase
    after = len(commands) * drive.link.period_s / tick_s
    ticks_s = (np.arange(math.ceil(before + after) + 2, dtype=np.float64) - before) * tick_s
    set_points = wheel_set_points(robot, commands, ticks_s, rng)
    return drive_robot(put_down, set_points, ticks_s, gap_share, wind_phase_rad, step_s)


def simulate(robot: Robot, commands: FloatArray, rng: np.random.Generator) -> RobotLog:
    """Return the log of a run that starts at rest.

    `commands`, shape (m, 3), has V [rpm], theta [deg] and VC [rpm] for every `drive.link.period_s`. The same
    state of `rng` gives the same start, the same luck of the link and the same noise, also to a robot with
    other values.
    """
    commands = np.asarray(commands, dtype=float)
    of_motion, of_wheels, of_velocity, of_pose = rng.spawn(4)
    motion = move(robot, commands, of_motion)
    drive, period_s = robot.drive, robot.drive.link.period_s
    rows, channels = wheel_channels(robot, motion, len(commands) * period_s, of_wheels)
    if robot.sensors.velocity:
        channels |= velocity_channels(motion, robot.sensors, rows.taken_s, of_velocity)
    if robot.sensors.pose:
        channels |= pose_channels(motion, robot.sensors, rows.taken_s, of_pose)
    if drive.battery.logged:
        supply_v = np.mean([wheel.supply_v for wheel in motion.wheels], axis=0)
        volts = np.interp(rows.taken_s, motion.time_s, supply_v) * drive.battery.full_v / drive.motor.supply_v
        channels["battery_v"] = np.rint(volts / _BATTERY_STEP_V) * _BATTERY_STEP_V
    # A command that is sent at the instant of a row stands in that row.
    sent = np.floor(rows.time_s / period_s + 1e-9).astype(np.intp)
    return RobotLog(rows.time_s, commands[np.minimum(sent, len(commands) - 1)], channels)
