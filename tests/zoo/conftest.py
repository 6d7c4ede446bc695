"""A plain drive with numbers that a test can compute with, and its speed at the end of a held command."""

import math

import numpy as np
import pytest

from sysid.studies.zoo.drives.drive import Controller, Drive, Gear, Link, Motor, Sensor
from sysid.studies.zoo.drives.simulate import move

RPM = 60.0 / (2.0 * math.pi)


@pytest.fixture
def motor():
    return Motor(resistance_ohm=1.0, inductance_h=5e-4, back_emf_v_s=0.5, inertia_kg_m2=3e-3, supply_v=24.0)


@pytest.fixture
def drive(motor):
    """A P loop of 1 kHz on a tachometer, no friction: the wheel follows k + kp of stiffness."""
    return Drive(
        motor=motor,
        gear=Gear(wheel_inertia_kg_m2=1e-3),
        controller=Controller("p", loop_hz=1000.0, kp=0.5, feed_forward=0.5),
        sensor=Sensor(sample_s=0.01),
        link=Link(period_s=0.1),
    )


@pytest.fixture
def last_rpm():
    """Return a function: the wheel's true mean speed in the last 0.2 s of a command held for `seconds`."""

    def run(drive, command_rpm, seconds=3.0, **options):
        commands = np.full(round(seconds / drive.link.period_s), command_rpm)
        motion = move(drive, commands, np.random.default_rng(3), **options)
        return motion.wheel_rad_s[motion.time_s > seconds - 0.2].mean() * RPM

    return run
