"""What lies before the law: the clock of the commands, a transport delay, a ceiling; adopted on evidence.

Each additional parameter improves the fit of the fit runs a little, whatever the truth. One is therefore
adopted only if its improvement is significant, if it also improves the prediction of the validation runs,
and if the law's own zeros cannot do the same. Each choice is made by a single start from the
Steiglitz-McBride law; `behind_path` then runs all starts with the chosen structure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.statistics import VERY_STRONG, rms
from mecanum_env.units import FloatArray
from sysid.fit.drive.command_path import COMMAND_PERIOD_S
from sysid.fit.drive.fitter import LawFitter
from sysid.fit.drive.wheel_data import pooled, runs_by_split
from sysid.fit.estimators import Estimate, WheelRun
from sysid.fit.statistics import Runs, residual, uncertainty
from sysid.logs import Dataset

_WORTH: Final = 0.02  # least relative decrease of the validation error for which a parameter is adopted
_ENOUGH_TICKS: Final = 30_000  # number of ticks that suffice to compare structures
_OTHER_CLOCK: Final = 0.5
"""Largest cost, relative to that with the commands as stamped, with which another clock is believed. Assumed.
Of 15 drawn drives (of bench seeds 300-399) that clock made the cost of ten 1.3 to 42 times as large, changed
nothing for two, and lowered that of three, where the law fits badly, to .75, .80 and .90."""
_WITHOUT_CEILING: Final = 0.5
"""Largest squared error without the assumed ceiling, relative to that with it, with which it is dropped.
Assumed, as for the clock: the ceiling is a fact of the platform."""
_VAGUE: Final = 0.5
"""Relative standard error above which a delay counts as unknown."""


def choose_clock(
    dataset: Dataset, fitter: LawFitter, sigma_rpm: Mapping[str, float], given: bool
) -> tuple[LawFitter, Estimate, Runs, str | None]:
    """Fit with the clock that the times of the log suggest and, unless it is `given`, with the platform's.

    Return the fitter with the better command path, its estimate, its runs with the noise `sigma_rpm` of each
    column [rpm], and a note if the clock is the platform's.
    """
    path = fitter.path
    paths = [path]
    if not given and not (path.latched and path.command_period_s == COMMAND_PERIOD_S):
        whole = COMMAND_PERIOD_S / path.sample_period_s
        if path.command_period_s >= path.sample_period_s and abs(whole - round(whole)) < 1e-6:
            paths.append(replace(path, latched=True, command_period_s=COMMAND_PERIOD_S))
    if path.command_period_s < 0.5 / 120.0:  # commands that fast are certain
        paths = paths[:1]
    tried = []
    for candidate in paths:
        runs = runs_by_split(dataset, candidate, sigma_rpm)
        chosen = replace(fitter, path=candidate)
        tried.append((chosen, chosen.run(pooled(runs["fit"])), runs))
    best = min(tried, key=lambda item: item[1].cost)
    if best[1].cost > _OTHER_CLOCK * tried[0][1].cost:
        return (*tried[0], None)
    note = f"commands fit better latched every {COMMAND_PERIOD_S:g} s from each run's start than as stamped"
    return (*best, note)


def choose_ceiling(
    dataset: Dataset, fitter: LawFitter, sigma_rpm: Mapping[str, float], plain: Estimate, runs: Runs
) -> tuple[LawFitter, Estimate, Runs, str | None]:
    """Fit without the ceiling that the command path assumes, and drop it where bench logs contradict it.

    A wheel that is slow to follow need not stay at any speed beyond the ceiling to show that its drive has
    none. Both laws are compared in the fit and validation runs, where they differ by more than the noise
    `sigma_rpm` of each column [rpm]. `plain` was fitted to the `runs` behind the ceiling.

    Return the fitter with the better command path, its estimate, its runs, and a note if the ceiling goes.
    """
    path = fitter.path
    asked = max(float(np.max(np.abs(run.command.wheels_rpm))) for run in dataset.runs)
    if dataset.level != "bench" or asked <= path.saturation_rpm:
        return fitter, plain, runs, None
    free = replace(fitter, path=replace(path, saturation_rpm=math.inf))
    free_runs = runs_by_split(dataset, free.path, sigma_rpm)
    other = free.run(pooled(free_runs["fit"]), delay_s=plain.delay_s)
    before, after = _in_sigmas(runs, plain), _in_sigmas(free_runs, other)
    differ = np.abs(after - before) > 1.0
    with_ceiling, without = float(np.sum(before[differ] ** 2)), float(np.sum(after[differ] ** 2))
    if without >= _WITHOUT_CEILING * with_ceiling:
        return fitter, plain, runs, None
    samples = fitter.effective_share * np.count_nonzero(differ)
    if samples * math.log(with_ceiling / max(without, 1e-12)) < VERY_STRONG:
        return fitter, plain, runs, None
    note = (
        f"commands reach {asked:.0f} rpm, and the speeds follow them as without the robot's ceiling of "
        f"{path.saturation_rpm:g} rpm: the ceiling is not assumed"
    )
    return free, other, free_runs, note


def _in_sigmas(runs: Runs, found: Estimate) -> FloatArray:
    """Return the residual on the fit and validation runs, in their noise."""
    data = pooled(runs["fit"]) + pooled(runs["validation"])
    return np.concatenate([residual(run, found) / run.sigma_rpm for run in data])


def choose_drive(runs: Runs, fitter: LawFitter, plain: Estimate, *, delay: bool) -> Estimate:
    """Return the estimate with those of a transport delay and a ceiling that are worth having.

    `plain`, fitted to all `runs`, has neither. A delay is tried if `delay`, a ceiling if the path seeks one.
    """
    data = representative(pooled(runs["fit"]))
    best = plain if len(data) == len(pooled(runs["fit"])) else fitter.run(data, delay_s=plain.delay_s)
    candidates = ["delay_s"] * delay + ["saturation_rpm"] * fitter.path.seek_ceiling
    while True:
        free = [name for name in ("delay_s", "saturation_rpm") if name in best.free]
        others = [
            fitter.run(data, free=[*free, name], delay_s=plain.delay_s)
            for name in candidates
            if name not in free
        ]
        worthy = [other for other in others if _worth_having(runs, data, best, other, fitter.effective_share)]
        if not worthy:
            return best
        best = min(worthy, key=lambda other: other.cost)


def _worth_having(
    runs: Runs, data: Sequence[WheelRun], found: Estimate, other: Estimate, effective_share: float
) -> bool:
    """Return whether `other`, with one parameter more, is worth adopting over `found`.

    Both were fitted to `data`, of which only the `effective_share` is independent, and the validation `runs`
    must agree. The difference of BIC is taken with the variance of the residual if that exceeds the noise,
    since the model's error limits what the data can tell.
    """
    if len(_drive(other)) <= len(_drive(found)):
        return False
    samples = sum(len(run.speed_rpm) for run in data)
    variance = max(1.0, 2.0 * found.cost / samples)
    gain = 2.0 * (found.cost - other.cost) / variance * effective_share
    evidence = gain - math.log(max(2.0, samples * effective_share))
    return evidence >= VERY_STRONG and _held_out_agrees(runs, found, other)


def delay_is_vague(data: Sequence[WheelRun], found: Estimate) -> bool:
    """Return whether the estimated delay cannot be told from the law's zeros."""
    if "delay_s" not in found.free or found.delay_s <= 0.0:
        return False
    return uncertainty(data, found)["delay_s"].relative_error > _VAGUE


def representative(data: Sequence[WheelRun]) -> list[WheelRun]:
    """Return runs spread evenly over the data, with that of the largest command, to compare structures."""
    ticks = sum(len(run.command_rpm) for run in data)
    if ticks <= _ENOUGH_TICKS:
        return list(data)
    fastest = max(range(len(data)), key=lambda i: float(np.max(np.abs(data[i].command_rpm))))
    chosen, every = {fastest}, ticks / _ENOUGH_TICKS
    chosen |= {int(i * every) for i in range(int(len(data) / every))}
    return [data[i] for i in sorted(chosen)]


def _drive(found: Estimate) -> tuple[str, ...]:
    """Return the parameters before the law that an estimate has."""
    return ("delay_s",) * (found.delay_s > 0.0) + ("saturation_rpm",) * math.isfinite(found.saturation_rpm)


def _held_out_agrees(runs: Runs, found: Estimate, other: Estimate) -> bool:
    """Return whether the held-out runs are predicted better where the two estimates differ, or never differ.

    A ceiling, for example, only changes the samples beyond it, and a validation run may have none.
    """
    before, after = held_out_residual(runs, found), held_out_residual(runs, other)
    differ = np.abs(after - before) > _WORTH * rms(before)
    return not differ.any() or rms(after[differ]) < (1.0 - _WORTH) * rms(before[differ])


def held_out_residual(runs: Runs, found: Estimate) -> FloatArray:
    """Return the residual [rpm] on the validation runs, or on the fit runs if there are none."""
    data = pooled(runs["validation"]) or pooled(runs["fit"])
    return np.concatenate([residual(run, found) for run in data])
