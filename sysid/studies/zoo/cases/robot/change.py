"""A change of a robot: a named effect in one of its forms, in any size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sysid.studies.zoo.cases.bench.change import Change, Parameters, sign, strength
from sysid.studies.zoo.cases.case import Hidden
from sysid.studies.zoo.robots.robot import Robot

_GRAVITY_M_S2 = 9.81
Rng = np.random.Generator
Changed = Callable[[Robot, float, Rng], Robot]
"""(robot, strength, rng) -> changed robot. The strength, at most 1, is the share of the gross magnitude;
signs, directions and wheels that are drawn do not depend on it, so a size can be searched for."""


def always(_robot: Robot) -> bool:
    """Return True: every robot can have the change."""
    return True


def no_truth(_before: Robot, _after: Robot) -> Parameters:
    """Return nothing: the contract's parameters do not follow from the physics of this change."""
    return {}


@dataclass(frozen=True)
class RobotChange:
    """One name and form of the contract, as something that happens to a robot."""

    name: str
    form: str
    """As in the contract; empty for a name without forms."""
    changed: Changed
    truth: Callable[[Robot, Robot], Parameters] = no_truth
    """(before, after) -> parameters in the contract's units, where physics gives them."""
    possible: Callable[[Robot], bool] = always
    """Whether a robot can have this change, and its logs have a channel for it."""
    variant: str = ""
    """Which of several ways to hide the same form, such as the channel that a scale acts on."""

    @property
    def label(self) -> str:
        """Such as "sensor_latency/body" or "sensor_scale/yaw"."""
        return "/".join(part for part in (self.name, self.form, self.variant) if part)

    def apply(self, robot: Robot, size: float, rng: Rng) -> Robot:
        """Return the robot with this change at a size from 0 (the robot itself) to 1 (gross).

        `rng` draws what the size leaves open, such as signs and wheels.
        """
        return self.changed(robot, strength(size), rng) if size > 0.0 else robot

    def hidden(self, before: Robot, after: Robot, signal: float) -> Hidden:
        """Return what was hidden between two robots, with the true parameters and its signal."""
        return Hidden(self.name, self.form, self.truth(before, after), signal)


def of_drives(change: Change) -> RobotChange:
    """Return a change of a drive as the same change of all four drives of a robot."""
    return RobotChange(
        name=change.name,
        form=change.form,
        changed=lambda robot, share, rng: replace(robot, drive=change.changed(robot.drive, share, rng)),
        truth=lambda before, after: change.truth(before.drive, after.drive),
        possible=lambda robot: change.possible(robot.drive),
    )


def with_body(robot: Robot, **values: Any) -> Robot:
    """Return the robot with other values of its body's fields."""
    return replace(robot, body=replace(robot.body, **values))


def with_sensors(robot: Robot, **values: Any) -> Robot:
    """Return the robot with other values of its sensors' fields."""
    return replace(robot, sensors=replace(robot.sensors, **values))


def with_controller(robot: Robot, **values: Any) -> Robot:
    """Return the robot whose drives' controllers have other values."""
    return replace(robot, drive=replace(robot.drive, controller=replace(robot.drive.controller, **values)))


def wheel_load_n(robot: Robot) -> float:
    """Return a quarter of the robot's weight [N]."""
    return robot.body.mass_kg * _GRAVITY_M_S2 / 4.0


def has_velocity(robot: Robot) -> bool:
    """Return whether a robot logs the velocity of its body."""
    return robot.sensors.velocity


def factor(rng: Rng, share: float) -> float:
    """Return a factor off 1 by a share [1], up or down as `rng` draws, alike in both directions."""
    return float((1.0 + share) ** sign(rng))
