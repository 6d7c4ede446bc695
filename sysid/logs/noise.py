"""The noise floor: how much repeats of one command sequence differ, channel by channel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.model import Wheel
from mecanum_env.units import FloatArray
from sysid.logs.runs import Run

_BRIDGED_INTERVALS: Final = 3.0
"""Longest gap across which samples are interpolated, in median sample intervals."""


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one channel."""

    std: float
    """Standard deviation of one sample, in the channel's unit."""
    degrees_of_freedom: int
    """Number of samples compared, less one for each mean taken."""
    groups: int
    """Number of groups of repeats over which it was pooled."""

    @property
    def relative_error(self) -> float:
        """Standard error of `std` relative to `std`, for white normal noise."""
        return float(1.0 / np.sqrt(2.0 * self.degrees_of_freedom))


def noise_from_repeats(runs: Sequence[Run]) -> dict[str, ChannelNoise] | None:
    """Return the noise of each channel, pooled over the groups with repeats; None if no group has any.

    Repeats are compared at equal times after their first change of command, dated by the robot's clock
    (`Run.held_since`), since uneven stamps may show it up to a row late. Where stamps differ, values are
    interpolated: a mean of two neighbours with weights 1-f and f has (1-f)^2 + f^2 of the variance, which is
    accounted for, so that the estimate is unbiased for white noise. Real differences between runs (another
    phase of the command latch, a warmer motor) count as noise, since no model can know them.
    """
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.group, []).append(run)
    sums: dict[str, tuple[float, float, int, int]] = {}
    for members in groups.values():
        for name in members[0].channels:
            repeats = [run for run in members if name in run.channels]
            squares, weight, freedom = _spread(repeats, name) if len(repeats) >= 2 else (0.0, 0.0, 0)
            if freedom:
                s, w, f, count = sums.get(name, (0.0, 0.0, 0, 0))
                sums[name] = (s + squares, w + weight, f + freedom, count + 1)
    if not sums:
        return None
    return {n: ChannelNoise(float(np.sqrt(s / w)), freedom, g) for n, (s, w, freedom, g) in sums.items()}


def _spread(runs: Sequence[Run], name: str) -> tuple[float, float, int]:
    """Return the sum of squares about the repeats' mean, its expectation for unit variance, and its d.o.f."""
    times = runs[0].time_s - _first_change_s(runs[0])
    parts = [_interpolated(run, name, times) for run in runs]
    values, variances = (np.array([part[i] for part in parts]) for i in range(2))
    known = np.isfinite(values)
    count = known.sum(axis=0)
    use = count >= 2
    if not use.any():
        return 0.0, 0.0, 0
    values, variances, known, count = values[:, use], variances[:, use], known[:, use], count[use]
    mean = np.where(known, values, 0.0).sum(axis=0) / count
    squares = float(np.where(known, (values - mean) ** 2, 0.0).sum())
    weight = float(((1.0 - 1.0 / count) * np.where(known, variances, 0.0).sum(axis=0)).sum())
    return squares, weight, int((count - 1).sum())


def _first_change_s(run: Run) -> float:
    """Return the time at which the robot had the first new command [s]; 0 if there is none."""
    rows = run.command_rows()
    return float(run.held_since(Wheel.command_period_s)[rows[1]]) if rows.size > 1 else 0.0


def _interpolated(run: Run, name: str, times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a channel at times after the first change, and the variance of each value for unit noise.

    Both are NaN where the run has no sample nearby.
    """
    finite = run.finite(name)
    t, x = run.time_s[finite] - _first_change_s(run), run.channel(name)[finite]
    nothing = np.full(times.shape, np.nan)
    if t.size < 2:
        return nothing, nothing
    if name == "yaw_rad":
        x = np.unwrap(x)
    left = np.clip(np.searchsorted(t, times, side="right") - 1, 0, t.size - 2)
    interval = t[left + 1] - t[left]
    fraction = (times - t[left]) / interval
    # Stamps are rarely equal to the last digit: a difference of a thousandth of an interval counts as equal.
    median = float(np.median(np.diff(t)))
    equal = np.abs(fraction - np.rint(fraction)) * interval < 1e-3 * median
    fraction = np.where(equal, np.rint(fraction), fraction)
    exact = (fraction == 0.0) | (fraction == 1.0)
    near = interval <= _BRIDGED_INTERVALS * median
    usable = (fraction >= 0.0) & (fraction <= 1.0) & (near | exact)
    values = (1.0 - fraction) * x[left] + fraction * x[left + 1]
    variance = (1.0 - fraction) ** 2 + fraction**2
    return np.where(usable, values, np.nan), np.where(usable, variance, np.nan)
