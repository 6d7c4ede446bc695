"""The noise of each compared channel: from repeats, else from neighbouring samples of held commands."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np
import numpy.typing as npt

from mecanum_env.units import FloatArray
from sysid.compare.model_error import command_changes
from sysid.compare.observations import Block, Observations
from sysid.compare.prediction import POSE
from sysid.logs import Dataset
from sysid.logs.noise import noise_from_repeats

SETTLED_S: Final = 0.5
"""A command held this long has settled."""
_LEAST_SAMPLES: Final = 20
_LEAST: Final = 1e-9
_CLEAR: Final = 4.0  # standard deviations above chance
_HOLE: Final = 1.5
"""Rows between two neighbours, relative to the median, above which samples are missing between them."""
_EFFICIENCY: Final = 0.37 / 1.94
"""Degrees of freedom of a variance by the median of squared second differences, per difference: the median of
a squared normal tells 0.37 as much as its mean, and neighbouring differences share samples (correlations -2/3
and 1/6, whose squares make 1.94 of them tell as much as one)."""
_BLURRED: Final = 0.5
"""Noise over a sensor's step from which rounding differs from sample to sample and from repeat to repeat."""

Source = Literal["repeats", "scatter"]


@dataclass(frozen=True)
class CorrelatedNoise:
    """Noise that lasts longer than a sample: repeats that differ for a while, not sample by sample."""

    share: float
    """Of the variance."""
    time_s: float
    """In which it has fallen to 1/e."""


@dataclass(frozen=True)
class Noise:
    """Standard deviation of single compared values."""

    sigma: Mapping[str, float]
    """Channel -> standard deviation, in its unit; for poses, of the way made in a window."""
    source: Mapping[str, Source]
    """Where it is from: repeats of a command, or scatter of neighbouring samples (model error left out)."""

    correlated: Mapping[str, CorrelatedNoise] = field(default_factory=dict)
    """Channel -> the part of the noise that lasts; none where neighbouring samples are independent."""

    scatter: Mapping[str, float] = field(default_factory=dict)
    """Channel -> standard deviation by neighbouring samples of held commands alone."""

    degrees_of_freedom: float = math.inf
    """Degrees of freedom with which `sigma` is known, all channels together."""

    rounding: Mapping[str, float] = field(default_factory=dict)
    """Channel -> standard deviation of rounding that all repeats share; none where noise blurs the steps."""

    def inconsistent_channels(self, factor: float) -> tuple[str, ...]:
        """Return the channels whose repeats differ `factor` times as much as neighbouring samples."""
        return tuple(n for n, s in self.sigma.items() if s > factor * self.scatter.get(n, s))

    @property
    def from_repeats(self) -> bool:
        """Whether repeats gave the noise of every channel."""
        return all(source == "repeats" for source in self.source.values())


def measure_noise(dataset: Dataset, observations: Observations) -> Noise:
    """Return the noise of each channel, without a look at the test runs that decisions must not see.

    It is from the repeats among the observations, else (where their stamps differ, or only some of the
    repeats are observed) from those of the dataset's fit and validation runs, else from neighbouring samples.
    Repeats of test runs count only if the observations are of test runs themselves.

    Args:
        dataset: bench or robot logs.
        observations: made from it.
    """
    sigma: dict[str, float] = {}
    source: dict[str, Source] = {}
    correlated: dict[str, CorrelatedNoise] = {}
    scatter: dict[str, float] = {}
    rounding: dict[str, float] = {}
    from_repeats, differences = 0, 0
    splits = {"fit", "validation", *(situation.split for situation in observations.situations)}
    repeats = noise_from_repeats([run for run in dataset.runs if run.split in splits]) or {}
    for name in observations.channels:
        blocks = [block for block in observations.blocks if block.channel == name]
        by_neighbours, count = _scatter(observations, blocks)
        # A speed in counts stands still where the motion is smooth; that is no silence.
        step = _resolution(observations, blocks)
        least = max(_LEAST, step / math.sqrt(12.0))
        scatter[name], differences = max(by_neighbours, least), differences + count
        freedom = sum(block.degrees_of_freedom for block in blocks)
        if freedom >= _LEAST_SAMPLES:
            sigma[name], source[name] = (
                math.sqrt(sum(block.repeat_squares for block in blocks) / freedom),
                "repeats",
            )
            from_repeats += freedom
        elif name in repeats and name not in POSE and repeats[name].degrees_of_freedom >= _LEAST_SAMPLES:
            # Stamps differ from repeat to repeat.
            sigma[name], source[name] = repeats[name].std, "repeats"
            from_repeats += repeats[name].degrees_of_freedom
        else:
            sigma[name], source[name] = scatter[name], "scatter"
        if sigma[name] < _BLURRED * step:
            rounding[name] = step / math.sqrt(12.0)
        sigma[name] = max(sigma[name], least)
        found = _lasting(blocks)
        if found is not None:
            correlated[name] = found
    known = from_repeats if "scatter" not in source.values() else _EFFICIENCY * differences
    return Noise(sigma, source, correlated, scatter, max(1.0, known), rounding)


def _resolution(observations: Observations, blocks: list[Block]) -> float:
    """Return the smallest step between a channel's values, in its unit; 0 for a way, which is computed."""
    if blocks[0].channel in POSE:
        return 0.0
    runs = [run for block in blocks for run in observations.situations[block.situation].runs]
    values = np.concatenate(
        [run.channels[blocks[0].channel] for run in runs if blocks[0].channel in run.channels]
    )
    apart = np.diff(np.unique(values[np.isfinite(values)]))
    return float(np.min(apart[apart > _LEAST], initial=math.inf)) if np.any(apart > _LEAST) else 0.0


def _lasting(blocks: list[Block]) -> CorrelatedNoise | None:
    """Return the part of the repeats' deviations that lasts, None where chance makes as much."""
    products = np.sum([block.lagged_products for block in blocks], axis=0)
    samples = sum(block.value.size * block.repeats for block in blocks if block.degrees_of_freedom)
    if products[0] <= 0.0 or blocks[0].channel in POSE:
        return None
    likeness = products / products[0]
    if likeness[1] < _CLEAR / math.sqrt(samples):
        return None
    # Lag 0 has the white part too: the lasting part alone falls from its own share, found from lags 1 and 2.
    fall = float(np.clip(likeness[2] / likeness[1], 0.1, 0.99)) if likeness[2] > 0.0 else 0.1
    share = float(np.clip(likeness[1] / fall, 0.0, 1.0))
    below = np.flatnonzero(likeness[1:] < share / math.e)
    lag = 1 + int(below[0]) if below.size else likeness.size
    interval = float(np.median(np.concatenate([np.diff(b.time_s) for b in blocks if b.time_s.size > 1])))
    return CorrelatedNoise(share, lag * interval)


def _scatter(observations: Observations, blocks: list[Block]) -> tuple[float, int]:
    """Return the noise from second differences, which a settled motion does not have, and their number."""
    squares: list[FloatArray] = []
    for block in blocks:
        run = observations.situations[block.situation].runs[0]
        changes = np.concatenate([[0.0], command_changes(run)[0]])
        since = block.time_s - changes[np.searchsorted(changes, block.time_s, side="right") - 1]
        second = np.diff(block.value, 2)
        settled = since[:-2] >= (SETTLED_S if block.channel not in POSE else 0.0)
        weight = 1.0 / block.weight[:-2] + 4.0 / block.weight[1:-1] + 1.0 / block.weight[2:]
        squares.append((second**2 / weight)[settled & _adjacent(block)])
    together = np.concatenate(squares) if squares else np.empty(0)
    if together.size < _LEAST_SAMPLES:
        together = np.concatenate(
            [(np.diff(block.value, 2) ** 2 * block.weight[1:-1] / 6.0)[_adjacent(block)] for block in blocks]
        )
    # A median, since a few second differences are motion: that of a squared normal is 0.4549 of its mean.
    return (math.sqrt(float(np.median(together)) / 0.4549) if together.size else 0.0), together.size


def _adjacent(block: Block) -> npt.NDArray[np.bool_]:
    """Return which second differences (m - 2,) are of samples without a hole between them."""
    first = block.rows[0] if block.channel in POSE else np.array([rows[0] for rows in block.rows])
    gap = np.diff(first)
    near: npt.NDArray[np.bool_] = gap <= _HOLE * np.median(gap) if gap.size else np.zeros(0, bool)
    return near[1:] & near[:-1]
