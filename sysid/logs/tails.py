"""Samples that count less: outliers, heavy-tailed noise, and noise that grows with the speed.

A sample is compared with its neighbours while a command is held (`sysid.logs.neighbours`). If these
differences have heavier tails than normal noise at that number of samples, they are taken for Student's t,
whose maximum likelihood is least squares with the weight (n + 1) / (n + z^2), with n its degrees of freedom
and z the sample's distance in units of the scale (Lange, Little and Taylor, J. Am. Stat. Assoc. 84:881,
1989). Near a change of command neighbours differ by motion: there only a sample that is far off steady
neighbours counts less.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.units import FloatArray
from sysid.logs.neighbours import OF_MEDIAN, Differences, around, differences
from sysid.logs.runs import Dataset, Run
from sysid.logs.tail_laws import OUTLYING, Tails, sensor_noise

STEADY: Final = ("speed_rpm",)
"""Channels that are compared: speeds of bench logs, which are steady while a command is held."""
_RANGE: Final = 5.0
"""Range of four neighbours, in scales, up to which they are steady: that of normal noise in 99 of 100."""


def weighted_down(dataset: Dataset, error_rpm: float = 0.0) -> tuple[Dataset, Mapping[str, Tails]]:
    """Return the dataset with weights of samples where noise is not normal, and channel -> what it is like.

    Without such a channel the dataset is returned as it is, and so are robot logs: a body takes longer than a
    wheel to settle, and what it does meanwhile would count as an outlier.

    `error_rpm` is what a model that is fitted to it misses beside the noise [rpm]: the more that is, the less
    matters by how much the noise grows.
    """
    if dataset.level != "bench":
        return dataset, {}
    found: dict[str, Tails] = {}
    weights: list[dict[str, FloatArray]] = [{} for _ in dataset.runs]
    for name in STEADY:
        tails = sensor_noise(dataset.runs, name).tails
        if tails is None or tails.is_plain:
            continue
        found[name] = tails
        for own, run in zip(weights, dataset.runs, strict=True):
            if name in run.channels:
                own[name] = _weights(_with_spikes(run, name, tails), tails, error_rpm)
    if not found:
        return dataset, found
    runs = (replace(run, weights=own) for run, own in zip(dataset.runs, weights, strict=True))
    return replace(dataset, runs=tuple(runs)), found


def _weights(compared: Differences, tails: Tails, error_rpm: float) -> FloatArray:
    scale = tails.at(compared.level)
    square = (compared.off / scale / OF_MEDIAN) ** 2
    heavy = np.where(np.isfinite(square), tails.counts(square), 1.0)
    at_rest = math.hypot(tails.scale, error_rpm)
    return np.asarray(heavy * (at_rest / np.hypot(scale, error_rpm)) ** 2)


def _with_spikes(run: Run, name: str, tails: Tails) -> Differences:
    """Return the differences with those of single samples near a change, between steady neighbours.

    Steady are the two nearest neighbours with one of the next two: a change may follow a spike, or go before
    it.
    """
    held, rows = differences(run, name), np.flatnonzero(run.finite(name))
    if rows.size < 5:
        return held
    values = run.channels[name][rows]
    neighbours = around(values)
    own, scale = rows[2:-2], tails.at(held.level[rows[2:-2]])
    steady = np.minimum(np.ptp(neighbours[:3], axis=0), np.ptp(neighbours[1:], axis=0)) < _RANGE * scale
    off = values[2:-2] - np.median(neighbours, axis=0)
    spikes = np.isnan(held.off[own]) & steady & (np.abs(off) > OUTLYING * scale)
    held.off[own[spikes]] = off[spikes]
    return held
