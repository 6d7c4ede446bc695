"""The law behind a command path, by all starts and methods, with its noise, its uncertainty and notes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from sysid.fit.drive.choice import choose_ceiling, choose_clock, choose_drive, delay_is_vague
from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.fitter import LawFitter, fitter_of
from sysid.fit.drive.law_fit import LawFit
from sysid.fit.drive.notes import drive_notes, gain_notes
from sysid.fit.drive.wheel_data import pooled, runs_by_split, wheel_columns
from sysid.fit.estimators import Estimate
from sysid.fit.options import FitOptions
from sysid.fit.statistics import MethodMetrics, Runs, method_metrics, residual_tests, uncertainty
from sysid.logs import Dataset
from sysid.logs.noise import noise_from_repeats
from sysid.progress import Progress, peak_memory_mib, with_peak_memory

_LEAST_SIGMA: Final = 1e-6  # rpm, for repeats without noise


def fit_behind(path: CommandPath, dataset: Dataset, options: FitOptions, progress: Progress) -> LawFit:
    """Fit the law to a `dataset` behind a command `path`, with these `options`.

    The path's clock is tried against the platform's where it is a guess. `progress` is told of each step.
    """
    notes = list(path.notes)
    # In the order of the log: that of a set, and so the last digits of the result, would vary between runs.
    columns = dict.fromkeys(column for run in dataset.runs for column in wheel_columns(run).values())
    repeats = noise_from_repeats(dataset.runs) or {}
    known = all(column in repeats for column in columns)
    sigma = {c: max(repeats[c].std, _LEAST_SIGMA) if c in repeats else 1.0 for c in columns}
    method, given_s = options.methods[0], options.delay_s or 0.0
    fitter = fitter_of(options, path, dataset)
    share = fitter.effective_share

    progress("clock of the commands")
    (fitter, plain, runs, note), memory = with_peak_memory(
        lambda: choose_clock(dataset, fitter, sigma, options.command_period_s is not None or path.exact)
    )
    notes += [note] if note else []
    if options.saturation_rpm is None:
        fitter, plain, runs, note = choose_ceiling(dataset, fitter, sigma, plain, runs)
        notes += [note] if note else []
    path = fitter.path
    if not known:
        sigma = _residual_sigma(sigma, plain)
        runs = runs_by_split(dataset, path, sigma)
    if given_s or not known:
        plain = fitter.run(pooled(runs["fit"]), delay_s=given_s)
    progress("delay and ceiling")
    drive = choose_drive(runs, fitter, plain, delay=options.delay_s is None)
    progress(f"{method}: {options.starts} starts")
    found = _all_starts(runs, fitter, options, drive)
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
        methods[name] = _other_method(runs, fitter, options, found, name)
    wheels = _wheel_laws(runs, fitter, options, found, progress) if options.per_wheel else {}
    progress("uncertainty")
    notes += gain_notes(runs, fitter, found)
    data = pooled(runs["fit"])
    return LawFit(
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


def _residual_sigma(sigma: Mapping[str, float], found: Estimate) -> dict[str, float]:
    """Return all noises scaled by one factor so that they agree with the estimate's residual."""
    scale = found.rms_rpm / math.sqrt(float(np.mean([value**2 for value in sigma.values()])))
    return {column: max(value * scale, _LEAST_SIGMA) for column, value in sigma.items()}


def _samples(runs: Runs) -> int:
    return sum(len(run.speed_rpm) for run in pooled(runs["fit"]))


def _all_starts(runs: Runs, fitter: LawFitter, options: FitOptions, drive: Estimate) -> Estimate:
    """Run all starts of the law with the chosen delay and ceiling held, then fit all parameters together."""
    data = pooled(runs["fit"])
    free = [name for name in ("delay_s", "saturation_rpm") if name in drive.free]
    found = fitter.run(
        data, starts=options.starts, delay_s=drive.delay_s, saturation_rpm=drive.saturation_rpm
    )
    if not free:
        return found
    held = drive.delay_s if "delay_s" not in free else 0.0
    together = fitter.run(data, free=free, delay_s=held, initial=[found.coefficients.tolist()])
    if delay_is_vague(data, together):
        whole = round(together.delay_s / fitter.path.sample_period_s) * fitter.path.sample_period_s
        free = [name for name in free if name != "delay_s"]
        together = fitter.run(data, free=free, delay_s=whole, initial=[together.coefficients.tolist()])
    return replace(together, starts=found.starts, seconds=found.seconds + together.seconds)


def _wheel_laws(
    runs: Runs, fitter: LawFitter, options: FitOptions, found: Estimate, progress: Progress
) -> dict[str, Estimate]:
    """Return the law of each wheel by itself, with the delay and the ceiling of all wheels together."""
    laws = {}
    for wheel, data in runs["fit"].items():
        progress(f"{options.methods[0]}: {wheel}")
        laws[wheel] = fitter.run(
            data, starts=options.starts, delay_s=found.delay_s, saturation_rpm=found.saturation_rpm
        )
    return laws


def _other_method(
    runs: Runs, fitter: LawFitter, options: FitOptions, found: Estimate, name: str
) -> MethodMetrics:
    """Run another method with the delay and the ceiling of the first."""
    data = pooled(runs["fit"])

    def run(starts: int) -> Estimate:
        return fitter.run(
            data, method=name, starts=starts, delay_s=found.delay_s, saturation_rpm=found.saturation_rpm
        )

    return method_metrics(run(options.starts), runs, peak_memory_mib(lambda: run(1)))
