"""Changes of a robot that no name of the contract covers: some close to a named one, some far from all."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from sysid.studies.zoo.cases.bench.change import sign, strength
from sysid.studies.zoo.cases.bench.outsiders import FAR_OUTSIDERS, NEAR_OUTSIDERS, Outsider
from sysid.studies.zoo.cases.robot.change import Changed, always, has_velocity, wheel_load_n, with_sensors
from sysid.studies.zoo.cases.robot.plans import top_speed_m_s
from sysid.studies.zoo.robots.robot import Robot

Rng = np.random.Generator


@dataclass(frozen=True)
class RobotOutsider:
    """One change without a name."""

    words: str
    """What was changed."""
    near: str
    """The name that it is closest to; empty: far from all."""
    changed: Changed
    possible: Callable[[Robot], bool] = always

    def apply(self, robot: Robot, size: float, rng: Rng) -> Robot:
        """Return the robot with this change at a size from 0 (the robot itself) to 1 (gross).

        `rng` draws what the size leaves open, such as signs and wheels.
        """
        return self.changed(robot, strength(size), rng) if size > 0.0 else robot


def _of_drives(outsider: Outsider) -> RobotOutsider:
    """Return what happens to a drive as the same of all four drives of a robot."""
    return RobotOutsider(
        words=outsider.words,
        near=outsider.near,
        changed=lambda robot, share, rng: replace(robot, drive=outsider.changed(robot.drive, share, rng)),
        possible=lambda robot: outsider.possible(robot.drive),
    )


def _lever(robot: Robot, share: float, rng: Rng) -> Robot:
    angle, sensors = rng.uniform(-math.pi, math.pi), robot.sensors
    length = share * (robot.body.half_wheelbase_m + robot.body.half_track_m)
    x, y = length * math.cos(angle), length * math.sin(angle)
    return with_sensors(robot, lever_x_m=sensors.lever_x_m + x, lever_y_m=sensors.lever_y_m + y)


def _small_wheel(robot: Robot, share: float, rng: Rng) -> Robot:
    scales = list(robot.wheels.radius_scale)
    scales[int(rng.integers(4))] /= 1.0 + 0.4 * share
    fl, fr, rl, rr = scales
    return replace(robot, wheels=replace(robot.wheels, radius_scale=(fl, fr, rl, rr)))


def _toe_in(robot: Robot, share: float, rng: Rng) -> Robot:
    """Turn the wheels of the front axle inwards or outwards, as a bent frame does."""
    toe = 15.0 * share * sign(rng)
    fl, fr, rl, rr = robot.wheels.toe_deg
    return replace(robot, wheels=replace(robot.wheels, toe_deg=(fl - toe, fr + toe, rl, rr)))


def _blocked(robot: Robot, share: float, rng: Rng) -> Robot:
    damping = 3.0 * share * wheel_load_n(robot) / top_speed_m_s(robot)
    rollers = replace(robot.rollers, blocked_wheel=int(rng.integers(4)), blocked_n_s_m=damping)
    return replace(robot, rollers=rollers)


def _tilted(robot: Robot, share: float, _rng: Rng) -> Robot:
    # What is lost goes with the square of the angle.
    return with_sensors(robot, tilt_deg=60.0 * math.sqrt(share))


def _soft_floor(robot: Robot, share: float, _rng: Rng) -> Robot:
    force = robot.floor.rolling_n + 0.4 * share * wheel_load_n(robot)
    return replace(robot, floor=replace(robot.floor, rolling_n=force))


def _wind(robot: Robot, share: float, _rng: Rng) -> Robot:
    return replace(robot, floor=replace(robot.floor, wind_n=1.6 * share * wheel_load_n(robot)))


def _crosstalk(robot: Robot, share: float, rng: Rng) -> Robot:
    arm = robot.body.half_wheelbase_m + robot.body.half_track_m
    return with_sensors(robot, crosstalk=0.5 * share * sign(rng) / arm)


def _jumps(robot: Robot, share: float, _rng: Rng) -> Robot:
    return with_sensors(robot, jump_m=share * top_speed_m_s(robot))


_DRIVES_TOO: Final = ("gain hysteresis", "air drag", "swinging supply", "rubbing now and then")
"""Of the outsiders of drives, those that also show on a robot's wheels."""

ROBOT_OUTSIDERS: Final[tuple[RobotOutsider, ...]] = (
    RobotOutsider("velocity sensor off the centre", "mount_yaw", _lever, has_velocity),
    RobotOutsider("one wheel smaller", "wheel_radius", _small_wheel),
    RobotOutsider("front wheels toed in", "wheel_gain_mismatch", _toe_in),
    RobotOutsider("rollers of one wheel blocked", "roller_friction", _blocked),
    RobotOutsider("velocity sensor tilted", "sensor_scale", _tilted, has_velocity),
    RobotOutsider("soft floor", "viscous_friction", _soft_floor),
    RobotOutsider("wind", "", _wind),
    RobotOutsider("forward speed in the yaw rate", "", _crosstalk, has_velocity),
    RobotOutsider("motion capture jumps", "", _jumps, lambda robot: robot.sensors.pose),
    *(_of_drives(each) for each in (*NEAR_OUTSIDERS, *FAR_OUTSIDERS) if each.words in _DRIVES_TOO),
)
