"""The wheel law from logs: their command path, weights, and the law behind both.

Least squares weights a sample by the variance of its error, which is that of the noise and of the model
together. A wheel at rest is often recorded without any noise at all. Where no law comes near the noise of the
moving wheel, weights by the noise alone would fit little else than the rest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from sysid.fit.drive.behind_path import fit_behind
from sysid.fit.drive.command_path import infer_command_path
from sysid.fit.drive.fitter import LawFitter
from sysid.fit.drive.law_fit import LawFit
from sysid.fit.drive.unseen_swings import SWINGS, swings_unseen, without_unseen_ticks
from sysid.fit.drive.wheel_data import pooled, runs_by_split
from sysid.fit.options import FitOptions
from sysid.fit.statistics import residual
from sysid.logs import Dataset
from sysid.logs.tail_laws import Tails
from sysid.logs.tails import weighted_down
from sysid.progress import Progress

_BESIDE: Final = 3.0
"""Typical error of the law, in the typical noise, above which it counts in the weights. Assumed."""
_TO_SIGMA: Final = 1.4826
"""Standard deviation of normal values over the median of their sizes."""
_CHANNEL: Final = "speed_rpm"


def fit_law(plain: Dataset, options: FitOptions, progress: Progress) -> LawFit:
    """Fit the wheel law to `plain` logs.

    `options` says how, and `progress` is told of each long step.

    Raises:
        InputError: no wheel speed, or data to which no law can be fitted.
    """
    dataset, tails = weighted_down(plain)
    path = infer_command_path(
        dataset,
        sample_period_s=options.sample_period_s,
        command_period_s=options.command_period_s,
        quantum_rpm=options.quantum_rpm,
        saturation_rpm=options.saturation_rpm,
    )
    fitter = LawFitter(options.methods[0], options.seed, options.unit_gain, path, 1.0)
    dataset = _weighted_beside_error(plain, dataset, tails, fitter)
    found = fit_behind(path, dataset, options, progress)
    swings = swings_unseen(found)
    slower = without_unseen_ticks(found) if swings and options.sample_period_s is None else None
    if slower is not None:
        path = slower
        found = fit_behind(path, dataset, options, progress)
        swings = swings_unseen(found)
    if swings:
        found = replace(found, notes=(*found.notes, SWINGS))
    return replace(found, tails=tails)


def _weighted_beside_error(
    plain: Dataset, weighted: Dataset, tails: Mapping[str, Tails], fitter: LawFitter
) -> Dataset:
    """Return bench logs weighted by their noise and by the error of a law that is fitted without weights.

    The `weighted` ones, by the noise alone, are returned as they are if their noise does not grow with the
    speed, or if the law's typical error is of its order. `plain` are the logs without weights, and `tails` is
    what their noise is like.
    """
    noise = tails.get(_CHANNEL)
    if noise is None or noise.growth == 0.0:
        return weighted
    runs = pooled(runs_by_split(plain, fitter.path, {_CHANNEL: 1.0})["fit"])
    # The gain is free: a drive that loses speed has no error for that.
    found = fitter.run(runs, unit_gain=False)
    off = np.concatenate([residual(run, found) for run in runs])
    speeds = np.concatenate([np.abs(run.speed_rpm) for run in runs])
    error = _TO_SIGMA * float(np.median(np.abs(off)))
    typical = float(np.median(noise.at(speeds)))
    if error <= _BESIDE * typical:
        return weighted
    return weighted_down(plain, math.sqrt(error**2 - typical**2))[0]
