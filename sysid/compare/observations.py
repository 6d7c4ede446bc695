"""What a study compares: each channel of each distinct command sequence, repeats averaged.

A pose drifts: an error of heading made once shows in all that follows. Poses are therefore compared as the
way made in each window, seen from the heading at its start. Wheel speeds and velocities are compared sample
by sample. Samples that a slow sensor repeats say nothing new and are left out. A channel that repeats another
(two wheels on one sensor) stays: without it nothing would hold the model's own wheel there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.units import FloatArray
from sysid.compare.prediction import POSE, Start, start_of
from sysid.logs import Dataset, Run, Split
from sysid.logs.runs import UNITS

WINDOW_S: Final = 0.4
"""Of the ways in which poses are compared."""
EDGE_S: Final = 0.05
"""A pose at a window's edge is the mean of the samples this near."""
LAGS: Final = 40
"""Of the products of deviations."""
MOST_SAMPLES: Final = 600
"""Of one block; more are averaged in pairs, triples ..."""

Rows = npt.NDArray[np.intp]
"""Indices into the rows of a run."""
Channels = Mapping[str, FloatArray]
"""Column of a log -> values at the rows of a run, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Situation:
    """Runs with the same commands at the same stamps: one simulation predicts them all."""

    runs: tuple[Run, ...]
    start: Start

    @property
    def split(self) -> Split:
        """Split of all its runs."""
        return self.runs[0].split

    @property
    def group(self) -> str:
        """Group of all its runs."""
        return self.runs[0].group


@dataclass(frozen=True, eq=False)
class Block:
    """One channel of one situation: the mean over its repeats."""

    situation: int
    """Index into the situations."""
    channel: str
    time_s: FloatArray
    """Shape (m,)."""
    value: FloatArray
    """Mean over the repeats, shape (m,)."""
    weight: FloatArray
    """Samples of a log that each value is the mean of, shape (m,)."""
    repeat_squares: float
    """Sum over the values of the repeats' squared differences from their mean, each times its samples."""
    degrees_of_freedom: int
    """Degrees of freedom of `spread`."""
    lagged_products: FloatArray
    """Like `spread`, of each deviation with that so many samples later (lag 0, 1 ...), shape (LAGS,)."""
    repeats: int
    """Runs that the values are the mean of."""

    rows: tuple[Rows, ...]
    """Rows of the run that each value is the mean of; for poses the windows, one array."""
    shares: tuple[FloatArray, ...]
    """Samples at each of these rows relative to the first: missing ones make them unequal."""

    def of(self, run: Run, channels: Channels) -> FloatArray:
        """Return from a run's (predicted) channels what is compared with `value`, shape (m,)."""
        if self.channel in POSE:
            return _ways(run.time_s, channels)[self.channel][1][self.rows[0]]
        return _means(channels[self.channel], self.rows, self.shares)


@dataclass(frozen=True, eq=False)
class Observations:
    """All situations and blocks of a dataset."""

    situations: tuple[Situation, ...]
    blocks: tuple[Block, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order of a log's columns."""
        there = {block.channel for block in self.blocks}
        return tuple(name for name in UNITS if name in there)


def observe(dataset: Dataset) -> Observations:
    """Return what a study compares.

    Args:
        dataset: bench or robot logs.

    Raises:
        InputError: no run has a measured sample.
    """
    held = {(f.file, f.message.split(":")[0]) for f in dataset.findings if f.kind == "held_samples"}
    grouped: dict[tuple[object, ...], list[Run]] = {}
    for run in dataset.runs:
        grouped.setdefault(_key(run), []).append(run)
    situations: list[Situation] = []
    blocks: list[Block] = []
    for runs in grouped.values():
        situation = Situation(tuple(runs), start_of(runs[0]))
        for name in UNITS:
            with_it = [run for run in runs if name in run.channels]
            if name == "battery_v" or not with_it:
                continue
            parts = [_masked(run, name, (run.file, name) in held) for run in with_it]
            block = _block(len(situations), name, with_it, parts)
            if block is not None:
                blocks.append(block)
        situations.append(situation)
    if not blocks:
        raise InputError(f"{dataset.name}: no measured sample in any run")
    return Observations(tuple(situations), tuple(blocks))


def _key(run: Run) -> tuple[object, ...]:
    start = start_of(run)
    # Noise on the first samples does not make another situation.
    about = (round(start.initial_rpm), start.moving, round(start.yaw_rad, 1))
    return (run.split, run.group, about, run.time_s.tobytes(), run.command.wheels_rpm.tobytes())


def _masked(run: Run, name: str, held: bool) -> FloatArray:
    values = np.array(run.channels[name])
    if held:
        values[1:][values[1:] == run.channels[name][:-1]] = np.nan
    return values


def _block(situation: int, name: str, runs: Sequence[Run], parts: Sequence[FloatArray]) -> Block | None:
    time = runs[0].time_s
    if name in POSE:
        time, values = _pose_values(name, runs)
    else:
        values = np.array(parts)
    there = np.isfinite(values)
    count = there.sum(axis=0)
    use = np.flatnonzero(count)
    if use.size == 0:
        return None
    values, there, count = values[:, use], there[:, use], count[use]
    mean = np.where(there, values, 0.0).sum(axis=0) / count
    deviation = np.where(there, values - mean, 0.0)
    products = np.zeros(LAGS)
    for lag in range(min(LAGS, mean.size)):
        products[lag] = float(np.sum(deviation[:, lag:] * deviation[:, : mean.size - lag]))
    spread = float(products[0])
    freedom = int((count - 1).sum())
    if name in POSE:
        return Block(
            situation,
            name,
            time[use],
            mean,
            count.astype(float),
            spread,
            freedom,
            products,
            len(runs),
            (use,),
            (),
        )
    rows = _thinned(use)
    index = {int(row): i for i, row in enumerate(use)}
    chosen = [np.array([index[int(row)] for row in part]) for part in rows]
    weights = np.array([count[part].sum() for part in chosen], float)
    value = np.array([np.average(mean[part], weights=count[part]) for part in chosen])
    shares = tuple(count[part] / count[part][0] for part in chosen)
    stamps = np.array([time[use][part].mean() for part in chosen])
    return Block(
        situation, name, stamps, value, weights, spread, freedom, products, len(runs), tuple(rows), shares
    )


def _thinned(rows: Rows) -> list[Rows]:
    together = -(-rows.size // MOST_SAMPLES)
    return [rows[i : i + together] for i in range(0, rows.size, together)]


def _means(values: FloatArray, rows: Sequence[Rows], shares: Sequence[FloatArray]) -> FloatArray:
    if len(rows[0]) == 1:
        return values[np.array(rows)[:, 0]]
    return np.array([(values[r] * s).sum() / s.sum() for r, s in zip(rows, shares, strict=True)])


def _pose_values(name: str, runs: Sequence[Run]) -> tuple[FloatArray, FloatArray]:
    ways = [_ways(run.time_s, run.channels)[name] for run in runs]
    return ways[0][0], np.array([values for _, values in ways])


def _ways(time_s: FloatArray, channels: Channels) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return per pose channel the middle of each window and the way made in it, ahead and to the left."""
    edges = np.arange(0.0, float(time_s[-1]) + 1e-9, WINDOW_S)
    low = np.searchsorted(time_s, edges - EDGE_S - 1e-9)
    high = np.searchsorted(time_s, edges + EDGE_S + 1e-9)
    at = {name: _edge_means(_unwrapped(name, channels[name]), low, high) for name in POSE if name in channels}
    middle = edges[:-1] + 0.5 * WINDOW_S
    ways = {}
    yaw = at.get("yaw_rad", np.zeros(edges.size))
    if "yaw_rad" in at:
        ways["yaw_rad"] = (middle, np.diff(yaw))
    if "x_m" in at and "y_m" in at:
        dx, dy = np.diff(at["x_m"]), np.diff(at["y_m"])
        cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
        ways["x_m"], ways["y_m"] = (middle, cos * dx + sin * dy), (middle, cos * dy - sin * dx)
    else:
        ways.update({name: (middle, np.diff(at[name])) for name in ("x_m", "y_m") if name in at})
    return ways


def _unwrapped(name: str, values: FloatArray) -> FloatArray:
    if name != "yaw_rad":
        return values
    unwrapped, finite = np.array(values), np.isfinite(values)
    unwrapped[finite] = np.unwrap(values[finite])
    return unwrapped


def _edge_means(values: FloatArray, low: Rows, high: Rows) -> FloatArray:
    finite = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(finite, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(finite)])
    there = count[high] - count[low]
    means = np.full(low.size, np.nan)
    np.divide(total[high] - total[low], there, out=means, where=there > 0)
    return means
