"""The whole experiment: its stages in order, and the record of its results."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from mecanum_env.parallel import Task, Workers, one_thread, run_tasks
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

_ROBOT: Final = "robot on rollers"
_TASKS: Final = (
    *(f"many starts: {name}" for name in reversed(WITH_STARTS)),
    _ROBOT,
    *(f"ten starts: {name}" for name in CONTENDERS),
)
"""What does not depend on each other, the longest first."""
STAGES: Final = (
    "record the target system",
    *(f"time and memory: {name}" for name in COMPARED),
    *_TASKS,
    "step responses and random inputs",
)
"""Stages that `reproduce` reports to its progress, once each; the tasks in the order of completion."""


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
    seed: int = 0,
    effort: ExperimentEffort | None = None,
    progress: Progress = silent,
    workers: Workers | None = None,
) -> Reproduction:
    """Run the experiment; equal seeds give equal results, except for times and memory.

    Args:
        seed: of the recordings and of the random starts.
        effort: the full one by default.
        progress: called with each of `STAGES`.
        workers: where the fits run; by default on all processors of this machine.
    """
    effort = effort or ExperimentEffort()
    progress(STAGES[0])
    data = record_data_sets(seed)
    # Costs are measured first, while nothing else runs.
    costs = measure_costs(data, effort, seed, lambda name: progress(f"time and memory: {name}"))
    tasks: list[Task[Any]] = [
        *(Task(f"many starts: {n}", _fit, (n, effort, seed, effort.starts)) for n in reversed(WITH_STARTS)),
        Task(_ROBOT, _drives, (effort, seed)),
        *(Task(f"ten starts: {n}", _fit, (n, effort, seed, published.STARTS)) for n in CONTENDERS),
    ]
    results = run_tasks(tasks, workers, lambda index, _: progress(tasks[index].name))
    found: dict[str, Any] = dict(zip((task.name for task in tasks), results, strict=True))
    progress("step responses and random inputs")
    estimates: dict[str, Estimate] = {name: found[f"ten starts: {name}"] for name in CONTENDERS}
    best = best_rms([estimates[name] for name in WITH_STARTS])
    largest = float(max(published.FIT_STEPS_RPM))
    laws = {name: estimates[name].law for name in COMPARED}
    beyond = data.beyond[0]
    with one_thread():
        ceiling = _fitted_ceiling(data)
    return Reproduction(
        seed=seed,
        effort=effort,
        estimates=estimates,
        ten_starts={name: start_rates(name, estimates[name], best, largest) for name in WITH_STARTS},
        many_starts={
            name: start_rates(name, found[f"many starts: {name}"], best, largest) for name in WITH_STARTS
        },
        best_rms_rpm=best,
        sigma_rpm=float(data.fit_runs[0].sigma_rpm[0]),
        fitted_ceiling_rpm=ceiling,
        target=target_steps(data),
        models={name: model_step(law) for name, law in laws.items()},
        errors=tuple(set_errors(data, laws)),
        shown=tuple(shown_steps(data, laws, published.SHOWN_STEPS_RPM)),
        beyond=response(beyond, laws),
        beyond_limited=response(beyond, laws, published.CEILING_RPM),
        trials=tuple(response(trial, laws) for trial in data.trials),
        costs=costs,
        robot=tuple(found[_ROBOT]),
    )


def _fit(name: str, effort: ExperimentEffort, seed: int, starts: int) -> Estimate:
    """Record the same data again, which is quicker than copying them between processes, and fit them."""
    data, contender = record_data_sets(seed), CONTENDERS[name]
    return identify(data.runs_for(contender.method), contender, effort, seed, starts)


def _drives(effort: ExperimentEffort, seed: int) -> list[RobotDrive]:
    """Drive the robot with the law of the first ten starts, which is fitted again: it takes a second."""
    return robot_drives(wheel_model(_fit(OURS, effort, seed, published.STARTS).law))


def _fitted_ceiling(data: DataSets) -> float:
    runs = [*data.fit_runs, *(recording.run for recording in data.beyond)]
    return estimate(runs, OURS, Options(starts=1, fit_saturation=True)).saturation_rpm
