"""What of the robot a ruler cannot measure: servo stiffness, yaw inertia and grip, from robot logs.

The wheel speeds of a robot on the floor are those of its law behind a servo that carries the load. Stiffness
k of each servo and inertia make a lag of m R^2 / 4k driving straight and of about I R^2 / 4 k L^2 turning (L:
half wheelbase + half track), and hard starts meet the torque limit. A law fitted to the wheel speeds alone
swallows what is common to both. So law and robot are fitted together, by simulating the planar plant on the
logs' commands (output error, logarithms of the parameters), and what the logs do not show stays as it was.

Grip shows only where rollers slip: it is sought first, with the roller plant, on a few seconds of the
liveliest runs. Where it shows, law, servo and inertia are fitted with that plant at that grip, then the grip
with them, in turns: the first grip suits a law that has swallowed the slip, and so is off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import free_coordinates, stabilised_abc, stable_abc
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import Model, Robot
from mecanum_env.simulator import RobotPlant
from mecanum_env.units import FloatArray
from sysid.fit.grip import EVIDENCE, ROLLER_SECONDS, SHOWN, RobotParameter, profile_grip, scan_grip
from sysid.fit.plant_prediction import PlantData, largest_command_runs

SOUGHT: Final = ("servo_n_m_s_rad", "yaw_inertia_kg_m2")
_RANGE: Final = math.log(30.0)
_LAW: Final = 5  # coordinates of a law of given DC gain
_FASTER: Final = (1.5, 2.5)
_FIRST: Final = 8
_THEN: Final = 30
"""Evaluations allowed to each start, and to the best of them."""
_SLIPPING: Final = 4
"""Evaluations allowed with the roller plant, whose roughness hides what further ones would gain."""
_AGREE: Final = 0.05
"""Relative change of the grip below which two turns agree."""
_PLANAR_SECONDS: Final = 60.0


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
        runs=largest_command_runs(data.runs, _PLANAR_SECONDS),
        channels=tuple(name for name in data.channels if name.startswith("speed_")),
    )
    before = wheels.spread(model)
    sought = [name for name in SOUGHT if name not in given]
    grip = scan_grip(model, "friction" in given, data)
    if grip.fitted:
        found, shown, errors, grip = _in_turns(model, sought, grip, data)
    else:
        found, shown, errors = _shown(_Search(model, wheels), sought)
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


def _in_turns(
    model: Model, sought: Sequence[str], grip: RobotParameter, data: PlantData
) -> tuple[_Found, list[str], dict[str, float], RobotParameter]:
    """Fit law and robot at a grip, then the grip with them, until they agree.

    Returns:
        What `_shown` returns, and the grip.
    """
    used = replace(data, runs=largest_command_runs(data.runs, ROLLER_SECONDS))

    def search(law: WheelLaw, friction: float) -> _Search:
        wheel, robot = replace(model.wheel, law=law), replace(model.robot, friction=friction)
        return _Search(replace(model, wheel=wheel, robot=robot), used, "rollers")

    # What shows is judged only with a law that no longer stands in for the slip.
    first = search(model.wheel.law, grip.value).fit(sought)
    before = profile_grip(first.model, data)
    found, shown, errors = _shown(search(first.model.wheel.law, before.value), sought)
    after = profile_grip(found.model, data)
    if abs(math.log(after.value / before.value)) > _AGREE:
        again = search(found.model.wheel.law, after.value).fit(shown)
        last = profile_grip(again.model, data)
        if last.cost < after.cost:
            found, after = again, last
            errors.update(zip(shown, map(float, again.errors), strict=True))
    # Grip and law lean on each other, and the law is as unsettled as it moved the grip.
    error = after.value * math.hypot(after.log_error * found.coupling, math.log(after.value / grip.value))
    reason = grip.reason + (f"; no interval: {after.doubt}" if after.doubt else "")
    robot = replace(found.model.robot, friction=after.value)
    found = replace(found, model=replace(found.model, robot=robot))
    return found, shown, errors, replace(grip, value=after.value, standard_error=error, reason=reason)


def _shown(search: _Search, sought: Sequence[str]) -> tuple[_Found, list[str], dict[str, float]]:
    """Fit all that is sought, drop the least known until the logs show every one that is left.

    Returns:
        What was found, the names shown, and the standard errors of all logarithms as last seen.
    """
    names = list(sought)
    found = simplest = search.fit([])
    errors = dict.fromkeys(sought, math.inf)
    while names:
        found = search.fit(names)
        errors.update(zip(names, map(float, found.errors), strict=True))
        worst = max(names, key=lambda name: errors[name])
        variance = search.data.variance(found.cost, search.samples)
        gained = 2.0 * (simplest.cost - found.cost) / variance
        evidence = gained - len(names) * math.log(search.samples)
        if errors[worst] <= SHOWN and evidence >= EVIDENCE:
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
    reason = f"left: the wheel speeds do not show it (relative standard error {seen}, must be {SHOWN:.0%})"
    if log_error <= SHOWN:
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
    coupling: float
    """How many times the grip is less sure for the rest being fitted too; 1 on the plant without slip."""


class _Search:
    """Output error through the planar plant, from the law fitted to the wheel speeds."""

    def __init__(self, model: Model, data: PlantData, plant: RobotPlant = "planar") -> None:
        self._model, self.data, self._plant = model, data, plant
        # Contacts make the roller plant rough on the scale of a small step.
        self._step = 1e-4 if plant == "planar" else 5e-2
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

        planar = self._plant == "planar"
        tolerance = 1e-6 if planar else 1e-3

        def search(start: FloatArray, evaluations: int) -> OptimizeResult:
            return least_squares(
                residual,
                start,
                lambda x: _central(residual, x, self._step),
                bounds=(low, high),
                x_scale="jac",
                ftol=tolerance,
                xtol=tolerance,
                max_nfev=evaluations,
            )

        # The torque limit makes kinks in which a single search gets stuck.
        starts = [np.concatenate([law, np.zeros(len(names))]) for law in self._starts]
        found = min(
            (search(start, _FIRST if planar else _SLIPPING) for start in starts), key=lambda r: float(r.cost)
        )
        if planar:
            found = search(found.x, _THEN)
        # The grip is held in the search, but as unsure as the rest.
        beside = [*names] if planar else [*names, "friction"]
        jacobian = _central(
            lambda x: self.data.predicted(self._at(x, beside), self._plant),
            np.append(found.x, np.zeros(len(beside) - len(names))),
            (10.0 if planar else 2.0) * self._step,
        )
        variance = self.data.variance(float(found.cost), self.samples, found.x.size)
        information = jacobian.T @ jacobian
        inverse = np.linalg.pinv(information, rcond=1e-14)
        coupling = 1.0 if planar else math.sqrt(max(1.0, float(information[-1, -1] * inverse[-1, -1])))
        covariance = inverse[: found.x.size, : found.x.size] * variance
        errors = np.sqrt(np.diag(covariance)[laws:])
        at_bound = [abs(x - b) < 1e-3 for x, b in zip(found.x[laws:], low[laws:], strict=True)]
        at_bound = [a or abs(x - _RANGE) < 1e-3 for a, x in zip(at_bound, found.x[laws:], strict=True)]
        by_x = _central(lambda x: self._at(x, names).wheel.law.coefficients, found.x, 1e-5)
        return _Found(
            self._at(found.x, names),
            float(found.cost),
            np.where(at_bound, np.inf, errors),
            by_x @ covariance @ by_x.T,
            coupling,
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
