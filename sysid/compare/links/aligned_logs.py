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
from sysid.compare.links.changes import SPEED, means_over_ticks
from sysid.compare.links.delays import LinkClock, LinkDelays, delays_between_rows, link_delays
from sysid.compare.links.in_model import (
    JITTER,
    LOSS,
    delay_of,
    late_between_rows,
    on_time,
    said,
    varied,
    varies,
    with_stamps,
)
from sysid.logs import BenchCommand, Dataset, Run

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
    logs: Dataset
    """The logs as they are."""
    as_means: bool = False
    """Whether the rows have the means of the command over the law's ticks."""

    @classmethod
    def of(cls, dataset: Dataset, given: Model, clock: LinkClock, delays: LinkDelays) -> AlignedLogs:
        """Return bench logs with each change of command moved by its delay beyond the common one.

        Moved changes have a row of their own, without samples. They lie on a fine clock if the law takes the
        mean over each of its ticks, which it can where commands are late by a tick at least. Else the rows
        have these means, as they do for changes from between rows, whose times are found more finely. Lost
        changes are left out. Samples count less where the speed follows from a delay that is not sure. A run
        that begins with a change begins earlier, at rest. Runs whose changes acted at different times are no
        repeats any more.

        Args:
            dataset: the logs.
            given: the model that they are compared with.
            clock: what is known of their link.
            delays: of their changes, as `link_delays` finds them on that clock.
        """
        as_means = late_between_rows(given) is not None or delay_of(given) < clock.tick_s
        period_s = clock.tick_s if as_means else clock.period_s(delays.mean_s)
        moved = _moved(dataset, delays, period_s, as_means)
        return cls(moved, delays, given, clock, period_s, dataset, as_means)

    @classmethod
    def stated(cls, dataset: Dataset, given: Model, timed_by: Model | None = None) -> AlignedLogs | None:
        """Return bench logs aligned, if the `given` model says that their changes act at times of their own.

        It says so if their link jitters or loses commands, or if they show commands in the first row after
        these were given. A jitter of the stated size makes no change far later than the others. What does,
        such as a gap in a gear at reversals, is left to be found. `timed_by` is a model that predicts these
        logs better, and so tells better when each change acted; None: the given one.
        """
        between = late_between_rows(given) is not None
        if dataset.level != "bench" or not (varies(given) or between):
            return None
        clock = LinkClock.of(given)
        delays = _delays(timed_by or given, dataset.runs, clock)
        if between:
            return cls.of(dataset, given, clock, delays)
        if LOSS not in given.effects:
            most_s = _FARTHEST * given.effects[JITTER]["jitter_s"]
            near_s = np.clip(delays.delay_s, delays.mean_s - most_s, delays.mean_s + most_s)
            delays = replace(delays, delay_s=near_s)
        return cls.of(dataset, given, clock, delays)

    @property
    def between_rows(self) -> bool:
        """Whether the logs show each command in the first row after it was given."""
        return late_between_rows(self.given) is not None

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
        if self.between_rows:
            return (
                "the log shows each command in the first row after it was given: the time of each of the "
                f"{len(found.changes)} changes is estimated, between that row and the one before"
            )
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
            delays = _delays(self.given, other.runs, self.clock)
        return _moved(other, delays, self.period_s, self.as_means)

    def as_stated(self, model: Model) -> Model:
        """Return a model of these logs as one of the logs as they were, with the given model's link."""
        effects = self.given.effects
        described = self.through_link(
            model,
            jitter_s=effects.get(JITTER, {}).get("jitter_s"),
            share=effects.get(LOSS, {}).get("share"),
        )
        return with_stamps(described, late_between_rows(self.given))

    def as_fitted(self, model: Model) -> Model:
        """Return a model that was fitted to these logs as one of the logs as they were."""
        if not self.between_rows:
            return self.through_link(model, jitter_s=self.delays.spread_s)
        described = self.as_stated(model)
        found = delays_between_rows(described, self.logs.runs, LinkClock.of(described))
        return with_stamps(described, found.mean_s)

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


def _delays(given: Model, runs: Sequence[Run], clock: LinkClock) -> LinkDelays:
    """Return the delays of all changes in bench runs, of the kind that the `given` model says."""
    late_s = late_between_rows(given)
    if late_s is None:
        return link_delays(given, runs, clock)
    # Later commands would pass for others that were given later, if these logs could tell how late they are.
    found = delays_between_rows(given, runs, clock, late_s)
    return replace(found, mean_s=delay_of(given))


def _moved(dataset: Dataset, found: LinkDelays, period_s: float, as_means: bool) -> Dataset:
    runs: list[Run] = []
    for index, run in enumerate(dataset.runs):
        own = [i for i, change in enumerate(found.changes) if change.run == index]
        runs.append(_moved_run(run, index, found, own, period_s, as_means))
    arrivals: dict[str, set[tuple[int, ...]]] = {}
    for before, run in zip(dataset.runs, runs, strict=True):
        times = np.rint((run.command_changes()[0] - run.time_s[0]) / period_s).astype(int)
        arrivals.setdefault(before.group, set()).add(tuple(times.tolist()))
    apart = [len(arrivals[run.group]) > 1 for run in runs]
    named = (replace(r, group=f"{r.group}, {r.file}") if a else r for r, a in zip(runs, apart, strict=True))
    return replace(dataset, runs=tuple(named))


def _moved_run(
    run: Run, index: int, found: LinkDelays, own: Sequence[int], period_s: float, as_means: bool
) -> Run:
    acting = [i for i in own if not found.lost[i]]
    if not own:
        return run
    moved = np.array([found.changes[i].given_s + found.delay_s[i] - found.mean_s for i in acting])
    lead = period_s * math.ceil(max(0.0, -float(moved.min(initial=0.0))) / period_s + 1.0)
    if found.changes[own[0]].given_s > 2.0 * lead:
        lead = 0.0
    levels = np.array([found.changes[own[0]].before_rpm, *(found.changes[i].after_rpm for i in acting)])
    stamps = run.time_s + lead
    if as_means:
        at_s = np.maximum.accumulate(moved + lead)
        ticks, levels = means_over_ticks(at_s, levels, period_s, float(stamps[-1]))
        arrivals = ticks[1:]
    else:
        # On the clock, each at least one period after the one before.
        slots = np.rint((moved + lead) / period_s).astype(int)
        slots = np.maximum(np.maximum.accumulate(slots - np.arange(slots.size)) + np.arange(slots.size), 1)
        arrivals = slots * period_s
    near = np.abs(stamps[np.clip(np.searchsorted(stamps, arrivals), 0, stamps.size - 1)] - arrivals) < 1e-9
    extra = arrivals[~near & (arrivals < stamps[-1])]
    extra = np.concatenate([[0.0], extra]) if lead > 0.0 else extra
    times = np.concatenate([stamps, extra])
    order = np.argsort(times, kind="stable")
    times = times[order]
    channels = {n: np.append(v, np.full(extra.size, np.nan))[order] for n, v in run.channels.items()}
    if "battery_v" in channels:
        channels["battery_v"] = _held(channels["battery_v"])
    sure = run.weights.get(SPEED, np.ones(run.time_s.size)) / (1.0 + found.unsure[index])
    weights = {SPEED: np.append(sure, np.ones(extra.size))[order]}
    command = BenchCommand(levels[np.searchsorted(arrivals, times + 1e-9, side="right")])
    return replace(run, time_s=times, command=command, channels=channels, weights=weights, given=None)


def _held(values: FloatArray) -> FloatArray:
    """Return values in which a missing one is the one before, or the first one."""
    finite = np.isfinite(values)
    if not finite.any():
        return values
    index = np.maximum.accumulate(np.where(finite, np.arange(values.size), -1))
    return values[np.where(index < 0, int(np.argmax(finite)), index)]
