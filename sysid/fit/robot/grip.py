"""Grip (friction of the rollers) from robot logs: a coarse scan first, then a profile of the cost.

A wheel that starts to slip slightly earlier or later moves differently afterwards, so the cost is not a
smooth function of the grip, and its local derivative is no measure of the grip's uncertainty. Value and
standard error are therefore from a parabola through a wide profile of the cost, and from the change of its
vertex when single runs are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.optimize import minimize_scalar
from scipy.stats import t as student

from mecanum_env.kinematics import TWIST
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.fit.robot.output_error import PlantData, largest_command_runs

SHOWN: Final = 0.25
"""Largest relative standard error of a parameter that counts as shown by the logs."""
EVIDENCE: Final = 10.0
"""Least difference of BIC for which a parameter is fitted."""


@dataclass(frozen=True)
class RobotParameter:
    """A parameter of the robot and what the logs show of it."""

    name: str
    value: float
    standard_error: float
    """Infinite if the logs do not show it; NaN if it was not fitted, or no valid interval is known."""
    fitted: bool
    reason: str


ROLLER_SECONDS: Final = 10.0
"""Duration of the logs that are simulated on rollers again and again [s]."""
_PROFILE_SECONDS: Final = 30.0
_GRIPS: Final = (0.15, 0.25, 0.4, 0.6, 0.8, 1.1)
_STEP: Final = 0.05  # step of the profile, in the logarithm of the grip
_HALF: Final = 4  # steps of the profile to each side of its minimum
_RECENTRINGS: Final = 3


@dataclass(frozen=True)
class GripProfile:
    """Grip at the vertex of a parabola through the profile of the cost."""

    value: float
    log_error: float
    """Standard error of its logarithm, widened for few runs; NaN if no valid one is known."""
    cost: float
    """Half the sum of squared residuals at the vertex, in variances of the noise."""
    doubt: str
    """Why there is no interval; empty if there is one."""


def profile_grip(model: Model, data: PlantData) -> GripProfile:
    """Find the grip from a profile of the cost of runs from rest, around the model's grip, the rest held.

    The standard error is by the jackknife over runs, widened so that 1.96 of it are the 95 % point of
    Student's t with one degree of freedom less than there are runs. A step of the profile is added in
    quadrature for the law's own error, which all runs share, so that the jackknife does not contain it.
    """
    few = replace(data, runs=largest_command_runs(data.runs, _PROFILE_SECONDS))
    ends = np.cumsum([replace(few, runs=(run,)).measured().size for run in few.runs])[:-1]
    measured, start = few.measured(), math.log(model.robot.friction)
    costs: dict[int, FloatArray] = {}

    def cost(k: int) -> FloatArray:
        """Return the cost of each run at k steps from the initial grip, shape (runs,)."""
        if k not in costs:
            robot = replace(model.robot, friction=math.exp(start + k * _STEP))
            error = few.predicted(replace(model, robot=robot), "rollers") - measured
            costs[k] = np.array([0.5 * float(part @ part) for part in np.split(error, ends)])
        return costs[k]

    centre = 0
    for _ in range(_RECENTRINGS):
        window = range(centre - _HALF, centre + _HALF + 1)
        least = min(window, key=lambda k: float(cost(k).sum()))
        if least == centre:
            break
        centre = least
    at = np.arange(centre - _HALF, centre + _HALF + 1, dtype=np.float64)
    table = np.stack([cost(int(k)) for k in at])
    vertex, height = _vertex(at, table.sum(axis=1))
    if not math.isfinite(vertex):
        here = float(cost(centre).sum())
        return GripProfile(
            math.exp(start + centre * _STEP), math.nan, here, "the cost over grip has no clear minimum"
        )
    value, count = math.exp(start + vertex * _STEP), len(few.runs)
    if count < 2:
        return GripProfile(value, math.nan, height, "one run alone does not tell how sure it is")
    without = np.array([_vertex(at, np.delete(table, i, axis=1).sum(axis=1))[0] for i in range(count)])
    if not np.isfinite(without).all():
        return GripProfile(value, math.nan, height, "it hangs on a single run")
    jackknife = math.sqrt((count - 1) * float(np.var(without)))
    widened = jackknife * float(student.ppf(0.975, count - 1)) / 1.96
    return GripProfile(value, _STEP * math.hypot(widened, 1.0), height, "")


def _vertex(at: FloatArray, cost: FloatArray) -> tuple[float, float]:
    """Return place and height of the minimum of a parabola through a profile, NaN if there is none."""
    a, b, c = np.polyfit(at, cost, 2)
    place = -b / (2.0 * a) if a > 0.0 else math.nan
    if not at[0] <= place <= at[-1]:
        return math.nan, math.nan
    return float(place), float(c - b * b / (4.0 * a))


def scan_grip(model: Model, given: bool, data: PlantData) -> RobotParameter:
    """Scan the friction on the roller plant, by runs from rest, unless it is `given` (measured)."""
    nominal, blind = model.robot.friction, "left: without body velocities slip does not show"
    if given:
        return RobotParameter("friction", nominal, math.nan, False, "given, so not fitted")
    if not any(name in data.channels for name in TWIST):
        return RobotParameter("friction", nominal, math.inf, False, blind)
    few = replace(data, runs=largest_command_runs(data.runs, ROLLER_SECONDS))
    measured = few.measured()

    def residual(log_friction: float) -> FloatArray:
        robot = replace(model.robot, friction=math.exp(log_friction))
        return few.predicted(replace(model, robot=robot), "rollers") - measured

    def cost(log_friction: float) -> float:
        return 0.5 * float(np.sum(residual(log_friction) ** 2))

    costs = {grip: cost(math.log(grip)) for grip in {*_GRIPS, nominal}}
    grips = sorted(costs)
    place = grips.index(min(grips, key=lambda grip: costs[grip]))
    low, high = grips[max(place - 1, 0)], grips[min(place + 1, len(grips) - 1)]
    bounds = math.log(low), math.log(high)
    best = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 0.02, "maxiter": 12})
    variance = few.variance(float(best.fun), measured.size)
    slope = (residual(best.x + 0.1) - residual(best.x - 0.1)) / 0.2
    power = float(slope @ slope)
    log_error = math.sqrt(variance / power) if power > 0.0 else math.inf
    # There is evidence of slip if neither full grip nor the plant without slip fits as well.
    sticking = 0.5 * float(np.sum((few.predicted(model) - measured) ** 2))
    rival = min(sticking, costs[nominal], costs[grips[-1]])
    evidence = 2.0 * (rival - float(best.fun)) / variance - math.log(measured.size)
    value = math.exp(float(best.x))
    if log_error <= SHOWN and evidence >= EVIDENCE and grips[0] * 1.02 < value < grips[-1] / 1.02:
        reason = "shown by slip between wheels and body"
        return RobotParameter("friction", value, value * log_error, True, reason)
    reason = "left: no slip that another grip would explain better"
    return RobotParameter("friction", nominal, nominal * log_error, False, reason)
