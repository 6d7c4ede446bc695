"""What a study compares: each channel of each distinct command sequence, as the mean of its repeats.

A pose drifts: one error of heading shows in everything after it. Poses are therefore compared by their
displacement in each window, in the frame of the robot at its start. Wheel speeds and velocities are compared
sample by sample. Values that a slow sensor repeats are left out, since they are no new measurements. A
channel that copies another (two wheels on one sensor) is kept, or else nothing would constrain that wheel of
the model. Where a robot is driving when its log begins, nobody knows what was commanded before, and the first
moments are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import InputError
from mecanum_env.kinematics import POSE
from mecanum_env.units import FloatArray
from sysid.compare.measured.start import Start, start_of
from sysid.logs import Dataset, Run, Split
from sysid.logs.runs import UNITS

WINDOW_S: Final = 0.4
"""Length of the windows in which displacements are compared [s]."""
UNKNOWN_S: Final = 0.3
"""Time [s] in which a robot that is driving when its log begins may still show what was commanded before: it
is taken to have been steady, and may have been accelerating. Assumed: three time constants of a drive of
0.1 s."""
EDGE_S: Final = 0.05
"""The pose at a window's edge is the mean of the samples within this time [s]."""
MOST_SAMPLES: Final = 600
"""Largest number of values in a block; more samples are averaged in pairs, triples ..."""

Rows = npt.NDArray[np.intp]
"""Indices into the rows of a run."""
Channels = Mapping[str, FloatArray]
"""Column of a log -> values at the rows of a run, shape (n,)."""


@dataclass(frozen=True, eq=False)
class Situation:
    """Runs with the same commands at the same times: one simulation predicts them all."""

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
    """One channel of one situation, as the mean over its repeats; m values."""

    situation: int
    """Index of the situation."""
    channel: str
    time_s: FloatArray
    """Time of each value [s], shape (m,)."""
    value: FloatArray
    """Mean over the repeats, in the channel's unit, shape (m,)."""
    weight: FloatArray
    """Number of samples that each value is the mean of, shape (m,); outliers count less than 1."""
    deviations: FloatArray
    """Deviation of each repeat's samples from their mean, shape (r, n), NaN where there is no sample.

    Those of outliers are weighted down.
    """
    sample_times_s: FloatArray
    """Time of each sample [s], shape (n,)."""
    repeats: int
    """Number of runs that are averaged."""
    rows: Rows
    """Rows of the run that each value is the mean of, shape (m, g); for a pose the index of its window."""
    row_weights: FloatArray
    """Number of samples in each of these rows, (m, g); 0 where a value has fewer rows than another."""
    reference_repeats: float = 0.0
    """Number of runs of other logs whose mean is taken off, shared by the blocks it is taken off; 0 if
    nothing is."""

    @property
    def independent_repeats(self) -> float:
        """Number of repeats whose mean has the noise of the value, less that of what is taken off."""
        if self.reference_repeats == 0.0:
            return float(self.repeats)
        return 1.0 / (1.0 / self.repeats + 1.0 / self.reference_repeats)

    @property
    def repeat_squares(self) -> float:
        """Sum of the squared deviations of the repeats from their mean."""
        return float(np.nansum(self.deviations**2))

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom of `repeat_squares`."""
        return int(np.isfinite(self.deviations).sum()) - self.sample_times_s.size

    def of(self, compared: Channels) -> FloatArray:
        """Return what corresponds to `value` in predicted channels `as_compared`, shape (m,)."""
        values = compared[self.channel]
        if self.channel in POSE:
            return values[self.rows[:, 0]]
        return _means(values[self.rows], self.row_weights)


@dataclass(frozen=True, eq=False)
class Observations:
    """All situations and blocks of a dataset."""

    situations: tuple[Situation, ...]
    blocks: tuple[Block, ...]

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels, in the order of a log's columns."""
        present = {block.channel for block in self.blocks}
        return tuple(name for name in UNITS if name in present)

    def predicted(self, channels: Sequence[Channels]) -> list[FloatArray]:
        """Return what corresponds to each block's `value` in the predicted channels of each situation."""
        compared = [
            as_compared(situation.runs[0].time_s, shown)
            for situation, shown in zip(self.situations, channels, strict=True)
        ]
        return [block.of(compared[block.situation]) for block in self.blocks]


def observe(dataset: Dataset) -> Observations:
    """Return what a study compares of a dataset of bench or robot logs.

    Raises:
        InputError: no run has a measured sample.
    """
    held = {(f.file, f.channel) for f in dataset.findings if f.kind == "held_samples"}
    grouped: dict[tuple[object, ...], list[Run]] = {}
    for run in dataset.runs:
        grouped.setdefault(_key(run), []).append(run)
    situations: list[Situation] = []
    blocks: list[Block] = []
    for index, runs in enumerate(grouped.values()):
        situations.append(Situation(tuple(runs), start_of(runs[0])))
        for name in UNITS:
            with_it = [run for run in runs if name in run.channels and name != "battery_v"]
            known_s = UNKNOWN_S if situations[index].start.moving else 0.0
            parts = [_masked(run, name, (run.file, name) in held, known_s) for run in with_it]
            block = _block(index, name, with_it, parts, known_s) if with_it else None
            if block is not None:
                blocks.append(block)
    if not blocks:
        raise InputError(f"{dataset.name}: no measured sample in any run")
    return Observations(tuple(situations), tuple(blocks))


def _key(run: Run) -> tuple[object, ...]:
    start = start_of(run)
    # Rounded, as noise of the first samples does not make another situation.
    rounded = (round(start.initial_rpm), start.moving, round(start.yaw_rad, 1))
    return (run.split, run.group, rounded, run.time_s.tobytes(), run.command.wheels_rpm.tobytes())


def _masked(run: Run, name: str, held: bool, known_s: float) -> FloatArray:
    """Return a channel, NaN before `known_s`, and for what a slow sensor repeats if that is `held`."""
    values = np.array(run.channels[name])
    if held:
        values[1:][values[1:] == run.channels[name][:-1]] = np.nan
    values[run.time_s < known_s] = np.nan
    return values


def _block(
    situation: int, name: str, runs: Sequence[Run], parts: Sequence[FloatArray], known_s: float
) -> Block | None:
    """Return a channel of a situation from its `parts`, (n,) each, or a pose in windows from `known_s` on."""
    if name in POSE:
        found = [displacements(run.time_s, run.channels)[name] for run in runs]
        time, values = found[0][0], np.array([displacement for _, displacement in found])
        values[:, time - 0.5 * WINDOW_S < known_s - 1e-9] = np.nan
    else:
        time, values = runs[0].time_s, np.array(parts)
    present = np.isfinite(values)
    count = present.sum(axis=0)
    used = np.flatnonzero(count)
    if used.size == 0:
        return None
    time, values, present, count = time[used], values[:, used], present[:, used], count[used]
    heavy = np.array([run.weights[name][used] if name in run.weights else np.ones(used.size) for run in runs])
    weight = np.where(present, heavy, 0.0) if name not in POSE else present.astype(float)
    # A single run is its own mean, without rounding.
    mean = (
        np.where(present, weight * values, 0.0).sum(axis=0) / weight.sum(axis=0)
        if len(runs) > 1
        else values[0]
    )
    deviations, samples = np.where(present, np.sqrt(weight) * (values - mean), np.nan), time
    # A window makes a value; so does a sample, or as many as leave at most MOST_SAMPLES values.
    size = 1 if name in POSE else -(-used.size // MOST_SAMPLES)
    counts = _together(weight.sum(axis=0), size)
    if name not in POSE:
        mean = (_together(mean, size) * counts).sum(axis=1) / counts.sum(axis=1)
        time = _together(time, size).sum(axis=1) / (counts > 0).sum(axis=1)
    return Block(
        situation=situation,
        channel=name,
        time_s=time,
        value=mean,
        weight=counts.sum(axis=1),
        deviations=deviations,
        sample_times_s=samples,
        repeats=len(runs),
        rows=_together(used, size),
        row_weights=counts / counts[:, :1],
    )


def _means(values: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the weighted mean of each row, (m, g) -> (m,)."""
    if values.shape[1] == 1:
        return values[:, 0]
    return np.asarray((values * weights).sum(axis=1) / weights.sum(axis=1))


def _together(values: npt.NDArray[Any], size: int) -> npt.NDArray[Any]:
    """Return values (n,) in rows of `size`, the last one filled up with zeros."""
    rows = -(-values.size // size)
    return np.pad(values, (0, rows * size - values.size)).reshape(rows, size)


def as_compared(time_s: FloatArray, channels: Channels) -> Channels:
    """Return the channels of a run with its stamps, a pose as its displacement in each window."""
    if not any(name in POSE for name in channels):
        return channels
    moved = displacements(time_s, channels)
    return {**channels, **{name: values for name, (_, values) in moved.items()}}


def displacements(time_s: FloatArray, channels: Channels) -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return per pose channel the middle of each window and the displacement in it, in the robot's frame."""
    edges = np.arange(0.0, float(time_s[-1]) + 1e-9, WINDOW_S)
    low = np.searchsorted(time_s, edges - EDGE_S - 1e-9)
    high = np.searchsorted(time_s, edges + EDGE_S + 1e-9)
    at = {name: _edge_means(_unwrapped(name, channels[name]), low, high) for name in POSE if name in channels}
    middle = edges[:-1] + 0.5 * WINDOW_S
    found = {}
    yaw = at.get("yaw_rad", np.zeros(edges.size))
    if "yaw_rad" in at:
        found["yaw_rad"] = (middle, np.diff(yaw))
    if "x_m" in at and "y_m" in at:
        dx, dy = np.diff(at["x_m"]), np.diff(at["y_m"])
        cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
        found["x_m"], found["y_m"] = (middle, cos * dx + sin * dy), (middle, cos * dy - sin * dx)
    else:
        found.update({name: (middle, np.diff(at[name])) for name in ("x_m", "y_m") if name in at})
    return found


def _unwrapped(name: str, values: FloatArray) -> FloatArray:
    if name != "yaw_rad":
        return values
    unwrapped, finite = np.array(values), np.isfinite(values)
    unwrapped[finite] = np.unwrap(values[finite])
    return unwrapped


def _edge_means(values: FloatArray, low: Rows, high: Rows) -> FloatArray:
    """Return the mean of the finite values in rows low[i] to high[i] - 1, NaN if there are none."""
    finite = np.isfinite(values)
    total = np.concatenate([[0.0], np.cumsum(np.where(finite, values, 0.0))])
    count = np.concatenate([[0], np.cumsum(finite)])
    size = count[high] - count[low]
    means = np.full(low.size, np.nan)
    np.divide(total[high] - total[low], size, out=means, where=size > 0)
    return means
