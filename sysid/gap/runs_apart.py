"""Repeats that a swing at the wheel's angle tells apart: each run is then studied by itself.

The wheel starts every run at another angle, so that a torque ripple or an uneven encoder has another phase
in each repeat. The mean of repeats loses most of it, and their scatter, which passes for noise, gains as
much. Where most of that scatter is one wave in the angle that the wheel has turned through, a study therefore
takes each run by itself. Its noise is that of the logs of the fit, or of neighbouring samples.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.compare.least_squares import FREQUENCIES
from sysid.logs import Dataset, Run

_SPEED: Final = "speed_rpm"
_MOST: Final = 0.6
"""Share of the scatter of repeats, as a variance, that is one wave where runs are studied by themselves:
clearly more than half. Assumed."""
_PERIODS: Final = 1.0
"""Least number of periods of the wave in a run: less of one is a drift. Assumed."""


def with_runs_apart(dataset: Dataset) -> tuple[Dataset, tuple[str, ...]]:
    """Return bench logs with each run by itself where a wave tells repeats apart, and what is said of it."""
    if dataset.level != "bench":
        return dataset, ()
    per_turn, share = likely_wave(dataset.runs)
    if share < _MOST:
        return dataset, ()
    alone = tuple(replace(run, group=run.file) for run in dataset.runs)
    periods = "period" if per_turn == 1 else "periods"
    note = (
        f"{share:.0%} of what repeats differ by is a wave with {per_turn} {periods} in each turn of the "
        "wheel, which begins every run at another angle: each run is compared by itself"
    )
    return replace(dataset, runs=alone), (note,)


def likely_wave(runs: Sequence[Run]) -> tuple[int, float]:
    """Return the periods per turn of the wave that explains most of the scatter of repeats, and which share.

    The wave has an amplitude that is constant, or goes with the speed, and a phase of its own in each run.
    The share is 0 without repeats.
    """
    groups: dict[str, list[FloatArray]] = {}
    times: dict[str, FloatArray] = {}
    for run in runs:
        if _SPEED in run.channels:
            groups.setdefault(run.group, []).append(run.channels[_SPEED])
            times.setdefault(run.group, run.time_s)
    whole, explained = 0.0, np.zeros((2, len(FREQUENCIES)))
    for group, speeds in groups.items():
        rows = min(speed.size for speed in speeds)
        stacked = np.stack([speed[:rows] for speed in speeds])
        seen = np.all(np.isfinite(stacked), axis=0)
        if len(speeds) < 2 or np.count_nonzero(seen) < 3:
            continue
        stacked, time_s = stacked[:, seen], times[group][:rows][seen]
        mean = stacked.mean(axis=0)
        apart = stacked - mean
        whole += float(np.sum(apart**2))
        angle = np.cumsum(mean * RAD_S_PER_RPM * np.gradient(time_s))
        turned = float(np.sum(np.abs(np.diff(angle)))) / (2.0 * np.pi)
        for column, per_turn in enumerate(FREQUENCIES):
            if per_turn * turned < _PERIODS:
                continue
            for row, size in enumerate((np.ones(mean.size), mean)):
                waves = np.stack([size * np.cos(per_turn * angle), size * np.sin(per_turn * angle)])
                explained[row, column] += float(np.sum((np.linalg.qr(waves.T)[0].T @ apart.T) ** 2))
    if whole == 0.0:
        return FREQUENCIES[0], 0.0
    best = int(np.argmax(explained.max(axis=0)))
    return FREQUENCIES[best], float(explained[:, best].max()) / whole
