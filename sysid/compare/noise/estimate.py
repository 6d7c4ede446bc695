"""The noise of each compared channel: from repeats, else from neighbouring samples of held commands."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
import numpy.typing as npt
from scipy.optimize import brentq

from mecanum_env.kinematics import POSE
from mecanum_env.units import FloatArray
from sysid.compare.measured import EDGE_S, Block, Observations, activity_rpm, command_changes, displacements
from sysid.compare.noise.correlated import CorrelatedNoise, find_correlated
from sysid.compare.noise.timing import TimingNoise, slope_of
from sysid.compare.noise.uneven import UnevenNoise, find_uneven
from sysid.logs import Dataset, Run
from sysid.logs.checks import SETTLED_S
from sysid.logs.noise import noise_from_repeats
from sysid.logs.tail_laws import sensor_noise, smallest_step
from sysid.logs.tails import STEADY

_LEAST_SAMPLES: Final = 20
"""Degrees of freedom that repeats, or second differences that held commands, must have to be used."""
_LEAST_WINDOWS: Final = 6
"""The same for the displacements of a pose, of which a short log has few."""
_LEAST: Final = 1e-9
_FINEST: Final = 1e-3
"""Least noise of a robot's channel in logs that have none, over the rms of what it shows. Assumed: no
simulation of a robot is exact to less, and one that had to be would find a gap in its own numerics."""
_HOLE: Final = 1.5
"""Rows from one sample to the next, relative to their median, above which there are empty cells between."""
_EFFICIENCY: Final = 0.37 / 1.94
"""Degrees of freedom of the variance estimate per second difference. The median of squared normal values is
0.37 times as efficient as their mean, and neighbouring differences share samples: their correlations of -2/3
and 1/6 make 1.94 of them as informative as one that is independent."""
_MEDIAN_OF_SQUARES: Final = 0.4549  # of squared normal values, relative to their mean
_HARMONICS: Final = 8
"""Terms of the series for the rounding error that repeats share. Without noise they sum to 93 % of the whole,
with noise of a twentieth of a step more than 99 %."""
_NEGLIGIBLE_SHARE: Final = 0.01
"""Share of the variance of single samples below which a shared rounding error is left out. Assumed."""

Source = Literal["repeats", "scatter", "motion"]


@dataclass(frozen=True)
class Noise:
    """Standard deviation of single samples, by channel, each in its channel's unit."""

    sigma: Mapping[str, float]
    """Channel -> standard deviation; for a pose that of its displacement in a window."""
    source: Mapping[str, Source]
    """Channel -> where sigma is from: repeats of a command, or neighbouring samples of held commands, or of
    motion where no command is held, which makes it an upper bound."""

    correlated: Mapping[str, CorrelatedNoise] = field(default_factory=dict)
    """Channel -> the correlated part of the noise; channels of white noise are left out."""

    scatter: Mapping[str, float] = field(default_factory=dict)
    """Channel -> standard deviation by neighbouring samples of held commands alone."""

    degrees_of_freedom: float = math.inf
    """Degrees of freedom of `sigma`, all channels together."""

    rounding: Mapping[str, float] = field(default_factory=dict)
    """Channel -> standard deviation of that part of the rounding error that all repeats share, if any."""

    lasting: Mapping[str, float] = field(default_factory=dict)
    """Channel -> standard deviation of an offset that lasts as long as a command is held, if known."""

    uneven: Mapping[str, UnevenNoise] = field(default_factory=dict)
    """Channel -> how its noise changes after a change of command; channels of even noise are left out."""

    timing: Mapping[str, TimingNoise] = field(default_factory=dict)
    """Channel -> how much of its noise is that changes of command act at other times, if that is known."""

    def settled(self, channel: str) -> float:
        """Return the standard deviation of single samples while a command is held, in the channel's unit."""
        changing = self.timing.get(channel) or self.uneven.get(channel)
        return self.sigma[channel] * (1.0 if changing is None else changing.settled)

    def transient(self, channel: str, run: Run, time_s: FloatArray) -> FloatArray:
        """Return the standard deviation of what decays in a `channel` after a run's changes of command.

        It is given at the times (n,) [s].
        """
        changing = self.uneven.get(channel)
        if changing is None:
            return np.zeros(time_s.shape)
        return changing.transient * activity_rpm(run, time_s, changing.decay_s)

    def variance(self, block: Block, run: Run) -> FloatArray:
        """Return the variance of each of a block's values, in a run of its situation, shape (m,)."""
        lasting = self.transient(block.channel, run, block.time_s) ** 2 / block.independent_repeats
        if late := self.timing.get(block.channel):
            moved = late.delay_s * slope_of(block.value, block.time_s)
            lasting = lasting + moved**2 / block.independent_repeats
        return np.asarray(self.settled(block.channel) ** 2 / block.weight + lasting)

    def scaled(self, factors: Mapping[str, float]) -> Noise:
        """Return the noise with factors on the standard deviations of some channels."""
        uneven = {
            name: replace(changing, transient=changing.transient * factors.get(name, 1.0))
            for name, changing in self.uneven.items()
        }
        timing = {
            name: replace(late, delay_s=late.delay_s * factors.get(name, 1.0))
            for name, late in self.timing.items()
        }
        sigma = {name: size * factors.get(name, 1.0) for name, size in self.sigma.items()}
        return replace(self, sigma=sigma, uneven=uneven, timing=timing)

    def inconsistent_channels(self, factor: float) -> tuple[str, ...]:
        """Return the channels whose repeats differ over `factor` times as much as neighbouring samples."""
        return tuple(n for n, s in self.sigma.items() if s > factor * self.scatter.get(n, s))

    def is_like(self, other: Noise, factor: float) -> bool:
        """Return whether the noise of each channel is at most `factor` times that of `other` noise."""
        return all(s <= factor * other.sigma[n] for n, s in self.sigma.items() if n in other.sigma)

    def beside(self, other: Noise) -> Noise:
        """Return this noise with that of repeats in `other` logs of the same sensors where it has none.

        Neighbouring samples tell nothing of noise that lasts for longer than a sample.
        """
        taken = [
            name
            for name, source in self.source.items()
            if other.source.get(name) == "repeats"
            and (source == "motion" or (source == "scatter" and other.sigma[name] > self.sigma[name]))
        ]
        if not taken:
            return self
        correlated = {n: c for n, c in self.correlated.items() if n not in taken}
        uneven = {n: c for n, c in self.uneven.items() if n not in taken}
        return replace(
            self,
            uneven={**uneven, **{n: c for n, c in other.uneven.items() if n in taken}},
            sigma={**self.sigma, **{name: other.sigma[name] for name in taken}},
            source={**self.source, **dict.fromkeys(taken, "repeats")},
            correlated={**correlated, **{n: c for n, c in other.correlated.items() if n in taken}},
            degrees_of_freedom=other.degrees_of_freedom,
        )

    @property
    def from_repeats(self) -> bool:
        """Whether the noise of every channel is from repeats."""
        return all(source == "repeats" for source in self.source.values())


def _rms(blocks: Sequence[Block]) -> float:
    """Return the rms of what the blocks of a channel show, in its unit."""
    return math.sqrt(float(np.mean(np.concatenate([block.value for block in blocks]) ** 2)))


def measure_noise(dataset: Dataset, observations: Observations) -> Noise:
    """Return the noise of each channel, blind to the test runs, which decisions must not see.

    It is from the repeats among the observations. Where these are too few, since stamps differ or only some
    of the runs are observed, it is from the repeats among the dataset's fit and validation runs, else from
    neighbouring samples of held commands. Repeats of test runs count only if test runs are observed. Repeats
    of a pose may start anywhere, since displacements are in the robot's frame.
    """
    sigma: dict[str, float] = {}
    source: dict[str, Source] = {}
    correlated: dict[str, CorrelatedNoise] = {}
    scatter: dict[str, float] = {}
    rounding: dict[str, float] = {}
    uneven: dict[str, UnevenNoise] = {}
    freedom_of_repeats, differences = 0, 0
    bench = dataset.level == "bench"
    splits = {"fit", "validation", *(situation.split for situation in observations.situations)}
    runs = [run for run in dataset.runs if run.split in splits]
    repeats = noise_from_repeats(runs) or {}
    for name in observations.channels:
        blocks = [block for block in observations.blocks if block.channel == name]
        by_neighbours, count, held = (
            (*_pose_scatter(runs, name), True) if name in POSE else _scatter(observations, blocks)
        )
        # A quantised speed can be constant during smooth motion; that does not mean zero noise.
        resolution = _resolution(observations, blocks)
        least = max(_LEAST, resolution / math.sqrt(12.0), 0.0 if bench else _FINEST * _rms(blocks))
        scatter[name], differences = max(by_neighbours, least), differences + count
        freedom = sum(block.degrees_of_freedom for block in blocks)
        squares = sum(block.repeat_squares for block in blocks)
        if name in POSE and freedom < _LEAST_SAMPLES:
            squares, freedom = _pose_repeats(runs, name)
        if freedom >= (_LEAST_WINDOWS if name in POSE else _LEAST_SAMPLES):
            sigma[name], source[name] = math.sqrt(squares / freedom), "repeats"
            freedom_of_repeats += freedom
        elif name not in POSE and name in repeats and repeats[name].degrees_of_freedom >= _LEAST_SAMPLES:
            sigma[name], source[name] = repeats[name].std, "repeats"
            freedom_of_repeats += repeats[name].degrees_of_freedom
        else:
            sigma[name], source[name] = scatter[name], "scatter" if held else "motion"
        shared = shared_rounding(sigma[name], resolution)
        sigma[name] = max(sigma[name], least)
        if shared**2 > _NEGLIGIBLE_SHARE * sigma[name] ** 2:
            rounding[name] = shared
        if source[name] == "repeats" and name not in POSE:
            if changing := find_uneven(observations, blocks, sigma[name], least):
                uneven[name] = changing
            if lasting := _correlated(observations, blocks, sigma[name], changing):
                correlated[name] = lasting
    known = freedom_of_repeats if set(source.values()) == {"repeats"} else _EFFICIENCY * differences
    return Noise(sigma, source, correlated, scatter, max(1.0, known), rounding, uneven=uneven)


def shared_rounding(sigma: float, resolution: float) -> float:
    """Return the standard deviation of the rounding error that is the same in all repeats.

    A value x with normal noise of standard deviation s, rounded to multiples of q, is on average off by a
    periodic function of x, whose variance over x is

        v = q^2 / (2 pi^2) sum_k exp(-4 pi^2 k^2 s^2 / q^2) / k^2

    (Widrow and Kollar, Quantization Noise, 2008, chapter 4). Repeats then differ by the variance
    s^2 + q^2 / 12 - v, which is strictly rising with s, and tells s. Without noise all of it is shared, from
    half a step of noise on nothing is.

    Args:
        sigma: standard deviation of single samples, by which repeats differ, in the channel's unit.
        resolution: q, the smallest step of the sensor, in the same unit.
    """
    if resolution <= 0.0:
        return 0.0
    order = np.arange(1, _HARMONICS + 1)
    ratio = (sigma / resolution) ** 2

    def shared(s: float) -> float:
        terms = np.exp(-((2.0 * math.pi * order * s) ** 2)) / order**2
        return float(np.sum(terms)) / (2.0 * math.pi**2)

    def excess(s: float) -> float:
        return s**2 + 1.0 / 12.0 - shared(s) - ratio

    if excess(0.0) >= 0.0:
        return resolution * math.sqrt(shared(0.0))
    noise = brentq(excess, 0.0, 1.0 + sigma / resolution)
    return resolution * math.sqrt(shared(float(noise)))


def _pose_repeats(runs: Sequence[Run], name: str) -> tuple[float, int]:
    """Return the squared deviations of repeats' displacements from their means, and the degrees of freedom.

    Repeats are compared window by window, wherever they start and whatever their stamps.
    """
    groups: dict[str, list[FloatArray]] = {}
    for run in runs:
        if name in run.channels:
            groups.setdefault(run.group, []).append(displacements(run.time_s, run.channels)[name][1])
    squares, freedom = 0.0, 0
    for parts in groups.values():
        values = np.array([part[: min(map(len, parts))] for part in parts])
        values = values[:, np.isfinite(values).all(axis=0)]
        squares += float(np.sum((values - values.mean(axis=0)) ** 2))
        freedom += (len(parts) - 1) * values.shape[1]
    return squares, freedom


def _pose_scatter(runs: Sequence[Run], name: str) -> tuple[float, int]:
    """Return the noise of a pose's displacements by second differences of its samples, and their number.

    A window is so long that second differences of displacements would be motion.
    """
    squares: list[FloatArray] = []
    for run in [run for run in runs if name in run.channels]:
        values = run.channels[name][run.finite(name)]
        together = max(1, round(2.0 * EDGE_S / max(run.median_interval_s, _LEAST)))
        turned = np.unwrap(values) if name == "yaw_rad" else values
        # Of a sample, six variances; of a displacement, those of two means.
        squares.append(np.diff(turned, 2) ** 2 / 6.0 * 2.0 / together)
    found = np.concatenate(squares)
    return (math.sqrt(float(np.median(found)) / _MEDIAN_OF_SQUARES) if found.size else 0.0), found.size


def _resolution(observations: Observations, blocks: list[Block]) -> float:
    """Return the smallest step of a channel's sensor; 0 for displacements, which are computed."""
    channel = blocks[0].channel
    if channel in POSE:
        return 0.0
    runs = [run for block in blocks for run in observations.situations[block.situation].runs]
    return sensor_noise(runs, channel).step if channel in STEADY else smallest_step(runs, channel)


def _correlated(
    observations: Observations, blocks: list[Block], sigma: float, uneven: UnevenNoise | None
) -> CorrelatedNoise | None:
    """Return the correlated part of the settled noise, None if its autocorrelation is insignificant."""
    parts = []
    for block in blocks:
        deviation = np.nan_to_num(block.deviations) if block.degrees_of_freedom else np.zeros((0, 0))
        if uneven is not None and deviation.size:
            run = observations.situations[block.situation].runs[0]
            deviation = uneven.settled_part(deviation, run, block.sample_times_s, sigma)
        parts.append(deviation)
    interval = float(np.median(np.concatenate([np.diff(b.time_s) for b in blocks if b.time_s.size > 1])))
    return find_correlated(parts, interval)


def _scatter(observations: Observations, blocks: list[Block]) -> tuple[float, int, bool]:
    """Return the noise by second differences, which vanish in settled motion, and their number.

    The third value is whether they are of settled motion; there may be too little of it.
    """
    settled_squares: list[FloatArray] = []
    all_squares: list[FloatArray] = []
    for block in blocks:
        run = observations.situations[block.situation].runs[0]
        changes = np.concatenate([[0.0], command_changes(run)[0]])
        since = block.time_s - changes[np.searchsorted(changes, block.time_s, side="right") - 1]
        squares, neighbours = np.diff(block.value, 2) ** 2, _without_holes(block)
        # Of one hold: the last of the three samples may be of the next one.
        settled = (since[:-2] >= SETTLED_S) & (since[2:] > since[:-2])
        weight = 1.0 / block.weight[:-2] + 4.0 / block.weight[1:-1] + 1.0 / block.weight[2:]
        settled_squares.append((squares / weight)[settled & neighbours])
        all_squares.append((squares * block.weight[1:-1] / 6.0)[neighbours])
    found = np.concatenate(settled_squares)
    held = found.size >= _LEAST_SAMPLES
    if not held:
        found = np.concatenate(all_squares)
    # The median, as a few second differences are motion.
    return (math.sqrt(float(np.median(found)) / _MEDIAN_OF_SQUARES) if found.size else 0.0), found.size, held


def _without_holes(block: Block) -> npt.NDArray[np.bool_]:
    """Return which second differences (m - 2,) are of samples without empty cells between them."""
    step = np.diff(block.rows[:, 0])
    near: npt.NDArray[np.bool_] = step <= _HOLE * np.median(step) if step.size else np.zeros(0, bool)
    return near[1:] & near[:-1]
