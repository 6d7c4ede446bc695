"""Output error of a simulated robot: law, servo, inertia and grip that predict the samples of robot logs.

The law and the logarithms of the robot's parameters are fitted by least squares on measured minus simulated,
with the whole robot simulated on the logs' own commands.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import free_coordinates, stabilised_abc, stable_abc
from mecanum_env.mjcf.masses import robot_masses
from mecanum_env.model import Model
from mecanum_env.simulator import RobotPlant
from mecanum_env.statistics import rms
from mecanum_env.units import FloatArray
from sysid.compare.measured import Start
from sysid.compare.predicted import SimulationSettings, predict_all
from sysid.logs import Run
from sysid.progress import Progress, silent

_RANGE: Final = math.log(30.0)  # largest change of the logarithm of a robot's parameter
_LAW_SIZE: Final = 5  # coordinates of a law of given DC gain
_FASTER: Final = (1.5, 2.5)
"""Exponents of the poles of further initial laws: the fitted one contains the load's lag."""
_EVALUATIONS_PER_START: Final = 5
_EVALUATIONS: Final = 12  # evaluations of the search from the best start
_EVALUATIONS_ON_ROLLERS: Final = 4
"""Evaluations on the roller plant, whose contacts make further ones useless."""


@dataclass(frozen=True)
class PlantData:
    """Robot logs to predict: runs that start at rest, and the channels that are compared."""

    runs: tuple[Run, ...]
    channels: tuple[str, ...]
    sigma: Mapping[str, float]
    """Channel -> standard deviation of its noise, in its unit."""
    sigma_known: bool = True
    """Whether the noise is from repeats; else it is an upper bound, the residual of an earlier fit."""

    def residual_rms(self, model: Model) -> float:
        """Return the rms of a `model`'s residual on the planar plant, in standard deviations of the noise."""
        return rms(self.predicted(model) - self.measured())

    def variance(self, cost: float, samples: int, parameters: int = 0) -> float:
        """Return the residual variance relative to that of the noise; at least 1 if the noise is known.

        `cost` is half the sum of squares of so many `samples`, after a fit of so many `parameters`.
        """
        ratio = 2.0 * cost / max(1, samples - parameters)
        return max(1.0, ratio) if self.sigma_known else max(ratio, 1e-300)

    def measured(self) -> FloatArray:
        """Return all finite samples over their noise, run by run and channel by channel, shape (M,)."""
        return np.concatenate([part for run in self.runs for part in self._samples(run, run.channels)])

    def predicted(self, model: Model, plant: RobotPlant = "planar") -> FloatArray:
        """Return what a `model` predicts for `measured` on a `plant`, shape (M,)."""
        at_rest = [Start()] * len(self.runs)
        channels = predict_all(model, self.runs, at_rest, SimulationSettings(plant))
        parts = [self._samples(*pair) for pair in zip(self.runs, channels, strict=True)]
        return np.concatenate([values for part in parts for values in part])

    def _samples(self, run: Run, channels: Mapping[str, FloatArray]) -> list[FloatArray]:
        names = [name for name in self.channels if name in run.channels]
        return [channels[name][run.finite(name)] / self.sigma[name] for name in names]


def largest_command_runs(runs: Sequence[Run], seconds: float) -> tuple[Run, ...]:
    """Return the runs of the largest rms commands with at most so many seconds altogether, at least one."""
    chosen: list[Run] = []
    for run in sorted(runs, key=lambda run: -float(np.sqrt(np.mean(run.command.wheels_rpm**2)))):
        if not chosen or sum(r.duration_s for r in chosen) + run.duration_s <= seconds:
            chosen.append(run)
    return tuple(chosen)


@dataclass(frozen=True, eq=False)
class FoundRobot:
    """Result of a search."""

    model: Model
    cost: float
    """Half the sum of squared residuals, in variances of the noise."""
    errors: FloatArray
    """Standard errors of the logarithms of the fitted robot parameters; infinite at a bound."""
    covariance: FloatArray
    """Covariance of A-F, shape (6, 6)."""
    coupling: float
    """Factor on the grip's standard error if all is fitted together; 1 on the planar plant."""


class RobotSearch:
    """Least squares of law and robot parameters on the output of the simulated robot, from a model's.

    `tell` is called with the number of each simulation of the logs.
    """

    def __init__(
        self, model: Model, data: PlantData, plant: RobotPlant = "planar", tell: Progress = silent
    ) -> None:
        self._model, self.data, self._plant = model, data, plant
        self._tell, self._simulations = tell, 0
        # The contacts of the roller plant make small steps meaningless.
        self._step = 1e-4 if plant == "planar" else 5e-2
        self._measured = data.measured()
        self.samples = self._measured.size
        c = model.wheel.law.coefficients
        self._gain = model.wheel.law.dc_gain
        self._starts = [np.array([*free_coordinates(c[:3]), c[3], c[5]])]
        if plant == "planar":
            self._starts += [self._faster(power) for power in _FASTER]

    def _faster(self, power: float) -> FloatArray:
        """Return the coordinates of a law with poles p^power, which is faster as without load."""
        poles = np.abs(self._model.wheel.law.poles) ** power
        abc = stabilised_abc(-np.real(np.poly(poles))[1:])
        third = self._gain * (1.0 - float(np.sum(abc))) / 3.0
        return np.array([*free_coordinates(abc), third, third])

    def fit(self, names: Sequence[str]) -> FoundRobot:
        """Fit the law and the robot's parameters of some `names`."""
        low = [-np.inf] * _LAW_SIZE + [self._lowest(name) for name in names]
        high = [np.inf] * _LAW_SIZE + [_RANGE] * len(names)

        def residual(x: FloatArray) -> FloatArray:
            return self._predicted(x, names) - self._measured

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

        evaluations = _EVALUATIONS_PER_START if planar else _EVALUATIONS_ON_ROLLERS
        # The torque limit makes the residual non-smooth, where a single search can get stuck.
        starts = [np.concatenate([law, np.zeros(len(names))]) for law in self._starts]
        found = min((search(start, evaluations) for start in starts), key=lambda r: float(r.cost))
        if planar:
            found = search(found.x, _EVALUATIONS)
        # The grip is held in the search, but its uncertainty counts with that of the others.
        uncertain = [*names] if planar else [*names, "friction"]
        jacobian = _central(
            lambda x: self._predicted(x, uncertain),
            np.append(found.x, np.zeros(len(uncertain) - len(names))),
            (10.0 if planar else 2.0) * self._step,
        )
        variance = self.data.variance(float(found.cost), self.samples, found.x.size)
        information = jacobian.T @ jacobian
        inverse = np.linalg.pinv(information, rcond=1e-14)
        coupling = 1.0 if planar else math.sqrt(max(1.0, float(information[-1, -1] * inverse[-1, -1])))
        covariance = inverse[: found.x.size, : found.x.size] * variance
        errors = np.sqrt(np.diag(covariance)[_LAW_SIZE:])
        at_bound = [abs(x - b) < 1e-3 for x, b in zip(found.x[_LAW_SIZE:], low[_LAW_SIZE:], strict=True)]
        at_bound = [a or abs(x - _RANGE) < 1e-3 for a, x in zip(at_bound, found.x[_LAW_SIZE:], strict=True)]
        by_x = _central(lambda x: self._at(x, names).wheel.law.coefficients, found.x, 1e-5)
        return FoundRobot(
            self._at(found.x, names),
            float(found.cost),
            np.where(at_bound, np.inf, errors),
            by_x @ covariance @ by_x.T,
            coupling,
        )

    def _predicted(self, x: FloatArray, names: Sequence[str]) -> FloatArray:
        self._simulations += 1
        self._tell(f"{self._plant}, simulation {self._simulations}")
        return self.data.predicted(self._at(x, names), self._plant)

    def _at(self, x: FloatArray, names: Sequence[str]) -> Model:
        abc, (d, f) = stable_abc(x[:3]), x[3:5]
        inputs = self._gain * (1.0 - float(np.sum(abc)))  # D + E + F of this DC gain
        law = WheelLaw.from_coefficients([*abc, d, inputs - d - f, f], self._model.wheel.law.sample_period_s)
        logs = x[_LAW_SIZE:]
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
        # The wheels at their places contribute this much; the chassis must have a little, too.
        return max(-_RANGE, math.log(1.02 * (large - base) / robot.yaw_inertia_kg_m2))


def _central(function: Callable[[FloatArray], FloatArray], x: FloatArray, step: float) -> FloatArray:
    """Return the Jacobian by central differences of a step, shape (m, n)."""
    steps = step * np.eye(x.size)
    return np.stack([(function(x + h) - function(x - h)) / (2.0 * step) for h in steps], axis=1)
