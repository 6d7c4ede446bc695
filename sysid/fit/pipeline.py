"""From a dataset to a model: the whole fit as one function call."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from sysid.estimators import DEFAULT_METHOD, Estimate, Options, WheelRun, estimate
from sysid.fit.command_path import COMMAND_PERIOD_S, CommandPath, infer_command_path
from sysid.fit.figures import MethodFigures, Runs, method_figures, residual, rms
from sysid.fit.wheel_data import delayed, longest_delay_s, wheel_columns, wheel_runs
from sysid.logs import Dataset, Split
from sysid.logs.noise import noise_from_repeats
from sysid.logs.records import SPLITS
from sysid.measure import Progress, peak_memory_mib, silent
from sysid.statistics import ResidualTests, Uncertainty, residual_tests, uncertainty

_LONGEST_DELAY_S: Final = 0.25
_LEAST_SIGMA: Final = 1e-6  # rpm; noiseless repeats still need a finite weight
_DELAY_BIC: Final = 10.0  # "very strong" evidence on the scale of Kass and Raftery (1995)


@dataclass(frozen=True)
class FitOptions:
    """What a user may decide about a fit."""

    methods: tuple[str, ...] = (DEFAULT_METHOD,)
    """Methods to run; the first gives the model."""
    starts: int = 10
    seed: int = 0
    unit_gain: bool = True
    """Hold the DC gain at exactly 1."""
    delay_s: float | None = None
    """Transport delay [s] to assume; None: estimated, and adopted where the data ask for one."""
    per_wheel: bool = False
    """Fit a law to each wheel besides the pooled one."""
    sample_period_s: float | None = None
    command_period_s: float | None = None
    quantum_rpm: float | None = None
    saturation_rpm: float | None = None


@dataclass(frozen=True)
class Fit:
    """A fitted wheel and the evidence for it."""

    dataset: Dataset
    path: CommandPath
    options: FitOptions
    sigma_rpm: Mapping[str, float]
    """Noise of each wheel-speed column [rpm] that weighted the fit."""
    sigma_from_repeats: bool
    """True: the noise was measured from repeats. False: there are none, and it is the fit's own residual."""
    estimate: Estimate
    """Of the first method, on the fit runs of all wheels."""
    uncertainty: Uncertainty
    residual_tests: ResidualTests
    methods: Mapping[str, MethodFigures]
    wheels: Mapping[str, Estimate]
    """With `per_wheel`: wheel name -> its own estimate."""
    runs: Runs
    """Split -> wheel name -> data on the law's clock."""
    notes: tuple[str, ...] = field(default=())
    """What was inferred, assumed or could not be told, in sentences."""

    @property
    def law(self) -> WheelLaw:
        """The fitted law."""
        return self.estimate.law


def fit_dataset(dataset: Dataset, options: FitOptions | None = None, progress: Progress = silent) -> Fit:
    """Fit the wheel law to a dataset.

    Args:
        dataset: bench logs, or robot logs with wheel speeds.
        options: methods, starts, what to assume.
        progress: called with a message before each long step.

    Raises:
        InputError: no run to fit, no wheel speed, or data that no law can be fitted to; the message says why.
    """
    options = options or FitOptions()
    if not dataset.split("fit"):
        raise InputError(f'{dataset.name}: no run has split = "fit"; set one in dataset.toml')
    path = infer_command_path(
        dataset,
        sample_period_s=options.sample_period_s,
        command_period_s=options.command_period_s,
        quantum_rpm=options.quantum_rpm,
        saturation_rpm=options.saturation_rpm,
    )
    notes = list(path.notes)
    repeats = noise_from_repeats(dataset.runs) or {}
    columns = {column for run in dataset.runs for column in wheel_columns(run).values()}
    sigma = {
        column: max(repeats[column].std, _LEAST_SIGMA) if column in repeats else 1.0 for column in columns
    }
    known = all(column in repeats for column in columns)
    method = options.methods[0]

    progress(f"{method}: first fit")
    path, found, runs = _best_clock(dataset, path, sigma, options, notes)
    if not known:
        scale = found.rms_rpm / math.sqrt(float(np.mean([sigma[c] ** 2 for c in columns])))
        sigma = {column: max(value * scale, _LEAST_SIGMA) for column, value in sigma.items()}
        runs = _runs_by_split(dataset, path, sigma)
        notes.append("no repeats: the noise is taken from the fit's own residuals, model error included")
    progress(f"{method}: {options.starts} starts")
    found = _estimate(runs, path, options, method)
    if options.delay_s is None:
        progress(f"{method}: delay")
        found = _adopt_delay(runs, path, options, found, notes)
    if path.seek_ceiling:
        notes.append(
            f"the commands go beyond what the wheel reaches; a ceiling of {found.saturation_rpm:.1f} rpm was "
            "estimated"
            if math.isfinite(found.saturation_rpm)
            else "commands go beyond the assumed ceiling, and the speeds show none"
        )
    methods = {method: _figures(runs, path, options, found)}
    for name in options.methods[1:]:
        progress(name)
        methods[name] = _figures(runs, path, options, _estimate(runs, path, options, name, found.delay_s))
    wheels = {}
    if options.per_wheel:
        for wheel, data in runs["fit"].items():
            progress(f"{method}: {wheel}")
            wheels[wheel] = _estimate({"fit": {wheel: data}}, path, options, method, found.delay_s)
    progress("statistics")
    data = pooled(runs["fit"])
    return Fit(
        dataset=dataset,
        path=path,
        options=options,
        sigma_rpm=sigma,
        sigma_from_repeats=known,
        estimate=found,
        uncertainty=uncertainty(data, found),
        residual_tests=residual_tests(data, found),
        methods=methods,
        wheels=wheels,
        runs=runs,
        notes=tuple(notes),
    )


def pooled(wheels: Mapping[str, Sequence[WheelRun]]) -> list[WheelRun]:
    """Return the runs of all wheels in one list."""
    return [run for runs in wheels.values() for run in runs]


def _runs_by_split(dataset: Dataset, path: CommandPath, sigma: Mapping[str, float]) -> Runs:
    return {split: wheel_runs(dataset.split(split), path, sigma) for split in SPLITS}


def _estimate(
    runs: Mapping[Split, Mapping[str, Sequence[WheelRun]]],
    path: CommandPath,
    options: FitOptions,
    method: str,
    delay_s: float | None = None,
    *,
    fit_delay: bool = False,
    starts: int | None = None,
) -> Estimate:
    """Run one method on the fit runs of all wheels; a delay that is given goes into the commands first."""
    given = options.delay_s if delay_s is None else delay_s
    data = [delayed(run, given) for run in pooled(runs["fit"])] if given else pooled(runs["fit"])
    found = estimate(
        data,
        method,
        Options(
            starts=starts or options.starts,
            seed=options.seed,
            unit_gain=options.unit_gain,
            fit_delay=fit_delay,
            max_delay_s=min(_LONGEST_DELAY_S, longest_delay_s(path)),
            fit_saturation=path.seek_ceiling,
        ),
    )
    return replace(found, delay_s=found.delay_s + given) if given else found


def _best_clock(
    dataset: Dataset, path: CommandPath, sigma: Mapping[str, float], options: FitOptions, notes: list[str]
) -> tuple[CommandPath, Estimate, Runs]:
    """Fit with the log's stamps as they are and, where these leave it open, with the platform's own clock."""
    paths = [path]
    if not path.latched and path.command_period_s == COMMAND_PERIOD_S:
        paths.append(replace(path, latched=True))
    tried = []
    for candidate in paths:
        runs = _runs_by_split(dataset, candidate, sigma)
        tried.append((candidate, _estimate(runs, candidate, options, options.methods[0], starts=2), runs))
    best = min(tried, key=lambda item: item[1].cost)
    if best[0] is not path:
        notes.append(
            f"commands fit better latched every {path.command_period_s:g} s from each run's start than at "
            "the log's own stamps"
        )
    return best


def _adopt_delay(
    runs: Runs, path: CommandPath, options: FitOptions, found: Estimate, notes: list[str]
) -> Estimate:
    """Return the estimate with a transport delay where the data ask for one beyond doubt, else `found`.

    The delay must explain the fit runs far better than chance and must not make held-out runs worse.
    """
    other = _estimate(runs, path, options, options.methods[0], fit_delay=True)
    samples = sum(len(run.speed_rpm) for run in pooled(runs["fit"]))
    gain = 2.0 * (found.cost - other.cost) - math.log(samples)  # difference of BIC for one more parameter
    held_out = pooled(runs["validation"]) or pooled(runs["fit"])
    before, after = (rms(np.concatenate([residual(run, e) for run in held_out])) for e in (found, other))
    if other.delay_s <= 0.0 or gain < _DELAY_BIC or after > before:
        return found
    notes.append(
        f"a transport delay of {other.delay_s * 1e3:.1f} ms was estimated and is in the model as "
        "command_latency; a bench log cannot tell it from sensor_latency"
    )
    return other


def _figures(runs: Runs, path: CommandPath, options: FitOptions, found: Estimate) -> MethodFigures:
    memory = peak_memory_mib(lambda: _estimate(runs, path, options, found.method, found.delay_s, starts=1))
    return method_figures(found, runs, memory)
