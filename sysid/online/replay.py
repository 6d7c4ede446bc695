"""Replay of logs through the online estimator, one wheel after the other, as if they were live."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from typing import Final

import numpy as np

from mecanum_env.errors import InputError
from mecanum_env.law import WheelLaw
from mecanum_env.law.conversion import convert_law
from mecanum_env.units import FloatArray
from sysid.fit.drive import CommandPath, infer_command_path, wheel_columns, wheel_run
from sysid.fit.estimators import WheelRun
from sysid.logs import Dataset
from sysid.online.estimator import OnlineEstimator, first_order_law
from sysid.online.history import History, track
from sysid.online.options import OnlineOptions

_SPARSE: Final = 1.5
"""Ticks per sample above which the law is slowed down, since it is not determined between samples."""
_NEIGHBOURS_TICKS: Final = 2.0
"""Largest distance of two samples that are interpolated at the tick between them [ticks]."""


@dataclass(frozen=True, eq=False)
class WheelHistory:
    """One wheel over all runs of a log, in sequence."""

    wheel: str
    history: History
    run_start: tuple[int, ...]
    """Tick at which each run begins."""
    files: tuple[str, ...]
    """File of each run."""


def tick_speeds(run: WheelRun) -> FloatArray:
    """Return the speed measured at ticks 0..K-1 [rpm], shape (K,), NaN where there is none.

    It is interpolated between samples at most two ticks apart. Any other sample is assigned to the nearest
    tick; of several samples at one tick the last counts.
    """
    n = len(run.command_rpm)
    speeds = np.full(n, math.nan)
    nearest = np.rint(run.sample_tick).astype(int)
    inside = nearest < n
    speeds[nearest[inside]] = run.speed_rpm[inside]
    if len(run.sample_tick) < 2:
        return speeds
    ticks = np.arange(n, dtype=float)
    right = np.clip(np.searchsorted(run.sample_tick, ticks, side="left"), 1, len(run.sample_tick) - 1)
    low, high = run.sample_tick[right - 1], run.sample_tick[right]
    close = (high - low <= _NEIGHBOURS_TICKS) & (low <= ticks) & (ticks <= high)
    between = np.interp(ticks, run.sample_tick, run.speed_rpm)
    return np.where(close, between, speeds)


def replay_path(
    dataset: Dataset, sample_period_s: float | None = None, saturation_rpm: float | None = None
) -> CommandPath:
    """Return the path from the log's commands to the law, with the law's period.

    The period is that of `infer_command_path`, unless the samples are sparser: then it is the fraction of the
    command period nearest to the sample interval. No ceiling is assumed unless `saturation_rpm` is given.

    Raises:
        InputError: see `infer_command_path`.
    """
    path = infer_command_path(dataset, sample_period_s=sample_period_s, saturation_rpm=saturation_rpm)
    interval = float(np.median([run.median_interval_s for run in dataset.runs]))
    if sample_period_s is None and interval > _SPARSE * path.sample_period_s:
        per_command = max(1, round(path.command_period_s / interval))
        path = replace(path, sample_period_s=path.command_period_s / per_command)
    if saturation_rpm is None:
        path = replace(path, saturation_rpm=math.inf)
    return path


def replay(
    dataset: Dataset,
    options: OnlineOptions | None = None,
    initial_law: WheelLaw | None = None,
    path: CommandPath | None = None,
    progress: Callable[[Iterable[int]], Iterable[int]] | None = None,
) -> tuple[WheelHistory, ...]:
    """Pass all runs in order to one estimator per wheel, which keeps its law from run to run.

    It starts from `initial_law`, converted to the period of the path, or from a first-order lag. The default
    path is `replay_path` of the dataset. `progress` wraps the iteration over the ticks of a run, as `tqdm`.

    Raises:
        InputError: no wheel was ever measured.
    """
    options = options or OnlineOptions()
    path = path or replay_path(dataset)
    period = path.sample_period_s
    start = initial_law or first_order_law(period)
    if math.isclose(start.sample_period_s, period, rel_tol=1e-9):
        start = replace(start, sample_period_s=period)
    else:
        start = convert_law(start, period, approximate=True)
    wheels = dict.fromkeys(wheel for run in dataset.runs for wheel in wheel_columns(run))
    result = []
    for wheel in wheels:
        estimator = OnlineEstimator(options, start)
        parts: list[History] = []
        files: list[str] = []
        for run in dataset.runs:
            data = wheel_run(run, wheel, path, options.noise_rpm) if wheel in wheel_columns(run) else None
            if data is None:
                continue
            estimator.restart()
            parts.append(track(estimator, data.command_rpm, tick_speeds(data), progress))
            files.append(run.file)
        if parts:
            starts = np.cumsum([0, *(len(part.speed_rpm) for part in parts[:-1])])
            result.append(WheelHistory(wheel, _joined(parts), tuple(int(s) for s in starts), tuple(files)))
    if not result:
        raise InputError(
            f"{dataset.name}: no wheel speed was measured in any run, so there is nothing to learn from"
        )
    return tuple(result)


def _joined(parts: list[History]) -> History:
    names = [field.name for field in fields(History) if field.name != "sample_period_s"]
    arrays = {name: np.concatenate([getattr(part, name) for part in parts]) for name in names}
    return History(parts[0].sample_period_s, **arrays)
