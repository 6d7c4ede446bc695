"""The law of noise: normal or heavy-tailed, the same at all speeds or growing, of a sensor with steps or not.

Heavy tails are those of Student's t. A law of tails is one of continuous values. Of values rounded to coarse
steps most are equal, and others seem far off: what rounding has hidden is drawn at random. The step is that
of the sensor, such as one count of an encoder in a sampling interval. It may be far coarser than that of the
numbers in the log, where these are scaled, filtered or have uneven stamps. So steps are tried upwards until
the differences follow one of the laws.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import gammaln
from scipy.stats import norm, t

from mecanum_env.statistics import MEDIAN_OF_NORMAL, VERY_STRONG
from mecanum_env.units import FloatArray
from sysid.logs.neighbours import OF_MEDIAN, differences, steps
from sysid.logs.runs import Run

OUTLYING: Final = 5.0
"""Scales beyond which a sample is called an outlier: normal noise has one in two million."""

_FEWEST: Final = 100  # samples from which tails are judged
_FREEDOMS: Final = (2.0, 2.5, 3.0, 4.0, 5.0, 7.0, 10.0, 15.0, 20.0)
_GROWTHS: Final = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Noise at the highest speed in scales at rest that are tried, without the part at rest."""
_ROUNDS: Final = 30  # of the scale's fixed point
_CLOSE: Final = 0.08
"""Largest difference between the shares of samples below some size, as they are and by a law, that is none:
that of Student's t from normal noise in which each tenth sample is ten standard deviations off."""
_BY_CHANCE: Final = 1.22
"""The same times the square root of the number of samples, which one in ten draws of the law itself exceeds
(Kolmogorov)."""
_STEPS: Final = 10  # sizes of a step that are tried
_SMALL: Final = 0.02
"""Share of the rms difference between two samples below which one is not that of a step. Assumed."""


@dataclass(frozen=True)
class Tails:
    """The noise of a channel."""

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

    @property
    def is_plain(self) -> bool:
        """Whether the noise is normal and the same at all speeds."""
        return math.isinf(self.freedom) and self.growth == 0.0

    def at(self, level: FloatArray) -> FloatArray:
        """Return the scale at speeds `level`, in the channel's unit and of their shape."""
        return np.hypot(self.scale, self.growth * level)

    def counts(self, square: FloatArray) -> FloatArray:
        """Return the weight of samples whose squared distance, in scales, is `square`."""
        return counts(square, self.freedom)

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


@dataclass(frozen=True)
class SensorNoise:
    """The noise of a channel, and what it is rounded to."""

    step: float
    """Smallest step of the sensor, in the channel's unit; 0 if there is none."""
    tails: Tails | None
    """Its law; None if there are too few samples."""


def sensor_noise(runs: Sequence[Run], name: str) -> SensorNoise:
    """Return the noise of a channel of bench runs and the smallest step of its sensor.

    The step is that of the numbers in the logs, unless the differences between neighbours follow a law only
    as numbers that are rounded to a coarser one. Where they follow none of the laws at any step, it is that
    of the numbers with the law that comes nearest. The random draws are the same each time.
    """
    finest = smallest_step(runs, name)
    if sum(int(np.isfinite(differences(run, name).off).sum()) for run in runs) < _FEWEST:
        return SensorNoise(finest, None)
    moves = np.abs(np.concatenate([steps(run, name) for run in runs]))
    moves = moves[moves > _SMALL * float(np.sqrt(np.mean(moves**2)))]
    coarser = np.quantile(moves, np.linspace(0.05, 0.95, _STEPS)) if moves.size else np.zeros(0)
    found: list[SensorNoise] = []
    for step in (finest, *(float(one) for one in np.unique(coarser) if one > finest)):
        smooth = [differences(run, name, _hidden(run, step, index)) for index, run in enumerate(runs)]
        off, level = (np.concatenate([getattr(one, part) for one in smooth]) for part in ("off", "level"))
        compared = np.isfinite(off)
        tails = law_of(off[compared], level[compared], step)
        found.append(SensorNoise(step, tails))
        close = max(_CLOSE, _BY_CHANCE / math.sqrt(compared.sum()))
        if distance(off[compared], level[compared], tails) <= close:
            return found[-1]
    return found[0]


def smallest_step(runs: Sequence[Run], name: str) -> float:
    """Return the smallest step between the values of a channel; 0 if there is none."""
    parts = [run.channels[name][run.finite(name)] for run in runs if name in run.channels]
    apart = np.diff(np.unique(np.concatenate(parts))) if parts else np.zeros(0)
    return float(np.min(apart[apart > 1e-9], initial=math.inf)) if np.any(apart > 1e-9) else 0.0


def law_of(values: FloatArray, level: FloatArray, step: float) -> Tails:
    """Return the law that makes `values` (n,), differences between neighbours at speeds `level`, most likely.

    Normal noise that is the same at all speeds is preferred. The scale is no finer than that of rounding to a
    `step`, which alone may leave most differences at 0.
    """
    least = max(step / math.sqrt(12.0), 1e-12) * OF_MEDIAN
    top = max(float(np.max(level)), 1e-12)
    tried = []
    for growing in (0.0, *_GROWTHS):
        shape = np.hypot(1.0, growing * level / top)
        for freedom in (math.inf, *_FREEDOMS):
            likelihood, scale = _student(values / shape, freedom, 0.25 * least)
            parameters = 1 + math.isfinite(freedom) + (growing > 0.0)
            twice = 2.0 * (likelihood - float(np.log(shape).sum())) - parameters * math.log(values.size)
            tried.append((twice, freedom, scale, growing))
    plain, best = tried[0], max(tried)
    _, freedom, scale, growing = best if best[0] - plain[0] >= VERY_STRONG else plain
    off = np.abs(values) / np.hypot(max(scale, least), scale * growing * level / top)
    return Tails(
        freedom,
        max(scale, least) / OF_MEDIAN,
        scale * growing / top / OF_MEDIAN,
        float(np.mean(off > OUTLYING)),
        float(np.mean(counts(off**2, freedom) < 0.5)),
    )


def distance(values: FloatArray, level: FloatArray, law: Tails) -> float:
    """Return the largest difference between the shares of samples below some size, as they are and by a law.

    `values` (n,) are differences between neighbours, at speeds `level`.
    """
    off = np.sort(np.abs(values) / law.at(level) / OF_MEDIAN)
    single = norm.cdf(off) if math.isinf(law.freedom) else t.cdf(off, law.freedom)
    expected, shares = 2.0 * single - 1.0, np.arange(off.size + 1) / off.size
    return float(max(np.max(shares[1:] - expected), np.max(expected - shares[:-1])))


def counts(square: FloatArray, freedom: float) -> FloatArray:
    """Return the weight of samples whose squared distance, in scales, is `square`, for some `freedom`."""
    return (freedom + 1.0) / (freedom + square) if math.isfinite(freedom) else np.ones(square.shape)


def _hidden(run: Run, step: float, index: int) -> FloatArray:
    """Return what rounding to a `step` may have taken off each row's value, drawn at random, (n,)."""
    return np.random.default_rng(index).uniform(-0.5 * step, 0.5 * step, run.time_s.size)


def _student(values: FloatArray, freedom: float, least: float) -> tuple[float, float]:
    """Return the greatest log likelihood of values under Student's t, and its scale."""
    square = values**2
    if not math.isfinite(freedom):
        scale = max(math.sqrt(float(np.mean(square))), least)
        spread = 0.5 * float(np.sum(square)) / scale**2
        return -spread - values.size * (math.log(scale) + 0.5 * math.log(2.0 * math.pi)), scale
    scale = max(float(np.median(np.abs(values))) / MEDIAN_OF_NORMAL, least)
    for _ in range(_ROUNDS):
        scale = max(math.sqrt(float(np.mean(counts(square / scale**2, freedom) * square))), least)
    constant = gammaln(0.5 * (freedom + 1.0)) - gammaln(0.5 * freedom) - 0.5 * math.log(math.pi * freedom)
    spread = 0.5 * (freedom + 1.0) * float(np.log1p(square / (freedom * scale**2)).sum())
    return float(values.size * (constant - math.log(scale)) - spread), scale
