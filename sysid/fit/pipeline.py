"""From a dataset to a model: the whole fit as one function call."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.kinematics import require_mecanum
from mecanum_env.law import WheelLaw
from mecanum_env.law.stability import POLE_LIMIT
from mecanum_env.model import Model, Robot, Wheel
from sysid.fit.command_path import CommandPath, infer_command_path
from sysid.fit.drive_choice import (
    Search,
    choose_clock,
    choose_drive,
    delay_is_vague,
    drive_notes,
    gain_notes,
    longest_hold_s,
    pooled,
    runs_by_split,
)
from sysid.fit.drive_effects import DriveEffects, find_drive_effects
from sysid.fit.estimators import DEFAULT_METHOD, Estimate
from sysid.fit.late_links import LINK_TURNS, LateLink, late_link, link_is_worth_having
from sysid.fit.metrics import MethodMetrics, Runs, method_metrics
from sysid.fit.robot_effects import find_robot_effects
from sysid.fit.robot_parameters import RobotFit, robot_of, wheels_at_rest
from sysid.fit.statistics import ResidualTests, Uncertainty, residual_tests, uncertainty
from sysid.fit.weights import weighted_beside_error
from sysid.fit.wheel_data import wheel_columns
from sysid.logs import Dataset
from sysid.logs.noise import noise_from_repeats
from sysid.logs.tails import Tails, weighted_down
from sysid.progress import Progress, peak_memory_mib, silent, with_peak_memory, within

SLOWEST: Final = 2.0
"""Longest time constant of a pole beside effects, in the longest time for which a command is held. After as
long as one time constant 63 % of a response are seen; of twice that, 39 %. Assumed."""
_LEAST_SIGMA: Final = 1e-6  # rpm, for repeats without noise


@dataclass(frozen=True)
class FitOptions:
    """Options of a fit."""

    methods: tuple[str, ...] = (DEFAULT_METHOD,)
    """Methods to run; the model is from the first."""
    starts: int = 10
    """Starting points of each method."""
    seed: int = 0
    """Seed of the random starting points."""
    unit_gain: bool = True
    """Whether the DC gain is held at exactly 1."""
    delay_s: float | None = None
    """Transport delay [s]; None: estimated, and adopted on evidence."""
    effects: Literal["auto", "off"] = "auto"
    """Whether bench logs may show that the drive does more than its law; see `drive_effects`."""
    per_wheel: bool = False
    """Whether a law is fitted to each wheel, too."""
    sample_period_s: float | None = None
    command_period_s: float | None = None
    quantum_rpm: float | None = None
    saturation_rpm: float | None = None
    robot: Robot = field(default_factory=Robot)
    """What is known of the robot, with the packaged values for the rest."""
    robot_given: tuple[str, ...] = ()
    """Names of the robot's parameters that were measured and are not fitted."""


@dataclass(frozen=True)
class Fit:
    """A fitted wheel and the evidence for it."""

    dataset: Dataset
    path: CommandPath
    options: FitOptions
    sigma_rpm: Mapping[str, float]
    """Noise of each wheel-speed column [rpm], by which residuals are weighted."""
    sigma_from_repeats: bool
    """Whether the noise is from repeats; else it is the residual of the fit."""
    estimate: Estimate
    """By the first method, on the fit runs of all wheels."""
    uncertainty: Uncertainty
    residual_tests: ResidualTests
    methods: Mapping[str, MethodMetrics]
    wheels: Mapping[str, Estimate]
    """With `per_wheel`: wheel name -> its own estimate."""
    runs: Runs
    drive_effects: DriveEffects | None = None
    """From bench logs: what the drive does besides its law; None if the law alone is enough."""
    link: LateLink | None = None
    """From bench logs: the link, if it delays every change of the command differently. `dataset`, `path` and
    `runs` are then those of the logs with their changes moved to where they acted."""
    tails: Mapping[str, Tails] = field(default_factory=dict)
    """Channel -> its noise, where that has heavy tails and outliers were weighted down."""
    robot: RobotFit | None = None
    """From robot logs: the law behind the servo and the robot parameters that they show."""
    notes: tuple[str, ...] = field(default=())
    """What was inferred, assumed or could not be determined, in sentences."""

    @property
    def law(self) -> WheelLaw:
        """The fitted law."""
        return self.estimate.law


def fit_dataset(dataset: Dataset, options: FitOptions | None = None, progress: Progress = silent) -> Fit:
    """Fit the wheel law to a dataset.

    These are bench logs, or robot logs with wheel speeds. `progress` is called before each long step.

    Raises:
        InputError: no run to fit, no wheel speed, a robot log of other wheels than four Mecanum wheels, or
        data
            to which no law can be fitted.
    """
    options = options or FitOptions()
    if dataset.level == "robot":
        require_mecanum(options.robot, "robot logs are")
    if not dataset.split("fit"):
        raise InputError(f'{dataset.name}: no run has split = "fit"; set one in dataset.toml')
    plain = dataset
    dataset, tails = weighted_down(plain)
    path = infer_command_path(
        dataset,
        sample_period_s=options.sample_period_s,
        command_period_s=options.command_period_s,
        quantum_rpm=options.quantum_rpm,
        saturation_rpm=options.saturation_rpm,
    )
    search = Search(options.methods[0], options.seed, options.unit_gain, path, 1.0)
    dataset = weighted_beside_error(plain, dataset, tails, search)
    found = _fit_behind(path, dataset, options, progress)
    if dataset.level == "bench" and options.delay_s is None:
        found = _through_late_link(path, found, progress)
    if dataset.level == "bench" and options.effects == "auto":
        # Beside the delays of the link, if it has such, since these are no effect of the drive.
        found = _with_drive_effects(found, progress)
    if dataset.level == "robot":
        found = _with_robot(found, progress)
    heavy = tuple(one.note(channel) for channel, one in tails.items())
    return replace(found, tails=tails, notes=(*heavy, *found.notes))


def _through_late_link(path: CommandPath, plain: Fit, progress: Progress) -> Fit:
    """Return the fit with each change of the command at its own delay, where the logs show such delays.

    The delays of the changes and the law are estimated in turns. `path` is that which the logs suggest, and
    the fit is `plain` with one delay for all changes.
    """
    dataset, options = plain.dataset, plain.options
    quick = replace(options, methods=options.methods[:1], starts=min(3, options.starts))
    found, link = plain, None
    for turn in range(LINK_TURNS):
        model = Model(wheel_model(found.path, found.estimate), options.robot)
        link = late_link(dataset, path, model)
        if link is None:
            return plain
        progress(f"delays of the commands: {turn + 1}")
        last = turn == LINK_TURNS - 1
        found = _fit_behind(link.path, link.dataset, options if last else quick, progress)
    if link is None or not link_is_worth_having(plain.runs, plain.estimate, found.runs, found.estimate):
        return plain
    note = link.note(plain.estimate, plain.runs, found.estimate, found.runs)
    return replace(found, link=link, notes=(*path.notes, note, *found.notes))


def _fit_behind(path: CommandPath, dataset: Dataset, options: FitOptions, progress: Progress) -> Fit:
    """Fit the law behind a command path, whose clock is tried against the platform's where it is a guess."""
    notes = list(path.notes)
    # In the order of the log: that of a set, and so the last digits of the result, would vary between runs.
    columns = dict.fromkeys(column for run in dataset.runs for column in wheel_columns(run).values())
    repeats = noise_from_repeats(dataset.runs) or {}
    known = all(column in repeats for column in columns)
    sigma = {c: max(repeats[c].std, _LEAST_SIGMA) if c in repeats else 1.0 for c in columns}
    share = _independent_share(dataset)
    method, given_s = options.methods[0], options.delay_s or 0.0
    search = Search(method, options.seed, options.unit_gain, path, share)

    progress("clock of the commands")
    (search, plain, runs, note), memory = with_peak_memory(
        lambda: choose_clock(dataset, search, sigma, options.command_period_s is not None or path.exact)
    )
    notes += [note] if note else []
    path = search.path
    if not known:
        sigma = _residual_sigma(sigma, plain)
        runs = runs_by_split(dataset, path, sigma)
    if given_s or not known:
        plain = search.run(pooled(runs["fit"]), delay_s=given_s)
    progress("delay and ceiling")
    drive = choose_drive(runs, search, plain, delay=options.delay_s is None)
    progress(f"{method}: {options.starts} starts")
    found = _all_starts(runs, search, options, drive)
    if not known:
        sigma = _residual_sigma(sigma, found)
        scale = found.cost / (0.5 * _samples(runs))
        found = replace(found, cost=found.cost / max(scale, 1e-300))
        runs = runs_by_split(dataset, path, sigma)
        notes.append("no repeats: the noise is taken from the fit's own residuals, model error included")
    notes += drive_notes(dataset, path, found, options.delay_s is None)
    methods = {method: method_metrics(found, runs, memory)}
    for name in options.methods[1:]:
        progress(name)
        methods[name] = _other_method(runs, search, options, found, name)
    wheels = {}
    if options.per_wheel:
        for wheel, data in runs["fit"].items():
            progress(f"{method}: {wheel}")
            wheels[wheel] = search.run(
                data, starts=options.starts, delay_s=found.delay_s, saturation_rpm=found.saturation_rpm
            )
    progress("uncertainty")
    notes += gain_notes(runs, search, found)
    data = pooled(runs["fit"])
    return Fit(
        dataset=dataset,
        path=path,
        options=options,
        sigma_rpm=sigma,
        sigma_from_repeats=known,
        estimate=found,
        uncertainty=uncertainty(data, found, effective_samples=max(1.0, share * _samples(runs))),
        residual_tests=residual_tests(data, found),
        methods=methods,
        wheels=wheels,
        runs=runs,
        notes=tuple(notes),
    )


def _with_drive_effects(fit: Fit, progress: Progress) -> Fit:
    """Return a fit to bench logs with the effects that its drive has besides the law.

    They are looked for beside the law of the fit, and beside one whose DC gain is free.
    """
    dataset, runs, options, found, path = fit.dataset, fit.runs, fit.options, fit.estimate, fit.path
    share = _independent_share(dataset)
    search = Search(options.methods[0], options.seed, options.unit_gain, path, share)
    alone = Model(wheel_model(path, found), options.robot, latency(found))
    others = []
    if options.unit_gain:
        free = search.run(
            pooled(runs["fit"]),
            starts=options.starts,
            delay_s=found.delay_s,
            unit_gain=False,
        )
        gain = free.law.dc_gain
        if gain > 0.0 and math.isfinite(gain):
            law = replace(free.law, D=free.law.D / gain, E=free.law.E / gain, F=free.law.F / gain)
            wheel = replace(wheel_model(path, free), law=law)
            others.append(Model(wheel, options.robot, {**latency(free), "speed_gain": {"gain": gain}}))
    slowest_s = SLOWEST * longest_hold_s(runs)
    largest_pole = min(POLE_LIMIT, math.exp(-found.law.sample_period_s / slowest_s))
    effects = find_drive_effects(dataset, alone, others, largest_pole, progress)
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
    # The grip is that of the first fit: on the planar plant nothing shows it.
    grip = [p for p in robot.parameters if p.name == "friction"] if robot else []
    together = RobotFit(
        law=found.drive.model.wheel.law,
        robot=found.drive.model.robot,
        parameters=(*found.parameters, *grip),
        covariance=found.drive.covariance,
        residual_before=found.before,
        residual_after=found.after,
    )
    notes = (*fit.notes, found.note, found.drive.note)
    return replace(fit, drive_effects=found.drive, robot=together, notes=notes)


def wheel_model(path: CommandPath, found: Estimate) -> Wheel:
    """Return the wheel of a model: the law that was `found`, with its ceiling, behind the command `path`."""
    return Wheel(
        law=found.law,
        command_period_s=path.command_period_s,
        command_quantum_rpm=path.quantum_rpm,
        saturation_rpm=min(found.saturation_rpm, path.saturation_rpm),
    )


def latency(found: Estimate) -> dict[str, dict[str, float]]:
    """Return the effects of a model: the delay that was `found`, if there is one."""
    return {"command_latency": {"delay_s": found.delay_s}} if found.delay_s > 0.0 else {}


def _independent_share(dataset: Dataset) -> float:
    """Return the share of independent samples among the wheel speeds of a `dataset`'s fit runs, above 0 to 1.

    Values that a slow sensor repeats, and channels that copy another, are not independent.
    """
    held = {(f.file, f.channel): f.value for f in dataset.findings if f.kind == "held_samples"}
    copies = {(f.file, f.channel) for f in dataset.findings if f.kind == "same_channel"}
    total = independent = 0.0
    for run in dataset.split("fit"):
        for column in wheel_columns(run).values():
            count = float(run.finite(column).sum())
            total += count
            if (run.file, column) not in copies:
                independent += count * (1.0 - held.get((run.file, column), 0.0))
    return independent / total if independent > 0.0 else 1.0


def _residual_sigma(sigma: Mapping[str, float], found: Estimate) -> dict[str, float]:
    """Return all noises scaled by one factor so that they agree with the estimate's residual."""
    scale = found.rms_rpm / math.sqrt(float(np.mean([value**2 for value in sigma.values()])))
    return {column: max(value * scale, _LEAST_SIGMA) for column, value in sigma.items()}


def _samples(runs: Runs) -> int:
    return sum(len(run.speed_rpm) for run in pooled(runs["fit"]))


def _all_starts(runs: Runs, search: Search, options: FitOptions, drive: Estimate) -> Estimate:
    """Run all starts of the law with the chosen delay and ceiling held, then fit all parameters together."""
    data = pooled(runs["fit"])
    free = [name for name in ("delay_s", "saturation_rpm") if name in drive.free]
    found = search.run(
        data, starts=options.starts, delay_s=drive.delay_s, saturation_rpm=drive.saturation_rpm
    )
    if not free:
        return found
    held = drive.delay_s if "delay_s" not in free else 0.0
    together = search.run(data, free=free, delay_s=held, initial=[found.coefficients.tolist()])
    if delay_is_vague(data, together):
        whole = round(together.delay_s / search.path.sample_period_s) * search.path.sample_period_s
        free = [name for name in free if name != "delay_s"]
        together = search.run(data, free=free, delay_s=whole, initial=[together.coefficients.tolist()])
    return replace(together, starts=found.starts, seconds=found.seconds + together.seconds)


def _other_method(
    runs: Runs, search: Search, options: FitOptions, found: Estimate, name: str
) -> MethodMetrics:
    """Run another method with the delay and the ceiling of the first."""
    data = pooled(runs["fit"])

    def run(starts: int) -> Estimate:
        return search.run(
            data, method=name, starts=starts, delay_s=found.delay_s, saturation_rpm=found.saturation_rpm
        )

    return method_metrics(run(options.starts), runs, peak_memory_mib(lambda: run(1)))
