"""Samples that count less: outliers, heavy-tailed noise, and noise that grows with the speed.

A sample is compared with its neighbours while a command is held: with the median of the two before and the
two after. If these differences have heavier tails than normal noise at that number of samples, they are
taken for Student's t, whose maximum likelihood is least squares with the weight (n + 1) / (n + z^2), with n
its degrees of freedom and z the sample's distance in units of the scale (Lange, Little and Taylor, J. Am.
Stat. Assoc. 84:881, 1989). Near a change of command neighbours differ by motion: there only a sample that is
far off steady neighbours counts less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from mecanum_env.statistics import MEDIAN_OF_NORMAL, VERY_STRONG
from mecanum_env.units import FloatArray
from sysid.logs.runs import Dataset, Run

_CHANNELS: Final = ("speed_rpm",)
"""Speeds of bench logs, which are steady while a command is held."""
_HELD_S: Final = 0.5
"""Time after a change of command from which neighbours differ by noise only [s]."""
_BEFORE_S: Final = 0.1  # and up to this time before the next one, for stamps are not exact
_FEWEST: Final = 100  # samples from which tails are judged
_FREEDOMS: Final = (2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0)
_MEDIAN_OF_FOUR: Final = 0.298
"""Variance of the median of four normal values of variance 1."""
_OUTLYING: Final = 5.0
"""Scales beyond which a sample is called an outlier: normal noise has one in two million."""
_STEADY: Final = 5.0
"""Range of four neighbours, in scales, up to which they are steady: that of normal noise in 99 of 100."""
_GROWTHS: Final = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Noise at the highest speed in scales at rest that are tried, without the part at rest."""
_ROUNDS: Final = 30  # of the scale's fixed point


@dataclass(frozen=True)
class Tails:
    """The noise of a channel that is not normal, or not the same at all speeds."""

    freedom: float
    """Degrees of freedom of Student's t; infinite for normal noise."""
    scale: float
    """Its scale at rest, in the channel's unit."""
    growth: float
    """By how much the scale grows with the speed, as a share of it: scale(v)^2 = scale^2 + (growth v)^2."""
    outliers: float
    """Share of the compared samples that are more than five scales off."""
    reduced: float
    """Share of the compared samples that count less than half of what their speed lets expect."""

    def at(self, level: FloatArray) -> FloatArray:
        """Return the scale at speeds `level`, in the channel's unit and of their shape."""
        return np.hypot(self.scale, self.growth * level)

    def note(self, channel: str) -> str:
        """Return what was found in a `channel`, in a sentence."""
        said = []
        if math.isfinite(self.freedom):
            said.append(
                f"the noise has heavy tails (Student's t with {self.freedom:g} degrees of freedom): "
                f"{self.reduced:.1%} of the samples count less than half, {self.outliers:.1%} are outliers "
                "beyond five times its scale"
            )
        if self.growth > 0.0:
            said.append(f"the noise grows with the speed, by {self.growth:.1%} of it")
        return f"{channel}: {', and '.join(said)}"


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
    for name in _CHANNELS:
        parts = [_differences(run, name) for run in dataset.runs]
        step = _resolution(dataset.runs, name)
        smooth = [
            _differences(run, name, _hidden(run, step, index)) for index, run in enumerate(dataset.runs)
        ]
        off, level = (np.concatenate([part[i] for part in smooth] or [np.zeros(0)]) for i in (0, 1))
        compared = np.isfinite(off)
        tails = _tails(off[compared], level[compared], step)
        if tails is None:
            continue
        found[name] = tails
        for own, run, part in zip(weights, dataset.runs, parts, strict=True):
            if name in run.channels:
                own[name] = _weights(_with_spikes(run, name, *part, tails), part[1], tails, error_rpm)
    if not found:
        return dataset, found
    runs = (replace(run, weights=own) for run, own in zip(dataset.runs, weights, strict=True))
    return replace(dataset, runs=tuple(runs)), found


def _hidden(run: Run, step: float, index: int) -> FloatArray:
    """Return what rounding to a `step` may have taken off each row's value, drawn at random, (n,).

    A law of tails is one of continuous values: of values rounded to coarse steps most are equal, and others
    seem far off.
    """
    return np.random.default_rng(index).uniform(-0.5 * step, 0.5 * step, run.time_s.size)


def _weights(differences: FloatArray, level: FloatArray, tails: Tails, error_rpm: float) -> FloatArray:
    scale = tails.at(level)
    square = (differences / scale) ** 2 / (1.0 + _MEDIAN_OF_FOUR)
    heavy = np.where(np.isfinite(square), _counts(square, tails.freedom), 1.0)
    at_rest = math.hypot(tails.scale, error_rpm)
    return np.asarray(heavy * (at_rest / np.hypot(scale, error_rpm)) ** 2)


def _counts(square: FloatArray, freedom: float) -> FloatArray:
    """Return the weight of samples whose squared distance, in scales, is `square`."""
    return (freedom + 1.0) / (freedom + square) if math.isfinite(freedom) else np.ones(square.shape)


def _differences(run: Run, name: str, hidden: FloatArray | None = None) -> tuple[FloatArray, FloatArray]:
    """Return by how much each sample differs from its neighbours, else NaN, and the size of these, both (n,).

    Samples are compared while a command is held. The size is that of the median of five neighbours. What
    rounding has `hidden` (n,) is added to the samples, if it is given.
    """
    found, level = np.full(run.time_s.size, np.nan), np.zeros(run.time_s.size)
    if name not in run.channels:
        return found, level
    rows = np.flatnonzero(run.finite(name))
    if rows.size >= 5:
        values = np.pad(run.channels[name][rows], 2, mode="edge")
        level[rows] = np.abs(np.median(np.lib.stride_tricks.sliding_window_view(values, 5), axis=1))
    for held in _held(run, run.finite(name)):
        values = run.channels[name][held]
        if values.size < 5 or np.ptp(values) == 0.0:
            # A constant channel, such as that of a wheel at rest, says nothing about noise.
            continue
        values = values if hidden is None else values + hidden[held]
        around = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
        found[held[2:-2]] = values[2:-2] - np.median(around, axis=0)
    return found, level


def _with_spikes(run: Run, name: str, differences: FloatArray, level: FloatArray, tails: Tails) -> FloatArray:
    """Return the differences with those of single samples near a change, between steady neighbours.

    Steady are the two nearest neighbours with one of the next two: a change may follow a spike, or go before
    it. `level` (n,) is the speed that the scale of the noise goes with.
    """
    found, rows = differences.copy(), np.flatnonzero(run.finite(name))
    if rows.size < 5:
        return found
    values = run.channels[name][rows]
    around = np.stack([values[:-4], values[1:-3], values[3:-1], values[4:]])
    own, scale = rows[2:-2], tails.at(level[rows[2:-2]])
    steady = np.minimum(np.ptp(around[:3], axis=0), np.ptp(around[1:], axis=0)) < _STEADY * scale
    off = values[2:-2] - np.median(around, axis=0)
    spikes = np.isnan(found[own]) & steady & (np.abs(off) > _OUTLYING * scale)
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


def _tails(values: FloatArray, level: FloatArray, resolution: float) -> Tails | None:
    """Return what noise has such differences between neighbours, at speeds, (n,); None for normal noise."""
    if values.size < _FEWEST:
        return None
    # Rounding alone may leave most differences at 0: the scale is no finer than that.
    least = max(resolution / math.sqrt(12.0), 1e-12) * math.sqrt(1.0 + _MEDIAN_OF_FOUR)
    top = max(float(np.max(level)), 1e-12)
    tried = []
    for growing in (0.0, *_GROWTHS):
        shape = np.hypot(1.0, growing * level / top)
        for freedom in (math.inf, *_FREEDOMS):
            likelihood, scale = _student(values / shape, freedom, 0.25 * least)
            parameters = 1 + math.isfinite(freedom) + (growing > 0.0)
            twice = 2.0 * (likelihood - float(np.log(shape).sum())) - parameters * math.log(values.size)
            tried.append((twice, freedom, scale, growing))
    plain, (best, freedom, scale, growing) = tried[0], max(tried)
    if best - plain[0] < VERY_STRONG:
        return None
    distance = np.abs(values) / np.hypot(max(scale, least), scale * growing * level / top)
    unit = math.sqrt(1.0 + _MEDIAN_OF_FOUR)
    return Tails(
        freedom,
        max(scale, least) / unit,
        scale * growing / top / unit,
        float(np.mean(distance > _OUTLYING)),
        float(np.mean(_counts(distance**2, freedom) < 0.5)),
    )


def _student(values: FloatArray, freedom: float, least: float) -> tuple[float, float]:
    """Return the greatest log likelihood of values under Student's t, and its scale."""
    square = values**2
    if not math.isfinite(freedom):
        scale = max(math.sqrt(float(np.mean(square))), least)
        spread = 0.5 * float(np.sum(square)) / scale**2
        return -spread - values.size * (math.log(scale) + 0.5 * math.log(2.0 * math.pi)), scale
    scale = max(float(np.median(np.abs(values))) / MEDIAN_OF_NORMAL, least)
    for _ in range(_ROUNDS):
        scale = max(math.sqrt(float(np.mean(_counts(square / scale**2, freedom) * square))), least)
    constant = gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom) - 0.5 * math.log(math.pi * freedom)
    spread = 0.5 * (freedom + 1.0) * float(np.log1p(square / (freedom * scale**2)).sum())
    return float(values.size * (constant - math.log(scale)) - spread), scale
