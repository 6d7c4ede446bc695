"""A simple robot of a few physical numbers: a start for law, effects and robot that no wheel's law reaches.

A drive on the floor carries the robot. Where its torque is limited, its loop has integral action, the
platform or the drives ramp their commands or the rollers have friction, the same step of the command rises
differently driving straight, sideways and turning, and a law that was fitted to the wheels describes none of
them. A lag, a delay and a gain, a servo with integral action and a torque limit, yaw inertia, friction of
wheels and rollers and ramps have so few numbers that least squares finds them from the best of many places;
law, robot and effects are then fitted together from there (`sysid.fit.robot.effects`). Many home-made
controllers go on integrating while their voltage or current is limited, and overshoot after every large step:
that is tried, too. So is a ramp with round ends: without it, ramps of both kinds with corners imitate it in
the logs of the fit, and go elsewhere in others.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
import numpy.typing as npt
from scipy.stats import qmc

from mecanum_env.errors import MecanumError
from mecanum_env.kinematics import WHEELS, wheels_to_body
from mecanum_env.law import WheelLaw
from mecanum_env.mjcf.geometry import wheel_geometry
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.least_squares import descend_from_afar
from sysid.fit.effects import WORTH
from sysid.fit.robot.output_error import PlantData
from sysid.logs import Run
from sysid.progress import Progress, silent

ROBOT_NUMBERS: Final = ("servo_n_m_s_rad", "servo_integral_n_m_rad", "torque_limit_n_m", "yaw_inertia_kg_m2")
"""Parameters of the robot that are searched, unless they were measured."""
_TRIED: Final = 64
"""Places that are tried without ramps and with each choice of them: a Sobol sequence, so a power of two.
Assumed, as are the numbers below."""
_DESCENDED: Final = 4
"""Places that are descended from, of those tried with the same ramps and the same integral, and the number of
steps."""
_STEPS: Final = 8
_BEST: Final = 2
"""Places that are descended from with small steps, of those with the same integral, and the number of
steps."""
_LAST_STEPS: Final = 25
_PRICE: Final = (1.0 - WORTH) ** -2
"""Factor on the squared error without the ceiling that the model assumes: it is lifted where that is worth as
much as an effect must be, compared with a descent from the same place. Logs whose commands go hardly beyond
it fit about as well without, and the next ones do not."""
WINDUPS: Final = (0.0, 1.0)
"""Values of `servo_windup` that are tried, unless it is given: with anti-windup and without."""
_ASTRAY: Final = 1e3
"""Residual of a model that cannot be simulated, in standard deviations of the noise."""
_STANDARD_GRAVITY_M_S2: Final = 9.81


@dataclass(frozen=True)
class _Number:
    """A number of the simple robot: its bounds, and between what it is tried."""

    low: float
    high: float
    tried: tuple[float, float] | None = None
    """None: around what the logs show."""
    logarithmic: bool = False

    def at(self, share: float) -> float:
        """Return the number at a share of the way from the lower to the upper bound."""
        if self.logarithmic:
            return float(self.low * (self.high / self.low) ** share)
        return self.low + share * (self.high - self.low)

    def share(self, value: npt.ArrayLike) -> FloatArray:
        """Return the inverse of `at` of numbers, within the bounds."""
        low, high, numbers = self.low, self.high, np.asarray(value, float)
        if self.logarithmic:
            numbers, low, high = np.log(numbers), math.log(low), math.log(high)
        return np.asarray(np.clip((numbers - low) / (high - low), 0.0, 1.0))

    def between(self, ends: tuple[float, float], share: FloatArray) -> FloatArray:
        """Return shares of the way between the bounds, for a `share` of that between two numbers."""
        first, last = self.share(ends)
        return np.asarray(first + share * (last - first))


_NO_RAMP_RPM_S: Final = 1e5
_RAMP_RPM_S: Final = 2e4  # that a log may show
_NUMBERS: Final = {
    "lag_s": _Number(0.003, 0.5, (0.005, 0.1), logarithmic=True),
    "delay_s": _Number(0.0, 0.2, (0.0, 0.08)),
    "gain": _Number(0.7, 1.3, (0.95, 1.05)),
    # Of the robot's mass behind the servo, driving straight.
    "servo_lag_s": _Number(0.005, 1.0, (0.02, 0.3), logarithmic=True),
    "integral_s": _Number(0.02, 50.0, (0.05, 2.0), logarithmic=True),
    "acceleration_rad_s2": _Number(3.0, 3000.0, logarithmic=True),
    # Of a plate with the wheels at its corners. The rotors of geared motors make it many times as large.
    "yaw_inertia": _Number(0.4, 20.0, (1.0, 4.0), logarithmic=True),
    # Speeds that friction takes from a servo without integral action [rad/s], and shares of the speed.
    "coulomb_rad_s": _Number(0.0, 2.0, (0.0, 0.3)),
    "viscous": _Number(0.0, 0.4, (0.0, 0.05)),
    # Friction of the rollers sideways, in weights of the robot, and for each m/s.
    "rolling": _Number(1e-4, 0.1, (5e-4, 0.01), logarithmic=True),
    "rolling_s_m": _Number(1e-4, 0.3, (5e-4, 0.03), logarithmic=True),
    # Ramps of the command, and of each drive with its braking in multiples; at their end there are none.
    "v_ramp_rpm_s": _Number(30.0, _NO_RAMP_RPM_S, logarithmic=True),
    "vc_ramp_rpm_s": _Number(30.0, _NO_RAMP_RPM_S, logarithmic=True),
    "ramp_rpm_s": _Number(30.0, _NO_RAMP_RPM_S, logarithmic=True),
    "brake": _Number(0.25, 4.0, (0.5, 2.0), logarithmic=True),
    # Time in which the ramp of a drive reaches its rate; at its end the ramp has corners.
    "round_s": _Number(0.001, 1.0, (0.02, 0.5), logarithmic=True),
}
_SHORTEST_ROUND_S: Final = 0.005  # that a log may show
_COMMAND, _DRIVE, _ROUND = ("v_ramp_rpm_s", "vc_ramp_rpm_s"), ("ramp_rpm_s", "brake"), ("round_s",)
_RAMPS: Final[Mapping[str, tuple[str, ...]]] = {
    "no ramps": (),
    "ramps of the command": _COMMAND,
    "ramps of the drives": _DRIVE,
    "ramps of the drives with round ends": (*_DRIVE, *_ROUND),
    "ramps of both": (*_COMMAND, *_DRIVE),
}
"""What is tried -> the numbers of `_UNUSED` that are then searched."""
_UNUSED: Final = {"v_ramp_rpm_s": 1.0, "vc_ramp_rpm_s": 1.0, "ramp_rpm_s": 1.0, "brake": 0.5, "round_s": 0.0}
"""Number -> its share where it is not searched, at which there is no such ramp and no round end."""
_AS_FAST: Final = 0.95
"""Quantile of the rates of change in the logs around which ramps are tried: a ramp is never exceeded."""
_OCTAVES: Final = (-0.5, 1.0)
"""Least and largest ramp that is tried, in octaves beside that rate."""
_LIMIT_OCTAVES: Final = (-0.5, 2.0)
"""The same of the torque limit, in accelerations: a limit that is seldom reached is a larger one."""
_OVER_S: Final = 0.1  # time over which a rate is measured [s]


def simple_robots(
    model: Model, given: Sequence[str], data: PlantData, tell: Progress = silent
) -> list[Model]:
    """Return the simple robots that predict robot logs best, on the planar plant: one for each integral.

    The `model` gives the rest: the clock, and of the robot what is `given`. Its ceiling stays, unless logs
    that go beyond it are predicted clearly better without. The integral of the first stands still at the
    torque limit, that of the second winds up; if that is given, there is one robot. `tell` is called before
    each search.
    """
    data = replace(data, runs=_of_different_commands(data.runs))
    measured = data.measured()

    def residual(place: FloatArray, base: Model) -> FloatArray:
        try:
            return data.predicted(_model(base, given, place)) - measured
        except MecanumError:
            return np.full(measured.size, _ASTRAY)

    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in data.runs)
    ceilings = [model]
    if asked > model.wheel.saturation_rpm:
        ceilings.append(replace(model, wheel=replace(model.wheel, saturation_rpm=math.inf)))
    rates = _rates_rpm_s(data)
    found = []
    for windup in (model.robot.servo_windup,) if "servo_windup" in given else WINDUPS:
        bases = [replace(one, robot=replace(one.robot, servo_windup=windup)) for one in ceilings]
        coarse: list[_Start] = []
        for what, ramps in _RAMPS.items():
            tell(f"simple robot{' that winds up' if windup else ''}, {what}")
            places = _places(ramps, rates)
            tried = [
                _Start(float(np.sum(residual(at, base) ** 2)), at, base, ramps)
                for base in bases
                for at in places
            ]
            tried.sort(key=_cost)
            coarse += [_descended(residual, start, 1e-2, _STEPS) for start in tried[:_DESCENDED]]
        coarse.sort(key=_cost)
        fine = [_descended(residual, start, 1e-3, _LAST_STEPS) for start in coarse[:_BEST]]
        best = min(fine, key=_cost)
        if best.base is not bases[0]:
            kept = _descended(residual, replace(best, base=bases[0]), 1e-3, _LAST_STEPS)
            best = min(best, kept, key=lambda start: start.cost * (_PRICE if start is best else 1.0))
        found.append(_model(best.base, given, best.place))
    return found


def _of_different_commands(runs: Sequence[Run]) -> tuple[Run, ...]:
    """Return one run of each command sequence: repeats would only cost time."""
    first: dict[str, Run] = {}
    for run in runs:
        first.setdefault(run.group, run)
    return tuple(first.values())


def _rates_rpm_s(data: PlantData) -> dict[str, float]:
    """Return how fast V, VC and the wheels changed in logs [rpm/s], by the names of the ramps.

    Only runs that show all four wheels tell; without one the rates are 0.
    """
    changes = []
    for run in data.runs:
        shown = [name for name in data.channels if name in run.channels and np.any(run.finite(name))]
        grid = np.arange(run.time_s[0], run.time_s[-1], _OVER_S)
        if len(shown) == len(WHEELS) and grid.size > 1:
            seen = [(run.time_s[run.finite(name)], run.channels[name][run.finite(name)]) for name in shown]
            wheels = np.stack([np.interp(grid, *one) for one in seen], axis=-1)
            changes.append(np.diff(wheels, axis=0) / _OVER_S)
    wheel = np.concatenate(changes or [np.zeros((1, len(WHEELS)))])
    vx, vy, vc = wheels_to_body(wheel).T
    rates = {"v_ramp_rpm_s": np.hypot(vx, vy), "vc_ramp_rpm_s": np.abs(vc), "ramp_rpm_s": np.abs(wheel)}
    return {name: float(np.quantile(values, _AS_FAST)) for name, values in rates.items()}


def _places(ramps: Sequence[str], rates_rpm_s: Mapping[str, float]) -> FloatArray:
    """Return the places that are tried with some ramps and without the others, (`_TRIED`, numbers).

    Ramps and the torque limit are tried around the rates that were seen, `rates_rpm_s`, or anywhere if none
    was.
    """
    places = np.asarray(qmc.Sobol(len(_NUMBERS), rng=np.random.default_rng(0)).random(_TRIED), float)
    for index, (name, number) in enumerate(_NUMBERS.items()):
        if name in _UNUSED and name not in ramps:
            places[:, index] = _UNUSED[name]
        elif number.tried is not None:
            places[:, index] = number.between(number.tried, places[:, index])
        else:
            seen = rates_rpm_s.get(name, rates_rpm_s["ramp_rpm_s"] * RAD_S_PER_RPM)
            lowest, highest = _OCTAVES if name in rates_rpm_s else _LIMIT_OCTAVES
            ends = (seen * 2.0**lowest, seen * 2.0**highest) if seen > 0.0 else (number.low, number.high)
            places[:, index] = number.between(ends, places[:, index])
    return places


@dataclass(frozen=True, eq=False)
class _Start:
    """A place to descend from, or where that led."""

    cost: float
    place: FloatArray
    base: Model
    """The model that has the rest."""
    ramps: tuple[str, ...]
    """The numbers of `_UNUSED` that are searched."""


def _cost(start: _Start) -> float:
    return start.cost


def _descended(
    residual: Callable[[FloatArray, Model], FloatArray], start: _Start, step: float, most: int
) -> _Start:
    """Return the least cost near a start and where that is, as `descend_from_afar` does.

    Numbers that are not searched stay as they are.
    """
    free = np.array([name not in _UNUSED or name in start.ramps for name in _NUMBERS])

    def whole(part: FloatArray) -> FloatArray:
        place = start.place.copy()
        place[free] = part
        return place

    def residuals(parts: FloatArray) -> FloatArray:
        return np.stack([residual(whole(part), start.base) for part in parts])

    cost, part = descend_from_afar(residuals, start.place[free], step, most)
    return replace(start, cost=cost, place=whole(part))


def _model(base: Model, given: Sequence[str], place: FloatArray) -> Model:
    """Return the simple robot at a place, shape (16,), each number a share of the way between its bounds."""
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
    weight = robot.mass_kg * _STANDARD_GRAVITY_M_S2 / 4.0
    # A roller turns sqrt 2 times as fast as its wheel moves sideways.
    lever = wheel_geometry(robot.wheel_radius_m, robot.rollers_per_wheel).roller_radius / math.sqrt(2.0)
    effects = {
        "command_latency": {"delay_s": at["delay_s"]},
        "speed_gain": {"gain": at["gain"]},
        "coulomb_friction": {"torque_n_m": robot.servo_n_m_s_rad * at["coulomb_rad_s"]},
        "viscous_friction": {"damping_n_m_s_rad": robot.servo_n_m_s_rad * at["viscous"]},
        "roller_friction": {
            "torque_n_m": at["rolling"] * weight * lever,
            "damping_n_m_s_rad": at["rolling_s_m"] * weight * lever**2,
        },
    }
    ramps = {"v_rpm_s": at["v_ramp_rpm_s"], "vc_rpm_s": at["vc_ramp_rpm_s"]}
    limited = {name: ramp for name, ramp in ramps.items() if ramp < _RAMP_RPM_S}
    if limited:
        effects["body_acceleration_limit"] = limited
    if at["ramp_rpm_s"] < _RAMP_RPM_S:
        ramp = at["ramp_rpm_s"]
        rates = {"limit_rpm_s": ramp, "brake_rpm_s": at["brake"] * ramp}
        if at["round_s"] < _SHORTEST_ROUND_S:
            effects["acceleration_limit"] = rates
        else:
            effects["acceleration_limit/s_curve"] = {**rates, "jerk_rpm_s2": ramp / at["round_s"]}
    wheel = replace(base.wheel, law=law)
    return replace(base, wheel=wheel, robot=robot, effects=effects, uncertainty={})
