"""What of a robot no ruler can measure: servo stiffness, yaw inertia and grip, from robot logs.

The wheel speeds of a robot on the floor are those of its law behind a servo that carries the load. Servos of
stiffness k and inertia make a lag of m R^2 / 4k driving straight and of about I R^2 / 4 k L^2 turning (L:
half wheelbase + half track), and hard starts reach the torque limit. A law fitted to the wheel speeds alone
contains what is common to both. The stages of the fit are therefore:

1. Grip is scanned with the roller plant on a few seconds of the largest commands, as only slip shows it.
2. Law, servo and inertia are fitted together on the planar plant, which is fast; a parameter that the logs do
   not show is left. If slip shows, the roller plant is used at the grip found, and then the grip is fitted
   again, in turns: the first grip belongs to a law that contains the slip.
3. Where effects were fitted beside the law (`sysid.fit.robot.effects`), the grip is found again with them.
4. Law and robot are fitted again on the rollers, where the model will be used: they take up torque and slip.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.kinematics import TWIST
from mecanum_env.law import WheelLaw
from mecanum_env.model import Model, Robot
from mecanum_env.units import FloatArray
from sysid.compare.least_squares import ResidualProblem, fit
from sysid.compare.measured import most_active_runs, observe
from sysid.compare.model_error import Whitener
from sysid.compare.noise import measure_noise
from sysid.compare.predicted import without_engine_warnings
from sysid.compare.search_space import LawWithEffects, RefittedLaw, effect_set
from sysid.fit.effects import with_uncertainty
from sysid.fit.robot.grip import (
    EVIDENCE,
    ROLLER_SECONDS,
    SHOWN,
    GripProfile,
    RobotParameter,
    profile_grip,
    scan_grip,
)
from sysid.fit.robot.output_error import (
    FoundRobot,
    PlantData,
    RobotSearch,
    largest_command_runs,
)
from sysid.fit.statistics import Runs
from sysid.logs import Dataset, Run, Split
from sysid.logs.noise import noise_from_repeats
from sysid.progress import Progress, silent

_SOUGHT: Final = ("servo_n_m_s_rad", "yaw_inertia_kg_m2")
"""Parameters that are fitted together with the law."""
SECONDS: Final = 30.0
"""Duration of the logs of each split that the last stage simulates [s]."""
_SIMULATIONS: Final = 20
_AGREE: Final = 0.05  # relative change of the grip below which it and the law agree
_PLANAR_SECONDS: Final = 60.0
_LEAST_SIGMA: Final = 1e-6


@dataclass(frozen=True, eq=False)
class RobotFit:
    """Law and robot parameters that predict robot logs together."""

    law: WheelLaw
    """Law of the wheels without load, as the drives of the simulated robot need it."""
    robot: Robot
    parameters: tuple[RobotParameter, ...]
    covariance: FloatArray
    """Covariance of A-F, shape (6, 6)."""
    residual_before: float
    """Residual rms of the law fitted to the wheel speeds alone, in standard deviations of the noise."""
    residual_after: float
    """The same of law and robot fitted together."""


def robot_of(
    dataset: Dataset,
    runs: Runs,
    model: Model,
    given: Sequence[str],
    sigma_rpm: Mapping[str, float],
    sigma_known: bool,
    tell: Progress = silent,
) -> tuple[RobotFit | None, str]:
    """Fit the law behind the robot's servo and the robot parameters that the logs show (stages 1 and 2).

    The `runs` are those of the dataset on the law's clock, with the noise `sigma_rpm` [rpm] of each column,
    which is from repeats if `sigma_known`. The model holds the law fitted to the wheel speeds, and the robot
    as far as it is known; parameters that are `given` are not fitted. `tell` is called as by `fit_robot`.
    Return the fit, None if it does not improve the model, and a note.
    """
    at_rest = _starting_at_rest(dataset, runs, "fit")
    if not at_rest:
        return None, (
            "every fit run starts moving, so the robot cannot be simulated from rest: servo stiffness, yaw "
            "inertia and grip are left"
        )
    data = PlantData(at_rest, tuple(sigma_rpm), dict(sigma_rpm), sigma_known)
    data = _with_body_velocities(dataset, data, model)
    found = fit_robot(model, given, data, tell)
    after = replace(model, wheel=replace(model.wheel, law=found.law), robot=found.robot)
    held_out = _starting_at_rest(dataset, runs, "validation") or at_rest
    check = replace(data, runs=held_out, channels=tuple(sigma_rpm))
    before_rms, after_rms = check.residual_rms(model), check.residual_rms(after)
    if after_rms >= before_rms:
        return None, (
            "law and robot fitted together predict the validation runs no better than the law alone: servo "
            "stiffness, yaw inertia and grip are left"
        )
    named = [p.name for p in found.parameters if p.fitted]
    how = f"with {', '.join(named)}" if named else "alone (nothing of the robot shows in the logs)"
    caution = (
        "; the wheels slip in these logs, so the error is no smooth function of the parameters, and the "
        "standard errors of servo and inertia are too small"
        if "friction" in named
        else ""
    )
    return found, (
        f"the law in model.json is the one behind the robot's servo, fitted {how} through the simulated "
        "robot; with it the simulated robot's error on validation runs from rest is "
        f"{after_rms / before_rms:.0%} of what it is with the law fitted to the wheel speeds, whose lag the "
        f"simulated load would add a second time{caution}"
    )


def _starting_at_rest(dataset: Dataset, runs: Runs, split: Split) -> tuple[Run, ...]:
    moving = {run.name.split(" ")[0] for wheel in runs[split].values() for run in wheel if run.initial_rpm}
    return tuple(run for run in dataset.split(split) if run.file not in moving)


def wheels_at_rest(
    dataset: Dataset, runs: Runs, sigma_rpm: Mapping[str, float], sigma_known: bool
) -> PlantData | None:
    """Return the wheel speeds of the fit runs that start at rest; None if none does.

    The `dataset`, its `runs`, the noise `sigma_rpm` and whether that is known (`sigma_known`) are as in
    `robot_of`.
    """
    at_rest = _starting_at_rest(dataset, runs, "fit")
    if not at_rest:
        return None
    return PlantData(
        largest_command_runs(at_rest, _PLANAR_SECONDS), tuple(sigma_rpm), dict(sigma_rpm), sigma_known
    )


def _with_body_velocities(dataset: Dataset, data: PlantData, model: Model) -> PlantData:
    """Add the body velocities that all runs have; their noise is from repeats or the model's residual."""
    names = [name for name in TWIST if all(name in run.channels for run in data.runs)]
    repeats = noise_from_repeats(dataset.runs) or {}
    sigma = dict(data.sigma)
    for name in names:
        alone = replace(data, channels=(name,), sigma={name: 1.0})
        std = repeats[name].std if name in repeats else np.std(alone.predicted(model) - alone.measured())
        sigma[name] = max(float(std), _LEAST_SIGMA)
    return replace(data, channels=(*data.channels, *names), sigma=sigma)


def fit_robot(model: Model, given: Sequence[str], data: PlantData, tell: Progress = silent) -> RobotFit:
    """Fit law, servo stiffness and yaw inertia together, then grip, except those parameters that are `given`.

    The law has full order here, even if a lower one sufficed for the wheel speeds alone. The runs start at
    rest; body velocities among their channels are used for the grip only. `tell` is called with the plant and
    the number of each simulation.
    """
    wheels = replace(
        data,
        runs=largest_command_runs(data.runs, _PLANAR_SECONDS),
        channels=tuple(name for name in data.channels if name.startswith("speed_")),
    )
    before = wheels.residual_rms(model)
    sought = [name for name in _SOUGHT if name not in given]
    grip = scan_grip(model, "friction" in given, data)
    if grip.fitted:
        found, shown, errors, grip = _in_turns(model, sought, grip, data, tell)
    else:
        found, shown, errors = _shown(RobotSearch(model, wheels, tell=tell), sought)
    parameters = [
        _parameter(name, found.model.robot, name in shown, name in given, errors.get(name, math.nan))
        for name in _SOUGHT
    ]
    return RobotFit(
        law=found.model.wheel.law,
        robot=found.model.robot,
        parameters=(*parameters, grip),
        covariance=found.covariance,
        residual_before=before,
        residual_after=wheels.residual_rms(found.model),
    )


def grip_beside(
    model: Model, dataset: Dataset, given: Sequence[str], data: PlantData, nominal: float
) -> RobotParameter:
    """Return the grip beside effects that were fitted on the plant without slip.

    A law alone takes other causes for slip: a body that follows its wheels late looks as if these spun.

    Args:
        model: law, robot and effects.
        dataset: the logs.
        given: names of the robot's parameters that were measured.
        data: runs of the fit that start at rest, with their wheel speeds.
        nominal: the grip as measured, or where the logs do not show it.
    """
    model = replace(model, robot=replace(model.robot, friction=nominal))
    data = _with_body_velocities(dataset, data, model)
    grip = scan_grip(model, "friction" in given, data)
    if not grip.fitted:
        return grip
    robot = replace(model.robot, friction=grip.value)
    return _profiled(grip, profile_grip(replace(model, robot=robot), data))


def _profiled(scanned: RobotParameter, found: GripProfile, coupling: float = 1.0) -> RobotParameter:
    """Return a grip as its profile has it; how far that is from the scan is part of its standard error."""
    reason = scanned.reason + (f"; no interval: {found.doubt}" if found.doubt else "")
    error = found.value * math.hypot(found.log_error * coupling, math.log(found.value / scanned.value))
    return replace(scanned, value=found.value, standard_error=error, reason=reason)


def _in_turns(
    model: Model, sought: Sequence[str], grip: RobotParameter, data: PlantData, tell: Progress
) -> tuple[FoundRobot, list[str], dict[str, float], RobotParameter]:
    """Fit law and robot on rollers at a grip, then the grip with them, until they agree.

    Return the three results of `_shown`, and the grip.
    """
    used = replace(data, runs=largest_command_runs(data.runs, ROLLER_SECONDS))

    def search(law: WheelLaw, friction: float) -> RobotSearch:
        wheel, robot = replace(model.wheel, law=law), replace(model.robot, friction=friction)
        return RobotSearch(replace(model, wheel=wheel, robot=robot), used, "rollers", tell)

    # Which parameters the logs show is judged with a law that no longer contains the slip.
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
    # Grip and law depend on each other; the change of the grip with the law is part of its standard error.
    robot = replace(found.model.robot, friction=after.value)
    found = replace(found, model=replace(found.model, robot=robot))
    return found, shown, errors, _profiled(grip, after, found.coupling)


def _shown(search: RobotSearch, sought: Sequence[str]) -> tuple[FoundRobot, list[str], dict[str, float]]:
    """Fit the parameters sought, without the least certain until the logs show all that are left.

    Return the best fit, the names of its parameters, and the last standard errors of all logarithms sought.
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


def on_rollers(model: Model, dataset: Dataset, robot: Sequence[str]) -> tuple[Model, str]:
    """Fit the law, effects fitted with it, and some parameters of the `robot` again on the rollers (stage 4).

    Return the model fitted to the fit runs, or the given one if that predicts the validation runs as well,
    and a note.
    """
    runs = dataset.split("fit")
    law = RefittedLaw(model, tuple(robot))
    plain = replace(model, uncertainty={})
    with without_engine_warnings():
        problem = _problem(plain, dataset, runs)
        effects = effect_set(
            plain, list(model.uncertainty.get("effects") or {}), scale=problem.settings.scale
        )
        candidate = LawWithEffects(law, effects)
        found = fit(problem, candidate, candidate.start(), most=_SIMULATIONS)
        if found is None:
            return model, "the law was not fitted on the rollers: they cannot be simulated with it"
        check = _problem(plain, dataset, dataset.split("validation") or runs)
        fitted = candidate.model(plain, found.place)
        after = check.residual(fitted)
    if after is None or float(after @ after) >= float(check.base_residual @ check.base_residual):
        return model, "law and servo fitted again on the rollers predict validation runs no better: left"
    share = float(np.linalg.norm(after) / np.linalg.norm(check.base_residual))
    fitted = replace(fitted, uncertainty=model.uncertainty)
    if effects.names:
        # The rollers have moved the effects, so what was stated on the planar plant holds no more.
        fitted, _ = with_uncertainty(model, found, max(1.0, found.cost / problem.size))
    return fitted, (
        f"law{''.join(', ' + name for name in robot)} fitted again on the rollers: there the error on "
        f"validation runs is {share:.0%} of what it is with the planar plant's"
    )


def _problem(model: Model, dataset: Dataset, runs: Sequence[Run]) -> ResidualProblem:
    observations = observe(replace(dataset, runs=most_active_runs(runs, SECONDS)))
    return ResidualProblem(model, Whitener(observations, measure_noise(dataset, observations), None))
