"""What of the robot a ruler cannot measure: servo stiffness, yaw inertia and grip, from robot logs.

The wheel speeds of a robot on the floor are those of its law behind a servo that carries the load. Stiffness
k of each servo and inertia make a lag of m R^2 / 4k driving straight and of about I R^2 / 4 k L^2 turning (L:
half wheelbase + half track), and hard starts meet the torque limit. A law fitted to the wheel speeds alone
swallows what is common to both. So law and robot are fitted together, by simulating the planar plant on the
logs' commands (output error, logarithms of the parameters), and what the logs do not show stays as it was.

Grip shows only where rollers slip: it is sought first, with the roller plant, on a few seconds of the
liveliest runs. Where it shows, law, servo, inertia and grip are fitted together with that plant.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares, minimize_scalar

from mecanum_env.law import WheelLaw
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import Model, Robot
from mecanum_env.simulator import Plant
from mecanum_env.units import FloatArray
from sysid.estimators.stability import free_coordinates, stabilised_abc, stable_abc
from sysid.fit.plant_prediction import BODY_VELOCITY, PlantData, liveliest_runs

SOUGHT: Final = ("servo_n_m_s_rad", "yaw_inertia_kg_m2")
_SHOWN: Final = 0.25
"""Relative standard error up to which a parameter counts as shown by the logs."""
_EVIDENCE: Final = 10.0
_RANGE: Final = math.log(30.0)
_LAW: Final = 5  # coordinates of a law of given DC gain
_FASTER: Final = (1.5, 2.5)
_FIRST: Final = 8
_THEN: Final = 30
"""Evaluations allowed to each start, and to the best of them."""
_PLANAR_SECONDS: Final = 60.0
_ROLLER_SECONDS: Final = 10.0
_GRIPS: Final = (0.15, 0.25, 0.4, 0.6, 0.8, 1.1)


@dataclass(frozen=True)
class RobotParameter:
    """One of the robot's numbers and what the logs say about it."""

    name: str
    value: float
    standard_error: float
    """Infinite where the logs say nothing; nan where they were not asked."""
    fitted: bool
    reason: str


@dataclass(frozen=True, eq=False)
class RobotFit:
    """Law and robot that predict robot logs together."""

    law: WheelLaw
    """The law without load: what the simulated robot's drives run."""
    robot: Robot
    parameters: tuple[RobotParameter, ...]
    covariance: FloatArray
    """Of A-F, shape (6, 6)."""
    residual_before: float
    """Rms over the noise on the runs used, by the law that was fitted to the wheel speeds alone."""
    residual_after: float


def fit_robot(model: Model, given: Sequence[str], data: PlantData) -> RobotFit:
    """Fit law, servo stiffness and yaw inertia to robot logs together, then grip.

    The law is of full order here, whatever order did for the wheel speeds, whose residual hid the load.

    Args:
        model: the law fitted to the wheel speeds, and the robot as far as it is known.
        given: names of robot parameters that were measured: not fitted.
        data: runs that start at rest; body velocities among the channels count for the grip only.
    """
    wheels = replace(
        data,
        runs=liveliest_runs(data.runs, _PLANAR_SECONDS),
        channels=tuple(name for name in data.channels if name.startswith("speed_")),
    )
    before = wheels.spread(model)
    sought = [name for name in SOUGHT if name not in given]
    grip = _grip(model, "friction" in given, data)
    if grip.fitted:
        # Where wheels slip, the plant without slip would misread all the rest.
        slipping = replace(model, robot=replace(model.robot, friction=grip.value))
        used = replace(data, runs=liveliest_runs(data.runs, _ROLLER_SECONDS))
        search = _Search(slipping, used, "rollers")
        found, shown, errors = _shown(search, sought, ["friction"])
        value = found.model.robot.friction
        grip = replace(grip, value=value, standard_error=value * errors["friction"])
    else:
        found, shown, errors = _shown(_Search(model, wheels), sought, [])
    parameters = [
        _parameter(name, found.model.robot, name in shown, name in given, errors.get(name, math.nan))
        for name in SOUGHT
    ]
    return RobotFit(
        law=found.model.wheel.law,
        robot=found.model.robot,
        parameters=(*parameters, grip),
        covariance=found.covariance,
        residual_before=before,
        residual_after=wheels.spread(found.model),
    )


def _shown(
    search: _Search, sought: Sequence[str], always: Sequence[str]
) -> tuple[_Found, list[str], dict[str, float]]:
    """Fit all that is sought, drop the least known until the logs show every one that is left.

    Returns:
        What was found, the names shown, and the standard errors of all logarithms as last seen.
    """
    names = list(sought)
    found = simplest = search.fit(always)
    errors = dict.fromkeys(sought, math.inf) | dict(zip(always, map(float, found.errors), strict=True))
    while names:
        found = search.fit([*names, *always])
        errors.update(zip([*names, *always], map(float, found.errors), strict=True))
        worst = max(names, key=lambda name: errors[name])
        variance = search.data.variance(found.cost, search.samples)
        gained = 2.0 * (simplest.cost - found.cost) / variance
        evidence = gained - len(names) * math.log(search.samples)
        if errors[worst] <= _SHOWN and evidence >= _EVIDENCE:
            return found, names, errors
        names.remove(worst)
    return simplest, [], errors


def _parameter(name: str, robot: Robot, fitted: bool, given: bool, log_error: float) -> RobotParameter:
    value = float(getattr(robot, name))
    if given:
        return RobotParameter(name, value, math.nan, False, "given, so not fitted")
    if fitted:
        return RobotParameter(name, value, value * log_error, True, "shown by the wheel speeds")
    seen = f"{log_error:.0%}" if log_error < 10.0 else "no bound"
    reason = f"left: the wheel speeds do not show it (relative standard error {seen}, must be {_SHOWN:.0%})"
    if log_error <= _SHOWN:
        reason = "left: another value predicts the wheel speeds no better"
    return RobotParameter(name, value, value * log_error, False, reason)


@dataclass(frozen=True, eq=False)
class _Found:
    model: Model
    cost: float
    """Half the square sum of the residuals over the noise."""
    errors: FloatArray
    """Standard errors of the logarithms of the parameters sought."""
    covariance: FloatArray


class _Search:
    """Output error through the planar plant, from the law fitted to the wheel speeds."""

    def __init__(self, model: Model, data: PlantData, plant: Plant = "planar") -> None:
        self._model, self.data, self._plant = model, data, plant
        # Contacts make the roller plant rough on the scale of a small step.
        self._step = 1e-4 if plant == "planar" else 2e-2
        self._measured = data.measured()
        self.samples = self._measured.size
        c = model.wheel.law.coefficients
        self._gain = model.wheel.law.dc_gain
        self._starts = [np.array([*free_coordinates(c[:3]), c[3], c[5]])]
        if plant == "planar":
            self._starts += [self._faster(power) for power in _FASTER]

    def _faster(self, power: float) -> FloatArray:
        """Return the law with poles p^power: without load a wheel is quicker than with it."""
        poles = np.abs(self._model.wheel.law.poles) ** power
        abc = stabilised_abc(-np.real(np.poly(poles))[1:])
        third = self._gain * (1.0 - float(np.sum(abc))) / 3.0
        return np.array([*free_coordinates(abc), third, third])

    def fit(self, names: Sequence[str]) -> _Found:
        """Fit the law and the named parameters of the robot."""
        laws = _LAW
        low = [-np.inf] * laws + [self._lowest(name) for name in names]
        high = [np.inf] * laws + [_RANGE] * len(names)

        def residual(x: FloatArray) -> FloatArray:
            return self.data.predicted(self._at(x, names), self._plant) - self._measured

        def search(start: FloatArray, evaluations: int) -> OptimizeResult:
            return least_squares(
                residual,
                start,
                lambda x: _central(residual, x, self._step),
                bounds=(low, high),
                x_scale="jac",
                ftol=1e-6,
                xtol=1e-6,
                max_nfev=evaluations,
            )

        # The torque limit makes kinks in which a single search gets stuck.
        starts = [np.concatenate([law, np.zeros(len(names))]) for law in self._starts]
        found = min((search(start, _FIRST) for start in starts), key=lambda r: float(r.cost))
        if self._plant == "planar":
            found = search(found.x, _THEN)
        jacobian = _central(residual, found.x, 10.0 * self._step)
        variance = self.data.variance(float(found.cost), self.samples, found.x.size)
        covariance = np.linalg.pinv(jacobian.T @ jacobian, rcond=1e-14) * variance
        errors = np.sqrt(np.diag(covariance)[laws:])
        at_bound = [abs(x - b) < 1e-3 for x, b in zip(found.x[laws:], low[laws:], strict=True)]
        at_bound = [a or abs(x - _RANGE) < 1e-3 for a, x in zip(at_bound, found.x[laws:], strict=True)]
        by_x = _central(lambda x: self._at(x, names).wheel.law.coefficients, found.x, 1e-5)
        return _Found(
            self._at(found.x, names),
            float(found.cost),
            np.where(at_bound, np.inf, errors),
            by_x @ covariance @ by_x.T,
        )

    def _at(self, x: FloatArray, names: Sequence[str]) -> Model:
        abc, (d, f) = stable_abc(x[:3]), x[3:5]
        inputs = self._gain * (1.0 - float(np.sum(abc)))  # D + E + F of this DC gain
        law = WheelLaw.from_coefficients([*abc, d, inputs - d - f, f], self._model.wheel.law.sample_period_s)
        logs = x[_LAW:]
        changed = {n: getattr(self._model.robot, n) * math.exp(v) for n, v in zip(names, logs, strict=True)}
        return replace(
            self._model,
            wheel=replace(self._model.wheel, law=law),
            robot=replace(self._model.robot, **changed),
        )

    def _lowest(self, name: str) -> float:
        if name != "yaw_inertia_kg_m2":
            return -_RANGE
        robot, large = self._model.robot, 1e3
        base = robot_masses(replace(robot, yaw_inertia_kg_m2=large)).base.moments[2]
        # The wheels alone have this much at their places; the chassis needs some as well.
        return max(-_RANGE, math.log(1.02 * (large - base) / robot.yaw_inertia_kg_m2))


def _central(function: Callable[[FloatArray], FloatArray], x: FloatArray, step: float) -> FloatArray:
    """Return the Jacobian by central differences of a step, shape (m, n)."""
    steps = step * np.eye(x.size)
    return np.stack([(function(x + h) - function(x - h)) / (2.0 * step) for h in steps], axis=1)


def _grip(model: Model, given: bool, data: PlantData) -> RobotParameter:
    """Scan the friction with the roller plant, everything else held."""
    nominal = model.robot.friction
    if given:
        return RobotParameter("friction", nominal, math.nan, False, "given, so not fitted")
    if not any(name in data.channels for name in BODY_VELOCITY):
        reason = "left: without body velocities slip does not show"
        return RobotParameter("friction", nominal, math.inf, False, reason)
    few = replace(data, runs=liveliest_runs(data.runs, _ROLLER_SECONDS))
    measured = few.measured()

    def residual(log_friction: float) -> FloatArray:
        robot = replace(model.robot, friction=math.exp(log_friction))
        return few.predicted(replace(model, robot=robot), "rollers") - measured

    costs = {grip: 0.5 * float(np.sum(residual(math.log(grip)) ** 2)) for grip in {*_GRIPS, nominal}}
    grips = sorted(costs)
    place = grips.index(min(grips, key=lambda grip: costs[grip]))
    low, high = grips[max(place - 1, 0)], grips[min(place + 1, len(grips) - 1)]
    best = minimize_scalar(
        lambda x: 0.5 * float(np.sum(residual(x) ** 2)),
        bounds=(math.log(low), math.log(high)),
        method="bounded",
        options={"xatol": 0.02, "maxiter": 12},
    )
    variance = few.variance(float(best.fun), measured.size)
    slope = (residual(best.x + 0.1) - residual(best.x - 0.1)) / 0.2
    power = float(slope @ slope)
    log_error = math.sqrt(variance / power) if power > 0.0 else math.inf
    # Slip shows where neither full grip nor the plant without slip explains as much.
    sticking = 0.5 * float(np.sum((few.predicted(model) - measured) ** 2))
    rival = min(sticking, costs[nominal], costs[grips[-1]])
    evidence = 2.0 * (rival - float(best.fun)) / variance - math.log(measured.size)
    value = math.exp(float(best.x))
    if log_error <= _SHOWN and evidence >= _EVIDENCE and grips[0] * 1.02 < value < grips[-1] / 1.02:
        reason = "shown by slip between wheels and body"
        return RobotParameter("friction", value, value * log_error, True, reason)
    reason = "left: no slip that another grip would explain better"
    return RobotParameter("friction", nominal, nominal * log_error, False, reason)
