"""A simple robot of a few physical numbers: a start for law, effects and robot that no wheel's law reaches.

A drive on the floor carries the robot. Where its torque is limited, or its loop has integral action, the same
step of the command rises differently driving straight and turning, and a law that was fitted to the wheels
describes neither. A lag, a delay and a gain, a servo with integral action and a torque limit, yaw inertia and
the friction of the wheels have so few numbers that least squares finds them from a handful of places; law,
robot and effects are then fitted together from there (`sysid.fit.robot.effects`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
from scipy.optimize import least_squares

from mecanum_env.errors import MecanumError
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.fit.robot.output_error import PlantData
from sysid.progress import Progress, silent

ROBOT_NUMBERS: Final = ("servo_n_m_s_rad", "servo_integral_n_m_rad", "torque_limit_n_m", "yaw_inertia_kg_m2")
"""Parameters of the robot that are searched, unless they were measured."""
_BEST: Final = 3
"""Places that are descended from, of all that are tried. Assumed, as are the numbers below."""
_STEPS: Final = 6
_LAST_STEPS: Final = 12
_ASTRAY: Final = 1e3
"""Residual of a model that cannot be simulated, in standard deviations of the noise."""


@dataclass(frozen=True)
class _Number:
    """A number of the simple robot: its bounds, and the places from which it is searched."""

    low: float
    high: float
    starts: tuple[float, ...]
    logarithmic: bool = False

    def at(self, share: float) -> float:
        """Return the number at a share of the way from the lower to the upper bound."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def share(self, value: float) -> float:
        """Return the inverse of `at`."""
        if self.logarithmic:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)


_NUMBERS: Final = {
    "lag_s": _Number(0.003, 0.5, (0.03,), logarithmic=True),
    "delay_s": _Number(0.0, 0.2, (0.05,)),
    "gain": _Number(0.7, 1.1, (0.98,)),
    # Of the robot's mass behind the servo, driving straight.
    "servo_lag_s": _Number(0.005, 1.0, (0.03, 0.12), logarithmic=True),
    "integral_s": _Number(0.02, 50.0, (0.4, 10.0), logarithmic=True),
    "acceleration_rad_s2": _Number(10.0, 3000.0, (60.0, 400.0), logarithmic=True),
    # Of a plate with the wheels at its corners.
    "yaw_inertia": _Number(0.4, 2.5, (1.2,), logarithmic=True),
    # Speeds that friction takes from a servo without integral action [rad/s], and shares of the speed.
    "coulomb_rad_s": _Number(0.0, 2.0, (0.3,)),
    "viscous": _Number(0.0, 0.4, (0.1,)),
}


def simple_robot(model: Model, given: Sequence[str], data: PlantData, tell: Progress = silent) -> Model:
    """Return the simple robot that predicts robot logs best, on the planar plant.

    The `model` gives the rest: the clock, and of the robot what is `given`. Its ceiling is tried, and none.
    `tell` is called before each search.
    """
    measured = data.measured()

    def residual(place: FloatArray, base: Model) -> FloatArray:
        try:
            return data.predicted(_model(base, given, place)) - measured
        except MecanumError:
            return np.full(measured.size, _ASTRAY)

    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in data.runs)
    bases = [model]
    if asked > model.wheel.saturation_rpm:
        bases.append(replace(model, wheel=replace(model.wheel, saturation_rpm=math.inf)))
    places = [
        np.array([number.share(value) for number, value in zip(_NUMBERS.values(), values, strict=True)])
        for values in product(*(number.starts for number in _NUMBERS.values()))
    ]
    tried = [
        (float(np.sum(residual(place, base) ** 2)), i, place)
        for i, base in enumerate(bases)
        for place in places
    ]
    tried.sort(key=lambda one: one[0])
    found = []
    for number, (_, index, place) in enumerate(tried[:_BEST]):
        tell(f"simple robot, start {number + 1} of {_BEST}")
        found.append((_descended(residual, bases[index], place, 1e-2, _STEPS), index))
    (_, place), index = min(found, key=lambda one: one[0][0])
    tell("simple robot")
    _, place = _descended(residual, bases[index], place, 1e-3, _LAST_STEPS)
    return _model(bases[index], given, place)


def _descended(
    residual: Callable[[FloatArray, Model], FloatArray],
    base: Model,
    place: FloatArray,
    step: float,
    most: int,
) -> tuple[float, FloatArray]:
    """Return the least cost near a place, and where, after `most` steps with differences over a `step`."""
    found = least_squares(residual, place, bounds=(0.0, 1.0), diff_step=step, max_nfev=most, args=(base,))
    return float(found.cost), found.x


def _model(base: Model, given: Sequence[str], place: FloatArray) -> Model:
    """Return the simple robot at a place, shape (9,), each number a share of the way between its bounds."""
    at = {name: number.at(float(x)) for (name, number), x in zip(_NUMBERS.items(), place, strict=True)}
    tick, robot = base.wheel.law.sample_period_s, base.robot
    pole = math.exp(-tick / at["lag_s"])
    law = WheelLaw(A=pole, B=0.0, C=0.0, D=1.0 - pole, E=0.0, F=0.0, sample_period_s=tick)
    load = robot.mass_kg * robot.wheel_radius_m**2 / 4.0
    corners = robot.half_wheelbase_m**2 + robot.half_track_m**2
    servo = load / at["servo_lag_s"]
    searched = {
        "servo_n_m_s_rad": servo,
        "servo_integral_n_m_rad": servo / at["integral_s"],
        "torque_limit_n_m": load * at["acceleration_rad_s2"],
        "yaw_inertia_kg_m2": robot.mass_kg * corners / 3.0 * at["yaw_inertia"],
    }
    free: dict[str, Any] = {name: value for name, value in searched.items() if name not in given}
    robot = replace(robot, **free)
    effects = {
        "command_latency": {"delay_s": at["delay_s"]},
        "speed_gain": {"gain": at["gain"]},
        "coulomb_friction": {"torque_n_m": robot.servo_n_m_s_rad * at["coulomb_rad_s"]},
        "viscous_friction": {"damping_n_m_s_rad": robot.servo_n_m_s_rad * at["viscous"]},
    }
    wheel = replace(base.wheel, law=law)
    return replace(base, wheel=wheel, robot=robot, effects=effects, uncertainty={})
