"""The stage of a fit that looks at the robot around the wheels, for robot logs.

The last stage of a fit to robot logs: on the rollers, where the model will be used.

The stages before it work on the planar plant, which is much faster and has no slip. A law and a servo that
are right there are a little wrong on the rollers, which take up torque and slip. Here law, servo and yaw
inertia are moved until the robot on its rollers does what the fit runs say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from sysid.compare.fitted import RefittedLaw, fit
from sysid.compare.noise import measure_noise
from sysid.compare.observations import observe
from sysid.compare.problem import ResidualProblem
from sysid.compare.simulator import without_engine_warnings
from sysid.compare.subset import most_active_runs
from sysid.compare.whitening import Whitener
from sysid.fit.metrics import Runs
from sysid.fit.plant_prediction import BODY_VELOCITY, PlantData
from sysid.fit.robot_parameters import RobotFit, fit_robot
from sysid.logs import Dataset, Run, Split
from sysid.logs.noise import noise_from_repeats

_LEAST_SIGMA: Final = 1e-6


def robot_of(
    dataset: Dataset,
    runs: Runs,
    model: Model,
    given: Sequence[str],
    sigma_rpm: Mapping[str, float],
    sigma_known: bool,
) -> tuple[RobotFit | None, str]:
    """Fit what of the robot the logs show, and the law behind its servo; None, with the reason, if nothing.

    Args:
        dataset: robot logs.
        runs: its data on the law's clock.
        model: the law fitted to the wheel speeds, and the robot as far as it is known.
        given: names of robot parameters that were measured.
        sigma_rpm: noise of each wheel-speed column [rpm].
        sigma_known: that noise is from repeats, not from the residuals of the fit.
    """
    fit = _starting_at_rest(dataset, runs, "fit")
    if not fit:
        return None, (
            "every fit run starts moving, so the robot cannot be simulated from rest: servo stiffness, yaw "
            "inertia and grip are left"
        )
    data = PlantData(fit, tuple(sigma_rpm), dict(sigma_rpm), sigma_known)
    data = _with_body_velocities(dataset, data, model)
    found = fit_robot(model, given, data)
    after = replace(model, wheel=replace(model.wheel, law=found.law), robot=found.robot)
    held_out = _starting_at_rest(dataset, runs, "validation") or fit
    check = replace(data, runs=held_out, channels=tuple(sigma_rpm))
    before_rms, after_rms = check.spread(model), check.spread(after)
    if after_rms >= before_rms:
        return None, (
            "law and robot fitted together predict the validation runs no better than the law alone: servo "
            "stiffness, yaw inertia and grip are left"
        )
    named = [p.name for p in found.parameters if p.fitted]
    said = f"with {', '.join(named)}" if named else "alone (nothing of the robot shows in the logs)"
    caution = (
        "; the wheels slip in these logs, which makes the error rough: the standard errors of servo and "
        "inertia are too small then"
        if "friction" in named
        else ""
    )
    return found, (
        f"the law in model.json is the one behind the robot's servo, fitted {said} through the simulated "
        "robot; with it the simulated robot's error on validation runs from rest is "
        f"{after_rms / before_rms:.0%} of what it is with the law fitted to the wheel speeds, whose lag the "
        f"simulated load would add a second time{caution}"
    )


def _starting_at_rest(dataset: Dataset, runs: Runs, split: Split) -> tuple[Run, ...]:
    moving = {run.name.split(" ")[0] for wheel in runs[split].values() for run in wheel if run.initial_rpm}
    return tuple(run for run in dataset.split(split) if run.file not in moving)


def _with_body_velocities(dataset: Dataset, data: PlantData, model: Model) -> PlantData:
    """Add the body velocities that every run has; their noise is from repeats, or what the model leaves."""
    names = [name for name in BODY_VELOCITY if all(name in run.channels for run in data.runs)]
    repeats = noise_from_repeats(dataset.runs) or {}
    sigma = dict(data.sigma)
    for name in names:
        if name in repeats:
            sigma[name] = max(repeats[name].std, _LEAST_SIGMA)
        else:
            alone = replace(data, channels=(name,), sigma={name: 1.0})
            error = alone.predicted(model) - alone.measured()
            sigma[name] = max(float(np.std(error)), _LEAST_SIGMA)
    return replace(data, channels=(*data.channels, *names), sigma=sigma)


SECONDS: Final = 30.0
"""Of log that is simulated, of each split."""
_SIMULATIONS: Final = 20


def on_rollers(model: Model, dataset: Dataset, robot: Sequence[str]) -> tuple[Model, str]:
    """Return a model that is right on the rollers, and a sentence; the model as it was if that is no better.

    Args:
        model: fitted on the planar plant.
        dataset: robot logs; fit runs decide, validation runs check.
        robot: names of the robot's parameters that may move.
    """
    runs = dataset.split("fit")
    candidate = RefittedLaw(model, tuple(robot))
    plain = replace(model, uncertainty={})
    with without_engine_warnings():
        problem = _problem(plain, dataset, runs)
        found = fit(problem, candidate, candidate.start(), most=_SIMULATIONS)
        if found is None:
            return model, "the law was not fitted on the rollers: they cannot be simulated with it"
        check = _problem(plain, dataset, dataset.split("validation") or runs)
        moved = candidate.model(plain, found.place)
        after = check.residual(moved)
    if after is None or float(after @ after) >= float(check.base_residual @ check.base_residual):
        return model, "law and servo fitted again on the rollers predict validation runs no better: left"
    share = float(np.linalg.norm(after) / np.linalg.norm(check.base_residual))
    return replace(moved, uncertainty=model.uncertainty), (
        f"law{''.join(', ' + name for name in robot)} fitted again on the rollers: there the error on "
        f"validation runs is {share:.0%} of what it is with the planar plant's"
    )


def _problem(model: Model, dataset: Dataset, runs: Sequence[Run]) -> ResidualProblem:
    observations = observe(replace(dataset, runs=most_active_runs(runs, SECONDS)))
    return ResidualProblem(model, Whitener(observations, measure_noise(dataset, observations), None))
