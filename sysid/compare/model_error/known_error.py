"""Bench logs less what their model errs by in the same commands, as the logs of its fit show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.model_error.same_commands import with_same_commands
from sysid.compare.predicted import predict_all
from sysid.logs import Run

_SPEED: Final = "speed_rpm"


def without_known_error(model: Model, runs: Sequence[Run], of_fit: Sequence[Run]) -> tuple[Run, ...]:
    """Return bench `runs` with their speeds less the residual in the same commands of the logs of the fit.

    Where several runs of the fit were sent the commands of a run, it is the median of their residuals, so
    that what happened in one of them alone, such as a lost command, is not taken for the model's error. A run
    of the fit itself is beside the others. Runs whose commands no other run has stay as they are.
    """
    predicted = predict_all(model, of_fit)
    residuals = {run: run.channels[_SPEED] - own[_SPEED] for run, own in zip(of_fit, predicted, strict=True)}
    return tuple(_without(run, residuals, model.wheel.command_period_s) for run in runs)


def _without(run: Run, residuals: dict[Run, FloatArray], period_s: float) -> Run:
    shifts = with_same_commands(run, [other for other in residuals if other is not run], period_s)
    if not shifts:
        return run
    beside = [_at(other, residuals[other], run.time_s + shift) for other, shift in shifts.items()]
    speed = run.channels[_SPEED] - np.median(beside, axis=0)
    return replace(run, channels={**run.channels, _SPEED: speed})


def _at(run: Run, residual: FloatArray, time_s: FloatArray) -> FloatArray:
    seen = np.isfinite(residual)
    return np.asarray(np.interp(time_s, run.time_s[seen], residual[seen]))
