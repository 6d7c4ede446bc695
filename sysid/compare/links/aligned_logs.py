"""Bench logs whose changes of command are moved to where they acted: what is left is one common delay.

A link that delays every change differently cannot be simulated change by change from its mean and spread.
With the delays of a log known (`sysid.compare.links.delays`) the same log is written with each change moved
by how much later than the common delay it acted. Models with a fixed delay then predict it, and everything
that reads logs works on it as it is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from sysid.compare.links.delays import LinkClock, LinkDelays, link_delays
from sysid.compare.links.in_model import JITTER, LOSS, delay_of, on_time, said, varied, varies
from sysid.logs import BenchCommand, Dataset, Run

_SPEED: Final = "speed_rpm"
_FARTHEST: Final = 4.0
"""Standard deviations of a stated jitter from the common delay within which a change acts: of normal delays
one in 16,000 lies beyond."""


@dataclass(frozen=True, eq=False)
class AlignedLogs:
    """Bench logs with each change of command where it acted, less the common delay, and their model."""

    dataset: Dataset
    """The logs with their changes moved; see `AlignedLogs.of`."""
    delays: LinkDelays
    given: Model
    """The model of the logs as they are."""
    clock: LinkClock
    period_s: float
    """Period of the clock on which the moved changes lie [s]."""

    @classmethod
    def of(cls, dataset: Dataset, given: Model, clock: LinkClock, delays: LinkDelays) -> AlignedLogs:
        """Return bench logs with each change of command moved by its delay beyond the common one.

        Moved changes lie on a fine clock and have a row of their own, without samples. Lost changes are left
        out. Samples count less where the speed follows from a delay that is not sure. A run that begins with
        a change begins earlier, at rest. Runs are no repeats any more.

        Args:
            dataset: the logs.
            given: the model that they are compared with.
            clock: what is known of their link.
            delays: of their changes, as `link_delays` finds them on that clock.
        """
        period_s = clock.period_s(delays.mean_s)
        return cls(_moved(dataset, delays, period_s), delays, given, clock, period_s)

    @classmethod
    def stated(cls, dataset: Dataset, given: Model) -> AlignedLogs | None:
        """Return bench logs aligned, if the `given` model says that their link jitters or loses commands.

        A jitter of the stated size makes no change far later than the others. What does, such as a gap in a
        gear at reversals, is left to be found.
        """
        if dataset.level != "bench" or not varies(given):
            return None
        clock = LinkClock.of(given)
        delays = link_delays(given, dataset.runs, clock)
        if LOSS not in given.effects:
            most_s = _FARTHEST * given.effects[JITTER]["jitter_s"]
            near_s = np.clip(delays.delay_s, delays.mean_s - most_s, delays.mean_s + most_s)
            delays = replace(delays, delay_s=near_s)
        return cls.of(dataset, given, clock, delays)

    @property
    def model(self) -> Model:
        """The given model for these logs: with its common delay.

        Where the logs have another one, that is left to be found.
        """
        return on_time(self.given, self.period_s, delay_of(self.given))

    @property
    def note(self) -> str:
        """What the delays are, in a sentence without its full stop."""
        found = self.delays
        lost = f", and {found.loss:.0%} of the changes never act" if found.lost.any() else ""
        return (
            f"each change of the command acts at a time of its own: {found.mean_s * 1e3:.0f} ms late with a "
            f"spread of {found.spread_s * 1e3:.0f} ms over {len(found.changes)} changes{lost}"
        )

    @property
    def said(self) -> str:
        """What the given model says of the link, in a few words."""
        return said(self.given)

    def beside(self, other: Dataset, delays: LinkDelays | None = None) -> Dataset:
        """Return `other` logs through the same link, such as those of the fit, aligned on the same clock.

        None as their `delays`: they are estimated. Logs of a robot stay as they are.
        """
        if other.level != "bench":
            return other
        if delays is None:
            delays = link_delays(self.given, other.runs, self.clock)
        return _moved(other, delays, self.period_s)

    def as_stated(self, model: Model) -> Model:
        """Return a model of these logs as one of the logs as they were, with the given model's link."""
        effects = self.given.effects
        return self.through_link(
            model,
            jitter_s=effects.get(JITTER, {}).get("jitter_s"),
            share=effects.get(LOSS, {}).get("share"),
        )

    def through_link(
        self,
        model: Model,
        *,
        jitter_s: float | None = None,
        delay_s: float | None = None,
        share: float | None = None,
    ) -> Model:
        """Return a model of these logs as one of the logs as they were, through a link as it is described.

        Its delay jitters by `jitter_s` [s] around `delay_s` [s] (None: around the model's own), and it loses
        this `share` of the commands. What is None stays as the model has it.
        """
        period_s = self.given.wheel.command_period_s
        return varied(model, period_s, jitter_s=jitter_s, delay_s=delay_s, share=share)


def _moved(dataset: Dataset, found: LinkDelays, period_s: float) -> Dataset:
    runs = []
    for index, run in enumerate(dataset.runs):
        own = [i for i, change in enumerate(found.changes) if change.run == index]
        runs.append(_moved_run(run, index, found, own, period_s))
    return replace(dataset, runs=tuple(runs))


def _moved_run(run: Run, index: int, found: LinkDelays, own: Sequence[int], period_s: float) -> Run:
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
