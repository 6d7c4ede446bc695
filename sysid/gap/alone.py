"""One recording without a model: law and effects are fitted to it, and what is beyond the law is the gap."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final

from mecanum_env.errors import InputError
from mecanum_env.model import Model, cause_of
from sysid.compare.measured import select_runs
from sysid.fit import FitOptions, fit_dataset, fitted_model
from sysid.gap.result import GapOptions
from sysid.logs import Dataset, Split
from sysid.progress import Progress, silent

_TIMING: Final = ("command_latency", "sensor_latency")
"""Causes, in any form, that a fit of the law estimates with it, whatever else it looks for."""

_SECONDS: Final[Mapping[Split, float]] = {"fit": 120.0, "validation": 60.0, "test": 60.0}
"""Duration of the runs that a law is fitted to, and that are held out of the fit [s]."""


def require_fittable(dataset: Dataset, logs: Path, fitted_on: Path | None = None) -> None:
    """Refuse a dataset, read from `logs`, to which no law and effects can be fitted at once.

    Raises:
        InputError: robot logs, or `fitted_on` although there is no model that was fitted to anything.
    """
    if fitted_on is not None:
        raise InputError(f"fitted-on {fitted_on}: no model was fitted to them; give --model, too")
    if dataset.level != "bench":
        raise InputError(
            f"{logs}: robot logs need a model; fit one to logs of the robot as it was "
            "(python -m sysid.fit LOGS), and give it with --model"
        )


def law_of(dataset: Dataset, options: GapOptions, progress: Progress = silent) -> tuple[Model, GapOptions]:
    """Return the law that was fitted to bench logs together with effects, and the options of its study.

    The effects are left out of the model, except for a delay: a study of the same logs then names what is
    beyond the law. It may find as many effects as the fit did. Where commands act at times of their own, law
    and effects together tell these. `progress` is called before each stage.

    Raises:
        InputError: logs to which no law can be fitted.
    """
    whole = fitted_model(fit_dataset(_selected(dataset), FitOptions(seed=options.seed), progress))
    kept = {name: values for name, values in whole.effects.items() if cause_of(name) in _TIMING}
    beyond = [name for name in whole.effects if name not in kept]
    uncertainty = {key: value for key, value in whole.uncertainty.items() if key not in ("effects", "joint")}
    note = "the law was fitted to these very logs, together with what it lacks: " + (
        " + ".join(beyond) if beyond else "nothing that they show"
    )
    most = max(options.max_effects, len(beyond))
    law = replace(whole, effects=kept, uncertainty=uncertainty)
    return law, replace(options, max_effects=most, fitted_here=whole, notes=(*options.notes, note))


def _selected(dataset: Dataset) -> Dataset:
    """Return bench logs with what a law is fitted to: of long recordings, pieces that cover the speeds."""
    period = min(run.median_interval_s for run in dataset.runs)
    runs = [
        run
        for split, seconds in _SECONDS.items()
        for run in select_runs(dataset.split(split), seconds, period)
    ]
    return dataset if len(runs) == len(dataset.runs) else replace(dataset, runs=tuple(runs))
