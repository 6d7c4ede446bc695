"""A gap that only the test runs show, in which nothing is looked for.

Test runs are whole command sequences. A dead zone that swallows commands which no other sequence holds is
seen in them alone: the study finds nothing in the rest, and yet the logs have a gap. Where the logs of the
fit hold other commands, the model may err in these alone, so that the runs are only pointed out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.statistics import rms
from sysid.compare.model_error import without_known_error
from sysid.compare.predicted import predict_all
from sysid.logs import Dataset, Run

_FEWEST: Final = 2
"""Runs that must show it: one may be odd by itself."""
_FAR: Final = 3.0
"""Ratio of what is left in a test run to what is left in the others (rms) from which it counts. Of 198 drawn
drives (bench seeds 700-799, 850-899 and 1200-1249) the one of which the change is in the test runs alone has
16 in two of them; the next one has 2.1."""
_ODD: Final = 3.0
"""Ratio of the error of a test run to the largest one of any other run, here and in the logs of the fit, from
which it is pointed out. Assumed: nothing but a note depends on it."""


def only_in_test(dataset: Dataset, model: Model, fitted_on: Dataset | None) -> str:
    """Return in a sentence that test runs differ from the logs of the fit far more than others; else "".

    It is only known on the bench, for the commands that the logs of the fit hold, too.
    """
    if fitted_on is None or dataset.level != "bench" or fitted_on.level != "bench":
        return ""
    beside = without_known_error(model, dataset.runs, fitted_on.runs)
    known = [(run, less) for run, less in zip(dataset.runs, beside, strict=True) if less is not run]
    if not known:
        return ""
    predicted = predict_all(model, [run for run, _ in known])
    left = [
        rms(less.channels["speed_rpm"] - one["speed_rpm"])
        for (_, less), one in zip(known, predicted, strict=True)
    ]
    test = [value for (run, _), value in zip(known, left, strict=True) if run.split == "test"]
    others = [value for (run, _), value in zip(known, left, strict=True) if run.split != "test"]
    usual = rms(np.array(others)) if others else np.inf
    far = [value for value in test if value > _FAR * usual]
    if len(far) < _FEWEST:
        return ""
    return (
        f"{len(far)} test runs differ from the logs of the fit by {rms(np.array(far)):.2g} rpm, those that "
        f"decide by {usual:.2g} rpm: only their commands show it; state them as fit runs in dataset.toml, "
        "others as test runs, and study again"
    )


def odd_test_runs(dataset: Dataset, model: Model, fitted_on: Dataset | None) -> str:
    """Return in a sentence which test runs the model misses far more than any other run; else "".

    It is asked on the bench, and of the logs of the fit as well, if they are known.
    """
    others = [run for run in dataset.runs if run.split != "test"]
    if dataset.level != "bench" or len(others) in (0, len(dataset.runs)):
        # Where all are test runs, these decide.
        return ""
    if fitted_on is not None and fitted_on.level == "bench":
        others += fitted_on.runs
    usual = max(filter(math.isfinite, _errors_rpm(model, others)), default=math.inf)
    errors = zip(dataset.split("test"), _errors_rpm(model, dataset.split("test")), strict=True)
    odd = [(run.file, error) for run, error in errors if error > _ODD * usual]
    if not odd:
        return ""
    told = ", ".join(f"{file} ({error:.2g} rpm)" for file, error in odd)
    return (
        f"the model misses {told} by more than {_ODD:g} times as much as any other run ({usual:.2g} rpm): a "
        "test run decides nothing; look at it, or state it as a fit run in dataset.toml and study again"
    )


def _errors_rpm(model: Model, runs: Sequence[Run]) -> list[float]:
    """Return the rms error of the wheel speed in each run [rpm]; NaN if none was measured."""
    predicted = predict_all(model, runs)
    pairs = zip(runs, predicted, strict=True)
    return [rms(run.channels["speed_rpm"] - one["speed_rpm"]) for run, one in pairs]
