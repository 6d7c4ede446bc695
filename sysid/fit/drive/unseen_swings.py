"""A law that swings between the samples of the log it was fitted to, and the tick with which it cannot.

Where two ticks of the law or more lie between two samples, the samples do not show whether the speed
alternates from tick to tick. A fit may use that freedom, and the law then predicts any speed in between.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from sysid.fit.drive.command_path import CommandPath
from sysid.fit.drive.law_fit import LawFit
from sysid.fit.estimators import Estimate, WheelRun
from sysid.fit.statistics.metrics import simulate

SWINGS: Final = (
    "the law swings between the samples, which do not show it: do not believe its speeds there; record more "
    "samples, or give a longer sample_period_s"
)
"""What is said of a law that still does."""
_SWING: Final = 0.1
"""Share of the largest speed by which a prediction between two samples may lie beyond both. Assumed: what
samples show of a motion at all does not turn by so much between two of them."""
_ROUNDING: Final = 1e-3
"""Relative rounding of the time between samples."""


def swings_unseen(found: LawFit) -> bool:
    """Return whether the law that was `found` swings between the samples of its fit runs."""
    runs = found.pooled("fit")
    largest = max(float(np.max(np.abs(run.speed_rpm))) for run in runs)
    return any(_beyond_neighbours(run, found.estimate) > _SWING * largest for run in runs)


def _beyond_neighbours(run: WheelRun, found: Estimate) -> float:
    """Return by how much the predicted speed between two samples lies beyond those at both, at most [rpm]."""
    speeds = simulate(run, found.law, found.delay_s, found.saturation_rpm)
    at_samples = np.interp(run.sample_tick, np.arange(speeds.size), speeds)
    ticks = np.arange(math.ceil(run.sample_tick[0]), math.floor(run.sample_tick[-1]) + 1)
    after = np.clip(np.searchsorted(run.sample_tick, ticks), 1, run.sample_tick.size - 1)
    neighbours = np.stack([at_samples[after - 1], at_samples[after]])
    above, below = speeds[ticks] - neighbours.max(axis=0), neighbours.min(axis=0) - speeds[ticks]
    return float(max(np.max(above), np.max(below)))


def without_unseen_ticks(found: LawFit) -> CommandPath | None:
    """Return the command path of a fit with a tick of which fewer than two lie between samples, and a note.

    None if the tick that was `found` is such a one already, or if commands act as they are stamped: a longer
    tick would round their times.
    """
    path, period = found.path, found.path.command_period_s
    interval = min(run.median_interval_s for run in found.dataset.runs)
    most = max(1, math.ceil(2.0 * period / interval * (1.0 - _ROUNDING)) - 1)
    tick = period / most
    if not path.latched or tick <= path.sample_period_s * (1.0 + _ROUNDING):
        return None
    note = (
        f"with a tick of {path.sample_period_s * 1e3:.3g} ms the law would swing between samples, which come "
        f"every {interval * 1e3:.3g} ms and do not show it: its tick is {tick * 1e3:.3g} ms"
    )
    return replace(path, sample_period_s=tick, notes=(*path.notes, note))
