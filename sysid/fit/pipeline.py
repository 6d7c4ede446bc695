"""From a dataset to a model: the whole fit as one function call."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.kinematics import require_mecanum
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model
from sysid.fit.drive import (
    STAGE,
    LawFit,
    fit_law,
    latency,
    wheel_model,
    with_times_by,
    with_times_of_commands,
)
from sysid.fit.effects import DriveEffects, HeldOut, find_drive_effects
from sysid.fit.options import FitOptions
from sysid.fit.robot import RobotFit, find_robot_effects, grip_beside, robot_of, wheels_at_rest
from sysid.logs import Dataset
from sysid.progress import Progress, silent, within

_SLOWEST: Final = 2.0
"""Longest time constant of a pole beside effects, in the longest time for which a command is held. After as
long as one time constant 63 % of a response are seen; of twice that, 39 %. Assumed."""

_TIMED: Final = 0.5
"""Error with a time for each change of the command, relative to that without, below which these are adopted.
They are estimated from the very runs that judge them, so that they lower any error. Assumed."""


@dataclass(frozen=True)
class Fit(LawFit):
    """A fitted wheel, what it does besides its law, and the robot around it."""

    drive_effects: DriveEffects | None = None
    """From bench logs: what the drive does besides its law; None if the law alone is enough."""
    robot: RobotFit | None = None
    """From robot logs: the law behind the servo and the robot parameters that they show."""


def fit_dataset(dataset: Dataset, options: FitOptions | None = None, progress: Progress = silent) -> Fit:
    """Fit the wheel law to a dataset.

    These are bench logs, or robot logs with wheel speeds. `progress` is called before each long step.

    Raises:
        InputError: no run to fit, no wheel speed, a robot log of other wheels than four Mecanum wheels, a law
            of each wheel asked of bench logs, or data to which no law can be fitted.
    """
    options = options or FitOptions()
    if dataset.level == "robot":
        require_mecanum(options.robot, "robot logs are")
    elif options.per_wheel:
        raise InputError("--per-wheel: these are logs of one wheel on the bench; only a robot has more")
    if not dataset.split("fit"):
        raise InputError(f'{dataset.name}: no run has split = "fit"; set one in dataset.toml')
    law = fit_law(dataset, options, progress)
    found = _beside_law(law, progress)
    if dataset.level == "bench" and options.delay_s is None:
        found = _with_times(law, found, progress)
    if dataset.level == "robot":
        found = _with_robot(found, progress)
    heavy = tuple(one.note(channel) for channel, one in found.tails.items())
    return replace(found, notes=(*heavy, *found.notes))


def _beside_law(law: LawFit, progress: Progress) -> Fit:
    """Return the fit to bench logs with the effects of the drive, if these are wanted."""
    found = Fit(**vars(law))
    if law.dataset.level != "bench" or law.options.effects == "off":
        return found
    return _with_drive_effects(found, progress)


def _with_times(law: LawFit, plain: Fit, progress: Progress) -> Fit:
    """Return the fit with each change of the command at a time of its own, if that is much better.

    Friction and limits delay some changes more than others. Such times must therefore be worth it beside
    the effects of the drive, too. Times between rows are estimated once more with the effects. Nothing is
    tried where the noise of the sensor alone leaves too much of the error.
    """
    stamped_rpm = _held_out_rpm(plain)
    if HeldOut.of(law.dataset).noise_rpm >= _TIMED * stamped_rpm:
        return plain
    timed = with_times_of_commands(law, progress)
    if timed is law:
        return plain
    tell = within(progress, STAGE)
    found = _beside_law(replace(timed, tails=law.tails), tell)
    if found.drive_effects is not None and found.link is not None and found.link.between_rows:
        again = with_times_by(found.drive_effects.model, timed, law, progress)
        again = _beside_law(replace(again, tails=law.tails), tell)
        found = min(found, again, key=_held_out_rpm)
    timed_rpm = _held_out_rpm(found)
    if timed_rpm >= _TIMED * stamped_rpm:
        return plain
    note = (
        f"with a time for each change of the command the held-out error is {timed_rpm:.3g} rpm, with the "
        f"times of the log {stamped_rpm:.3g} rpm"
    )
    return replace(found, notes=(*found.notes, note))


def _held_out_rpm(fit: Fit) -> float:
    """Return the error of a fit to bench logs on the validation runs [rpm], as that of effects is told."""
    if fit.drive_effects is not None:
        return fit.drive_effects.after_rpm
    found = fit.estimate
    model = Model(wheel_model(fit.path, found), fit.options.robot, latency(found))
    return HeldOut.of(fit.dataset).errors(model)[1]


def _with_drive_effects(fit: Fit, progress: Progress) -> Fit:
    """Return a fit to bench logs with the effects that its drive has besides the law.

    They are looked for beside the law of the fit, and beside one whose DC gain is free.
    """
    options, found, path = fit.options, fit.estimate, fit.path
    alone = Model(wheel_model(path, found), options.robot, latency(found))
    others = []
    if options.unit_gain:
        free = fit.with_free_gain()
        gain = free.law.dc_gain
        if gain > 0.0 and math.isfinite(gain):
            law = replace(free.law, D=free.law.D / gain, E=free.law.E / gain, F=free.law.F / gain)
            wheel = replace(wheel_model(path, free), law=law)
            others.append(Model(wheel, options.robot, {**latency(free), "speed_gain": {"gain": gain}}))
    slowest_s = _SLOWEST * fit.longest_hold_s
    largest_pole = min(POLE_LIMIT, math.exp(-found.law.sample_period_s / slowest_s))
    effects = find_drive_effects(fit.dataset, alone, others, largest_pole, progress)
    if effects is None:
        return fit
    return replace(fit, drive_effects=effects, notes=(*fit.notes, effects.note))


def _with_robot(fit: Fit, progress: Progress) -> Fit:
    """Return a fit to robot logs with servo stiffness, yaw inertia and grip, and the law behind the servo."""
    options = fit.options
    if options.per_wheel:
        note = (
            "with a law for each wheel the robot is not fitted: servo stiffness, yaw inertia and grip are "
            "left as given (fit without --per-wheel to have them)"
        )
        return replace(fit, notes=(*fit.notes, note))
    progress(stage := "servo, inertia and grip")
    tell, given = within(progress, stage), options.robot_given
    model = Model(wheel_model(fit.path, fit.estimate), options.robot, latency(fit.estimate))
    noise = fit.sigma_rpm, fit.sigma_from_repeats
    robot, note = robot_of(fit.dataset, fit.runs, model, given, *noise, tell)
    alone = replace(fit, robot=robot, notes=(*fit.notes, note))
    data = wheels_at_rest(fit.dataset, fit.runs, *noise)
    if options.effects == "off" or data is None:
        return alone
    if robot is not None:
        model = replace(model, wheel=replace(model.wheel, law=robot.law), robot=robot.robot)
    found = find_robot_effects(fit.dataset, model, given, data, tell)
    if found is None:
        return alone
    tell("grip")
    grip = grip_beside(found.drive.model, fit.dataset, given, data, options.robot.friction)
    together = RobotFit(
        law=found.drive.model.wheel.law,
        robot=replace(found.drive.model.robot, friction=grip.value),
        parameters=(*found.parameters, grip),
        covariance=found.drive.covariance,
        residual_before=found.before,
        residual_after=found.after,
    )
    notes = (*fit.notes, found.note, found.drive.note)
    return replace(fit, drive_effects=found.drive, robot=together, notes=notes)
