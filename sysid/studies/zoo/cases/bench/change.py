"""A change of a drive that a study can hide, and the physics that gives it a scale.

A change has one size from 0 (nothing) to 1 (gross). Its strength, the share of the gross magnitude, goes
with the size on a log scale over four decades, so that a search for a wanted trace in the logs is even.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from sysid.studies.zoo.cases.case import Hidden
from sysid.studies.zoo.drives.drive import Controller, Drive, Gear, Link, Motor, Sensor

DECADES: Final = 4.0
"""Between the gross magnitude of a change and its smallest."""

RAD_S_PER_RPM: Final = 2.0 * math.pi / 60.0

Parameters = dict[str, float]


def strength(size: float) -> float:
    """Return the share of the gross magnitude at a size in (0, 1]; 0 at size 0."""
    return 10.0 ** (DECADES * (size - 1.0)) if size > 0.0 else 0.0


def sign(rng: np.random.Generator) -> float:
    """Return 1 or -1, drawn from `rng`."""
    return float(rng.choice((-1.0, 1.0)))


@dataclass(frozen=True)
class Change:
    """One name and form of the contract as a change of a drive's physics or firmware."""

    name: str
    form: str
    possible: Callable[[Drive], bool]
    """Whether a drive can have this change."""
    changed: Callable[[Drive, float, np.random.Generator], Drive]
    """(drive, strength, rng) -> changed drive; what is drawn does not depend on the strength."""
    truth: Callable[[Drive, Drive], Parameters]
    """(drive before, drive after) -> parameters in the contract's units, where physics gives them."""

    def apply(self, drive: Drive, size: float, rng: np.random.Generator) -> Drive:
        """Return the drive at a size of this change from 0 (the drive itself) to 1 (gross).

        `rng` draws what the size does not say, such as a sign.
        """
        return self.changed(drive, strength(size), rng) if size > 0.0 else drive

    def hidden(self, before: Drive, after: Drive, signal: float) -> Hidden:
        """Return what was hidden, with the true parameters and the signal that it leaves in the logs."""
        return Hidden(self.name, self.form, self.truth(before, after), signal)


def always(_drive: Drive) -> bool:
    """Return True: every drive can have the change."""
    return True


def no_truth(_before: Drive, _after: Drive) -> Parameters:
    """Return nothing: the contract's parameters do not follow from the physics of this change."""
    return {}


def with_motor(drive: Drive, **values: Any) -> Drive:
    """Return the drive with other values of its motor."""
    motor: Motor = dataclasses.replace(drive.motor, **values)
    return dataclasses.replace(drive, motor=motor)


def with_gear(drive: Drive, **values: Any) -> Drive:
    """Return the drive with other values of its gear and wheel."""
    gear: Gear = dataclasses.replace(drive.gear, **values)
    return dataclasses.replace(drive, gear=gear)


def with_controller(drive: Drive, **values: Any) -> Drive:
    """Return the drive with other values of its firmware."""
    controller: Controller = dataclasses.replace(drive.controller, **values)
    return dataclasses.replace(drive, controller=controller)


def with_sensor(drive: Drive, **values: Any) -> Drive:
    """Return the drive with other values of its sensor."""
    sensor: Sensor = dataclasses.replace(drive.sensor, **values)
    return dataclasses.replace(drive, sensor=sensor)


def with_link(drive: Drive, **values: Any) -> Drive:
    """Return the drive with other values of its link."""
    link: Link = dataclasses.replace(drive.link, **values)
    return dataclasses.replace(drive, link=link)


def integrates(drive: Drive) -> bool:
    """Return whether the speed loop has integral action, which removes every lasting loss of speed."""
    return drive.controller.ki > 0.0


def open_duty(drive: Drive) -> bool:
    """Return whether the command sets the motor's voltage and no speed is fed back."""
    return drive.family in ("open_duty", "open_duty_compensated")


def inertia(drive: Drive) -> float:
    """Return the inertia of rotor and wheel together [kg m2]."""
    return drive.motor.inertia_kg_m2 + drive.gear.wheel_inertia_kg_m2


def friction_torque(drive: Drive, speed_rad_s: float) -> float:
    """Return all friction of the turning wheel at a positive speed [N m]."""
    gear = drive.gear
    viscous = gear.motor_viscous_n_m_s + gear.wheel_viscous_n_m_s
    return gear.motor_coulomb_n_m + gear.wheel_coulomb_n_m + viscous * speed_rad_s


def stiffness(drive: Drive) -> float:
    """Return the torque that the drive without its integral action sets against a lost rad/s [N m s/rad].

    A voltage u on a motor at speed w makes the torque k (u - k w) / R; the speed loop adds kp volts (or
    amperes) per rad/s that is missing, and IxR compensation hides its share of R.
    """
    motor, controller = drive.motor, drive.controller
    k = motor.back_emf_v_s
    if controller.current_kp > 0.0:
        return k * controller.kp
    seen_ohm = motor.resistance_ohm * max(1.0 - controller.emf_compensation, 0.02)
    return k * (k + controller.kp) / seen_ohm


def spare_torque(drive: Drive) -> float:
    """Return the torque that the drive can set against a load at half of its top speed [N m], above 0."""
    motor, speed = drive.motor, 0.5 * drive.top_rpm * RAD_S_PER_RPM
    limit = motor.back_emf_v_s * motor.current_limit_a
    if open_duty(drive):
        torque = stiffness(drive) * speed
    else:
        emf = motor.back_emf_v_s * speed
        torque = motor.back_emf_v_s * max(motor.supply_v - emf, 0.05 * motor.supply_v) / motor.resistance_ohm
        torque -= friction_torque(drive, speed)
    return max(min(torque, limit), 0.2 * stiffness(drive) * speed)
