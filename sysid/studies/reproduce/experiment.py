"""The whole experiment: its stages in order, and the record of its results."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Final

from mecanum_env.parallel import process_pool
from sysid.fit.estimators import Estimate, Options, estimate
from sysid.progress import Progress, silent
from sysid.studies.reproduce import published
from sysid.studies.reproduce.contenders import (
    COMPARED,
    CONTENDERS,
    OURS,
    WITH_STARTS,
    Cost,
    ExperimentEffort,
    StartRates,
    best_rms,
    identify,
    measure_costs,
    start_rates,
)
from sysid.studies.reproduce.data import DataSets, record_data_sets
from sysid.studies.reproduce.prediction import (
    ModelStep,
    Response,
    SetErrors,
    TargetSteps,
    model_step,
    response,
    set_errors,
    shown_steps,
    target_steps,
)
from sysid.studies.reproduce.robot import RobotDrive, robot_drives, wheel_model

STAGES: Final = (
    "record the target system",
    *(f"time and memory: {name}" for name in COMPARED),
    *(f"ten starts: {name}" for name in CONTENDERS),
    "step responses and random inputs",
    *(f"many starts: {name}" for name in WITH_STARTS),
    "robot on rollers",
)
"""Stages that `reproduce` reports to its progress, once each; the last ones in the order of completion."""


@dataclass(frozen=True, eq=False)
class Reproduction:
    """All results of the experiment."""

    seed: int
    effort: ExperimentEffort
    estimates: Mapping[str, Estimate]
    """Contender -> its result from the paper's ten starts."""
    ten_starts: Mapping[str, StartRates]
    many_starts: Mapping[str, StartRates]
    best_rms_rpm: float
    """Lowest rms on the fitted data of any stable law that a method reached from ten starts."""
    sigma_rpm: float
    """Standard deviation of the data's noise, encoder included."""
    fitted_ceiling_rpm: float
    """Saturation that output error estimates when the step beyond the ceiling is fitted as well."""
    target: TargetSteps
    models: Mapping[str, ModelStep]
    errors: tuple[SetErrors, ...]
    shown: tuple[Response, ...]
    """Fig. 3."""
    beyond: Response
    """Fig. 5, commands as they are."""
    beyond_limited: Response
    """Fig. 5, commands limited to the ceiling."""
    trials: tuple[Response, ...]
    """Fig. 6."""
    costs: Mapping[str, Cost]
    robot: tuple[RobotDrive, ...]


def reproduce(
    seed: int = 0, effort: ExperimentEffort | None = None, progress: Progress = silent
) -> Reproduction:
    """Run the experiment; equal seeds give equal results, except for times and memory.

    `effort` is the full one by default; `progress` is called with each of `STAGES`.
    """
    effort = effort or ExperimentEffort()
    progress(STAGES[0])
    data = record_data_sets(seed)
    runs = data.fit_runs
    # Costs are measured first, while nothing else runs.
    costs = measure_costs(data, effort, seed, lambda name: progress(f"time and memory: {name}"))
    with _pool(effort.workers) as submit:
        many = {submit(_many_starts, name, effort, seed): name for name in reversed(WITH_STARTS)}
        estimates = {}
        for name, contender in CONTENDERS.items():
            progress(f"ten starts: {name}")
            estimates[name] = identify(
                data.runs_for(contender.method), contender, effort, seed, published.STARTS
            )
        laws = {name: estimates[name].law for name in COMPARED}
        drives = submit(robot_drives, wheel_model(laws[OURS]))
        progress("step responses and random inputs")
        beyond = data.beyond[0]
        result: dict[str, Any] = {
            "fitted_ceiling_rpm": _fitted_ceiling(data),
            "target": target_steps(data),
            "models": {name: model_step(law) for name, law in laws.items()},
            "errors": tuple(set_errors(data, laws)),
            "shown": tuple(shown_steps(data, laws, published.SHOWN_STEPS_RPM)),
            "beyond": response(beyond, laws),
            "beyond_limited": response(beyond, laws, published.CEILING_RPM),
            "trials": tuple(response(trial, laws) for trial in data.trials),
        }
        best = best_rms([estimates[name] for name in WITH_STARTS])
        largest = float(max(published.FIT_STEPS_RPM))
        found_many = {}
        for done in as_completed([*many, drives]):
            if done is drives:
                progress("robot on rollers")
                continue
            name = many[done]
            progress(f"many starts: {name}")
            found_many[name] = start_rates(name, done.result(), best, largest)
    return Reproduction(
        seed=seed,
        effort=effort,
        estimates=estimates,
        ten_starts={name: start_rates(name, estimates[name], best, largest) for name in WITH_STARTS},
        many_starts={name: found_many[name] for name in WITH_STARTS},
        best_rms_rpm=best,
        sigma_rpm=float(runs[0].sigma_rpm[0]),
        costs=costs,
        robot=tuple(drives.result()),
        **result,
    )


def _many_starts(name: str, effort: ExperimentEffort, seed: int) -> Estimate:
    """Record the same data again, which is quicker than copying them between processes, and fit them."""
    return identify(record_data_sets(seed).fit_runs, CONTENDERS[name], effort, seed, effort.starts)


def _fitted_ceiling(data: DataSets) -> float:
    runs = [*data.fit_runs, *(recording.run for recording in data.beyond)]
    return estimate(runs, OURS, Options(starts=1, fit_saturation=True)).saturation_rpm


@contextmanager
def _pool(workers: int) -> Iterator[Callable[..., Future[Any]]]:
    """Yield `submit`; a single worker does the work at once in this process."""
    if workers == 1:
        yield _at_once
        return
    before = os.environ.get("OMP_NUM_THREADS")
    os.environ["OMP_NUM_THREADS"] = "1"  # One thread per process; workers read it when they import NumPy.
    try:
        with process_pool(workers) as pool:
            yield pool.submit
    finally:
        if before is None:
            del os.environ["OMP_NUM_THREADS"]
        else:
            os.environ["OMP_NUM_THREADS"] = before


def _at_once(work: Callable[..., Any], *arguments: Any) -> Future[Any]:
    future: Future[Any] = Future()
    future.set_result(work(*arguments))
    return future
