"""Bench logs less what their model errs by in the same commands, as the logs of its fit show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.links import LinkDelays
from sysid.compare.links.in_model import delay_of
from sysid.compare.model_error.same_commands import same_commands
from sysid.compare.predicted import predict_all
from sysid.logs import Run

_SPEED: Final = "speed_rpm"


def without_known_error(
    model: Model, runs: Sequence[Run], of_fit: Sequence[Run], delays: LinkDelays | None = None
) -> tuple[Run, ...]:
    """Return bench `runs` with their speeds less the residual in the same commands of the logs of the fit.

    Where several runs of the fit were sent the commands of a run, it is the median of their residuals, so
    that what happened in one of them alone, such as a lost command, is not taken for the model's error. A run
    of the fit itself is beside the others. Runs whose commands no other run has stay as they are. What a
    model errs by after a change of command comes as late as the change acts, by the `delays` of the runs
    beyond the model's own; None: in time.
    """
    predicted = predict_all(model, of_fit)
    residuals = {run: run.channels[_SPEED] - own[_SPEED] for run, own in zip(of_fit, predicted, strict=True)}
    period_s, found = model.wheel.command_period_s, []
    for index, run in enumerate(runs):
        shifts = same_commands(run, [other for other in residuals if other is not run], period_s)
        if shifts:
            time_s = run.time_s if delays is None else _in_time(run.time_s, index, delays, delay_of(model))
            beside = [_at(other, residuals[other], time_s + shift) for other, shift in shifts.items()]
            speed = run.channels[_SPEED] - np.median(beside, axis=0)
            run = replace(run, channels={**run.channels, _SPEED: speed})
        found.append(run)
    return tuple(found)


def _at(run: Run, residual: FloatArray, time_s: FloatArray) -> FloatArray:
    seen = np.isfinite(residual)
    return np.asarray(np.interp(time_s, run.time_s[seen], residual[seen]))


def _in_time(time_s: FloatArray, run: int, delays: LinkDelays, delay_s: float) -> FloatArray:
    """Return the times [s], (n,), at which a link of one `delay_s` [s] is where that of a run is, by number.

    Until a change acts, the command before it goes on as it was just before the change.
    """
    own = [index for index, change in enumerate(delays.changes) if change.run == run]
    given = np.array([delays.changes[index].given_s for index in own])
    late = delays.delay_s[own] - delay_s
    acting = np.flatnonzero(~delays.lost[own])
    acts = np.maximum.accumulate(given[acting] + late[acting])
    last = np.searchsorted(acts, time_s + 1e-9, side="right") - 1
    behind = np.where(last >= 0, late[acting][last], 0.0) if acting.size else 0.0
    number = np.where(last >= 0, acting[last], -1) if acting.size else np.full(time_s.size, -1)
    ends = np.append(given, np.inf)[number + 1]
    return np.minimum(time_s - behind, ends + delay_s - 1e-6)
