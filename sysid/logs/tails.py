"""Samples that count less: outliers and heavy-tailed noise of a channel.

A sample is compared with its neighbours while a command is held: with the median of the two before and the two
after. If these differences have heavier tails than normal noise at that number of samples, they are taken for
Student's t, whose maximum likelihood is least squares with the weight (n + 1) / (n + z^2), with n its degrees
of freedom and z the sample's distance in units of the scale (Lange, Little and Taylor, J. Am. Stat. Assoc.
84:881, 1989). Soon after a change of command neighbours differ by motion: there only a sample that is far off
four steady neighbours counts less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from mecanum_env.units import FloatArray
from sysid.logs.runs import WHEEL_SPEEDS, Dataset, Run

_CHANNELS: Final = ("speed_rpm", *WHEEL_SPEEDS, "vx_m_s", "vy_m_s", "yaw_rate_rad_s")
"""Speeds, which are steady while a command is held."""
_HELD_S: Final = 0.5
"""Time after a change of command from which neighbours differ by noise only [s]."""
_BEFORE_S: Final = 0.1  # and up to this time before the next one, for stamps are not exact
_FEWEST: Final = 100  # samples from which tails are judged
_FREEDOMS: Final = (2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0)
_EVIDENCE: Final = 10.0  # difference of BIC: "very strong" on the scale of Kass and Raftery (1995)
_MEDIAN_OF_FOUR: Final = 0.298
"""Variance of the median of four normal values of variance 1."""
_OUTLYING: Final = 5.0
"""Scales beyond which a sample is called an outlier: normal noise has one in two million."""
_STEADY: Final = 5.0
"""Range of four neighbours, in scales, up to which they are steady: normal noise is within it in 99 of 100."""
_ROUNDS: Final = 30  # of the scale's fixed point


@dataclass(frozen=True)
class Tails:
    """The noise of a channel with heavier tails than normal noise has."""

    freedom: float
    """Degrees of freedom of Student's t."""
    scale: float
    """Its scale, in the channel's unit."""
    outliers: float
    """Share of the compared samples that are more than five scales off."""
    reduced: float
    """Share of the compared samples that count less than half."""

    def note(self, channel: str) -> str:
        """Return what was found, in a sentence."""
        return (
            f"{channel}: the noise has heavy tails (Student's t with {self.freedom:g} degrees of freedom); "
            f"{self.reduced:.1%} of the samples count less than half, {self.outliers:.1%} are outliers beyond "
            "five times its scale"
        )


def weighted_down(dataset: Dataset) -> tuple[Dataset, Mapping[str, Tails]]:
    """Return the dataset with weights of samples where noise is heavy-tailed, and channel -> what it is like.

    Without such a channel the dataset is returned as it is.
    """
    found: dict[str, Tails] = {}
    weights: list[dict[str, FloatArray]] = [{} for _ in dataset.runs]
    for name in _CHANNELS:
        differences = [_differences(run, name) for run in dataset.runs]
        values = np.concatenate([d[np.isfinite(d)] for d in differences] or [np.zeros(0)])
        tails = _tails(values, _resolution(dataset.runs, name))
        if tails is None:
            continue
        found[name] = tails
        for own, run, one in zip(weights, dataset.runs, differences, strict=True):
            if name in run.channels:
                own[name] = _weights(_with_spikes(run, name, one, tails), tails)
    if not found:
        return dataset, found
    runs = (replace(run, weights=own) for run, own in zip(dataset.runs, weights, strict=True))
    return replace(dataset, runs=tuple(runs)), found


def _weights(differences: FloatArray, tails: Tails) -> FloatArray:
    square = (differences / tails.scale) ** 2 / (1.0 + _MEDIAN_OF_FOUR)
    return np.where(np.isfinite(square), (tails.freedom + 1.0) / (tails.freedom + square), 1.0)


def _differences(run: Run, name: str) -> FloatArray:
    """Return by how much each sample differs from its neighbours while a command is held, else NaN, (n,)."""
    found = np.full(run.time_s.size, np.nan)
    if name not in run.channels:
        return found
    for rows in _held(run, run.finite(name)):
        values = run.channels[name][rows]
        if values.size < 5 or np.ptp(values) == 0.0:
            # A constant channel, such as that of a wheel at rest, says nothing about noise.
            continue
        around = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
        found[rows[2:-2]] = values[2:-2] - np.median(around, axis=0)
    return found


def _with_spikes(run: Run, name: str, differences: FloatArray, tails: Tails) -> FloatArray:
    """Return the differences with those of single samples soon after a change, between steady neighbours."""
    found, rows = differences.copy(), np.flatnonzero(run.finite(name))
    if rows.size < 5:
        return found
    values = run.channels[name][rows]
    around = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
    own, steady = rows[2:-2], np.ptp(around, axis=0) < _STEADY * tails.scale
    off = values[2:-2] - np.median(around, axis=0)
    spikes = np.isnan(found[own]) & steady & (np.abs(off) > _OUTLYING * tails.scale)
    found[own[spikes]] = off[spikes]
    return found


def _held(run: Run, finite: npt.NDArray[np.bool_]) -> Iterator[npt.NDArray[np.intp]]:
    """Yield the rows with a sample of each time in which a command is held."""
    changes = run.time_s[run.command_rows()]
    for start, end in zip(changes, [*changes[1:], math.inf], strict=True):
        inside = (run.time_s >= start + _HELD_S) & (run.time_s < end - _BEFORE_S)
        yield np.flatnonzero(finite & inside)


def _resolution(runs: Sequence[Run], name: str) -> float:
    """Return the smallest step between the values of a channel; 0 if there is none."""
    parts = [run.channels[name][run.finite(name)] for run in runs if name in run.channels]
    steps = np.diff(np.unique(np.concatenate(parts))) if parts else np.zeros(0)
    return float(np.min(steps[steps > 1e-9], initial=math.inf)) if np.any(steps > 1e-9) else 0.0


def _tails(values: FloatArray, resolution: float) -> Tails | None:
    """Return what noise has such differences between neighbours (n,); None if normal noise may have them."""
    if values.size < _FEWEST:
        return None
    # Rounding alone may leave most differences at 0: the scale is no finer than that.
    least = max(resolution / math.sqrt(12.0), 1e-12) * math.sqrt(1.0 + _MEDIAN_OF_FOUR)
    spread = max(float(np.sqrt(np.mean(values**2))), least)
    normal = float(np.sum(-0.5 * (values / spread) ** 2)) - values.size * math.log(spread)
    normal -= 0.5 * values.size * math.log(2.0 * math.pi)
    likelihood, freedom, scale = max(_student(values, freedom, least) for freedom in _FREEDOMS)
    if 2.0 * (likelihood - normal) - math.log(values.size) < _EVIDENCE:
        return None
    distance = np.abs(values) / scale
    reduced = (freedom + 1.0) / (freedom + distance**2) < 0.5
    return Tails(
        freedom,
        scale / math.sqrt(1.0 + _MEDIAN_OF_FOUR),
        float(np.mean(distance > _OUTLYING)),
        float(np.mean(reduced)),
    )


def _student(values: FloatArray, freedom: float, least: float) -> tuple[float, float, float]:
    """Return the greatest log likelihood of values under Student's t, its degrees of freedom and scale."""
    square, scale = values**2, max(float(np.median(np.abs(values))) / 0.6745, least)
    for _ in range(_ROUNDS):
        weight = (freedom + 1.0) / (freedom + square / scale**2)
        scale = max(math.sqrt(float(np.mean(weight * square))), least)
    constant = gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom) - 0.5 * math.log(math.pi * freedom)
    spread = 0.5 * (freedom + 1.0) * float(np.log1p(square / (freedom * scale**2)).sum())
    return float(values.size * (constant - math.log(scale)) - spread), freedom, scale
