"""The torque at which the drives give no more, from the wheel speeds of a robot that carries its load.

A drive at its limit of current accelerates a heavy robot at a constant rate. A linear law fitted to that is
slow, and takes the speeds that are not reached in time for a ceiling. Both must go together for the limit to
be seen, so that a search from the fitted law does not find it: limit, law and ceiling are scanned first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.errors import MecanumError
from mecanum_env.model import Model
from mecanum_env.units import RAD_S_PER_RPM
from sysid.fit.grip import EVIDENCE
from sysid.fit.robot_search import PlantData, faster_law, largest_command_runs

NAME: Final = "torque_limit_n_m"
_SHARES: Final = (0.5, 0.7, 1.0, 1.4, 2.0)
"""Limits that are tried, relative to the torque of the hardest acceleration."""
_POWERS: Final = (1.0, 1.5, 2.5, 5.0, 10.0)
"""Exponents of the poles of the laws that are tried: the fitted one contains the slow start."""
_SECONDS: Final = 20.0
_WINDOW_S: Final = 0.08
"""Time over which an acceleration is measured, longer than the rollers' ripple."""
_HARDEST: Final = 99.0
"""Percentile of the accelerations that counts as the hardest one; the others are noise."""


def with_torque_limit(model: Model, data: PlantData, ceiling_rpm: float) -> Model | None:
    """Return the model with a torque limit, another law and ceiling; None if the logs show no limit.

    A ceiling of the model below `ceiling_rpm`, the one that is known, may be given up for the limit. The
    `data` are of wheel speeds. It is the best of a scan on the planar plant, for a search to start from.
    """
    few = replace(data, runs=largest_command_runs(data.runs, _SECONDS))
    measured = few.measured()

    def cost(trial: Model) -> float:
        try:
            return 0.5 * float(np.sum((few.predicted(trial) - measured) ** 2))
        except MecanumError:
            return math.inf

    hardest = _hardest_n_m(model, few)
    torques = [t for share in _SHARES if (t := share * hardest) < model.robot.torque_limit_n_m]
    plain, limited = math.inf, dict[float, tuple[float, Model]]()
    for unlimited in (faster for one in with_ceilings(model, model, ceiling_rpm) for faster in _faster(one)):
        plain = min(plain, cost(unlimited))
        for torque in torques:
            trial = replace(unlimited, robot=replace(model.robot, torque_limit_n_m=torque))
            found, ceiling = cost(trial), trial.wheel.saturation_rpm
            if found < limited.get(ceiling, (math.inf, trial))[0]:
                limited[ceiling] = found, trial
    # The highest ceiling first: an estimated one is needed only if the limit does not do without.
    for ceiling in sorted(limited, reverse=True):
        least, best = limited[ceiling]
        gained = 2.0 * (plain - least) / few.variance(least, measured.size)
        if gained - math.log(measured.size) >= EVIDENCE:
            return best
    return None


def with_ceilings(model: Model, own: Model, ceiling_rpm: float) -> list[Model]:
    """Return a model with the ceiling of its `own` fit, and with the known one if that is higher."""
    fitted = own.wheel.saturation_rpm
    ceilings = dict.fromkeys((fitted, max(fitted, ceiling_rpm)))
    return [replace(model, wheel=replace(model.wheel, saturation_rpm=ceiling)) for ceiling in ceilings]


def _faster(model: Model) -> Iterator[Model]:
    """Yield the model with its law, and with faster ones."""
    for power in _POWERS:
        law = model.wheel.law if power == 1.0 else faster_law(model.wheel.law, power)
        yield replace(model, wheel=replace(model.wheel, law=law))


def _hardest_n_m(model: Model, data: PlantData) -> float:
    """Return the torque of a wheel in the hardest acceleration of the logs, driving straight."""
    found = []
    for run in data.runs:
        rows = max(1, math.ceil(_WINDOW_S / run.median_interval_s))
        for name in data.channels:
            if name in run.channels and run.time_s.size > rows:
                speed, time = run.channels[name], run.time_s
                found.append(np.abs(speed[rows:] - speed[:-rows]) / (time[rows:] - time[:-rows]))
    hardest = float(np.nanpercentile(np.concatenate(found), _HARDEST)) * RAD_S_PER_RPM
    return 0.25 * model.robot.mass_kg * model.robot.wheel_radius_m**2 * hardest
