"""Bench logs whose changes of command are moved to where they acted: what is left is one common delay.

A link that delays every change differently cannot be simulated change by change from its mean and spread.
With the delays of a log known (`sysid.compare.link_delays`) the same log is written with each change moved
by how much later than the common delay it acted. Models with a fixed delay then predict it, and everything
that reads logs works on it as it is.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from mecanum_env.law.drive import longest_delay_s
from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.link_delays import LinkDelays
from sysid.logs import BenchCommand, Dataset, Run

JITTER: Final = "command_latency/jitter"
LOSS: Final = "command_loss"
_FIXED: Final = "command_latency"
_SPEED: Final = "speed_rpm"
_RESOLUTION_S: Final = 0.004
"""Resolution to which arrivals are moved [s], where the delay allows it: a tenth of a sample at 25 Hz."""
_MORE_S: Final = 0.1  # by which a study may find the common delay longer


def resolution_s(tick_s: float, delay_s: float) -> float:
    """Return the period [s] on which arrivals are placed: a whole fraction of the law's tick.

    It is fine, but a drive remembers only so many periods, which must span the common delay.
    """
    parts = max(1, round(tick_s / _RESOLUTION_S))
    while parts > 1 and longest_delay_s(tick_s / parts, tick_s) < delay_s + _MORE_S:
        parts -= 1
    return tick_s / parts


def aligned(dataset: Dataset, found: LinkDelays, period_s: float) -> Dataset:
    """Return bench logs with each change of command moved by its delay beyond the common one.

    Moved changes lie on multiples of `period_s` [s] and have a row of their own, without samples. Lost
    changes are left out. Samples count less where the speed follows from a delay that is not sure. A run that
    begins with a change begins earlier, at rest. Runs are no repeats any more.
    """
    runs = []
    for index, run in enumerate(dataset.runs):
        own = [i for i, change in enumerate(found.changes) if change.run == index]
        runs.append(_aligned(run, index, found, own, period_s))
    return replace(dataset, runs=tuple(runs))


def _aligned(run: Run, index: int, found: LinkDelays, own: Sequence[int], period_s: float) -> Run:
    renamed = replace(run, group=f"{run.group}, {run.file}")
    acting = [i for i in own if not found.lost[i]]
    if not own:
        return renamed
    moved = np.array([found.changes[i].given_s + found.delay_s[i] - found.mean_s for i in acting])
    lead = period_s * math.ceil(max(0.0, -float(moved.min(initial=0.0))) / period_s + 1.0)
    if found.changes[own[0]].given_s > 2.0 * lead:
        lead = 0.0
    # On the clock, each at least one period after the one before.
    slots = np.rint((moved + lead) / period_s).astype(int)
    slots = np.maximum(np.maximum.accumulate(slots - np.arange(slots.size)) + np.arange(slots.size), 1)
    arrivals = slots * period_s
    levels = np.array([found.changes[own[0]].before_rpm, *(found.changes[i].after_rpm for i in acting)])
    stamps = run.time_s + lead
    near = np.abs(stamps[np.clip(np.searchsorted(stamps, arrivals), 0, stamps.size - 1)] - arrivals) < 1e-9
    extra = arrivals[~near & (arrivals < stamps[-1])]
    extra = np.concatenate([[0.0], extra]) if lead > 0.0 else extra
    times = np.concatenate([stamps, extra])
    order = np.argsort(times, kind="stable")
    times = times[order]
    channels = {n: np.append(v, np.full(extra.size, np.nan))[order] for n, v in run.channels.items()}
    if "battery_v" in channels:
        channels["battery_v"] = _held(channels["battery_v"])
    sure = run.weights.get(_SPEED, np.ones(run.time_s.size)) / (1.0 + found.unsure[index])
    weights = {_SPEED: np.append(sure, np.ones(extra.size))[order]}
    command = BenchCommand(levels[np.searchsorted(arrivals, times + 1e-9, side="right")])
    return replace(renamed, time_s=times, command=command, channels=channels, weights=weights)


def _held(values: FloatArray) -> FloatArray:
    """Return values in which a missing one is the one before, or the first one."""
    finite = np.isfinite(values)
    if not finite.any():
        return values
    index = np.maximum.accumulate(np.where(finite, np.arange(values.size), -1))
    return values[np.where(index < 0, int(np.argmax(finite)), index)]


def without_delays(model: Model) -> Model:
    """Return the model without a delay of the command, and without losses."""
    effects = {name: values for name, values in model.effects.items() if name not in (_FIXED, JITTER, LOSS)}
    return replace(model, effects=effects)


def on_aligned(model: Model, delay_s: float, period_s: float) -> Model:
    """Return the model for logs that are `aligned`: with one delay [s], and a clock of `period_s` [s]."""
    effects: Mapping[str, Mapping[str, float]] = without_delays(model).effects
    if delay_s > 0.0:
        effects = {_FIXED: {"delay_s": delay_s}, **effects}
    return replace(model, wheel=replace(model.wheel, command_period_s=period_s), effects=effects)


def delay_of(model: Model) -> float:
    """Return the common delay of a model's commands [s], in either form."""
    effects = model.effects.get(JITTER) or model.effects.get(_FIXED) or {}
    return float(effects.get("delay_s", 0.0))


def with_jitter(model: Model, jitter_s: float, period_s: float) -> Model:
    """Return a model of aligned logs as that of the link: its delay jitters, its clock has `period_s` [s]."""
    effects = {JITTER: {"delay_s": delay_of(model), "jitter_s": jitter_s}, **without_delays(model).effects}
    return replace(model, wheel=replace(model.wheel, command_period_s=period_s), effects=effects)
