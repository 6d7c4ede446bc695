"""When each change of a command acted, from bench logs: a link's delays as latent values.

The delays of single changes (`sysid.compare.links.single_changes`), what they have in common
(`sysid.compare.links.common_delay`) and the prediction of the logs are improved in turns. Delays that go with
the size or the direction of a change are no jitter; a spread counts only if it remains beside them. The same
holds for commands that were given between rows (`sysid.compare.links.between_rows`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.ndimage import convolve1d

from mecanum_env.model import Model
from mecanum_env.units import FloatArray
from mecanum_env.wheel_drive.drive import longest_delay_s
from sysid.compare.links import between_rows
from sysid.compare.links.changes import GRID_S, SPEED, STEP_S, Change, changes_of
from sysid.compare.links.common_delay import EVIDENCE, CommonDelay, evidence, without_trend
from sysid.compare.links.in_model import delay_of, on_time
from sysid.compare.links.single_changes import SeenChanges
from sysid.logs import Run
from sysid.logs.noise import noise_from_repeats

_ROUNDS: Final = 3
_LEAST_SPREAD: Final = 0.25
"""Least spread in sampling intervals: stamps and latches alone make about that. Assumed."""
_RESOLUTION_S: Final = STEP_S
"""Resolution to which arrivals are placed [s], where the delay allows it: that of the delays."""
_MORE_S: Final = 0.1  # by which the common delay may be found longer
_ROUNDED: Final = np.array([0.25, 0.5, 0.25])
"""Weights over steps of `GRID_S` by which a time is not known any better."""
_LOST: Final = 8.0  # logarithm of a likelihood ratio from which a change counts as lost


@dataclass(frozen=True)
class LinkClock:
    """What is known of a link before the delays of single changes are."""

    tick_s: float
    """Period of the law behind it [s]."""
    latch_s: float | None
    """How often the drive looks for commands [s]; None: it takes them at once."""
    delay_s: float = 0.0
    """Common delay [s]."""

    @classmethod
    def of(cls, model: Model) -> LinkClock:
        """Return what a `model` says of its link."""
        tick, period = model.wheel.law.sample_period_s, model.wheel.command_period_s
        return cls(tick, period if period > tick else None, delay_of(model))

    def period_s(self, delay_s: float = 0.0) -> float:
        """Return the period [s] on which arrivals are placed: a whole fraction of the law's tick.

        It is fine, but a drive remembers only so many periods, which must span the common delay, as known
        before or as found since: `delay_s` [s].
        """
        parts, longest = max(1, round(self.tick_s / _RESOLUTION_S)), max(self.delay_s, delay_s)
        while parts > 1 and longest_delay_s(self.tick_s / parts, self.tick_s) < longest + _MORE_S:
            parts -= 1
        return self.tick_s / parts


@dataclass(frozen=True, eq=False)
class LinkDelays:
    """The delays of all changes of the command in some runs; arrays have shape (n,)."""

    changes: tuple[Change, ...]
    delay_s: FloatArray
    """Of each change [s]."""
    lost: npt.NDArray[np.bool_]
    """Which changes never acted before the next one."""
    unsure: tuple[FloatArray, ...]
    """For each run and row the variance of the speed that unsure delays cause, in variances of the noise."""
    mean_s: float
    """Common delay [s]."""
    spread_s: float
    """Standard deviation of the delays [s]."""
    evidence: float
    """Twice the logarithm of the likelihood with the spread over that without, less the price of a parameter;
    of commands that were given between rows, that of such over commands as stamped. It is the smaller one of
    delays as they are and beside what goes with size and direction."""
    likelihood: FloatArray
    """Logarithm of the likelihood of each change (rows) at each delay of `GRID_S`."""
    lost_likelihood: FloatArray
    """Logarithm of the likelihood of each change never acting."""
    untrended: FloatArray
    """As `likelihood`, with the delays' dependence on size and direction of the changes taken off."""

    @property
    def differ(self) -> bool:
        """Whether changes acted at times of their own, by more than these are uncertain."""
        return self.evidence > EVIDENCE

    @property
    def loss(self) -> float:
        """Share of the changes that never acted."""
        return float(np.mean(self.lost)) if self.lost.size else 0.0


def link_delays(model: Model, runs: Sequence[Run], clock: LinkClock) -> LinkDelays:
    """Estimate the delay of each change of the command in bench `runs`.

    The `model` predicts them, without the link that it has itself.
    """
    changes = changes_of(runs, clock.latch_s)
    seen = SeenChanges(_within_ticks(model, clock), runs, changes)
    delays, lost = np.zeros(len(changes)), np.zeros(len(changes), bool)
    found = seen.likelihoods(delays, lost)
    # All changes are late by the common delay first: their own would follow what others leave.
    delays = np.full(len(changes), GRID_S[int(np.argmax(found.at_delay.sum(axis=0)))])
    for _ in range(_ROUNDS - 1):
        found = seen.likelihoods(delays, lost)
        delays, _ = CommonDelay.of(found.at_delay).posterior_s(found.at_delay)
        lost = found.lost > np.max(found.at_delay, axis=1) + _LOST
    kept = found.at_delay[~lost]
    common = CommonDelay.of(kept)
    delays, _ = common.posterior_s(found.at_delay)
    untrended = without_trend(kept, [change for change, gone in zip(changes, lost, strict=True) if not gone])
    whole = found.at_delay.copy()
    whole[~lost] = untrended
    proof = min(evidence(kept), evidence(untrended))
    interval = float(np.median([run.median_interval_s for run in runs]))
    if min(common.spread_s, CommonDelay.of(untrended).spread_s) < _LEAST_SPREAD * interval:
        proof = min(proof, 0.0)
    return LinkDelays(
        changes=changes,
        delay_s=delays,
        lost=lost,
        unsure=seen.unsure(common.weights(found.at_delay), found.noise_rpm),
        mean_s=common.mean_s,
        spread_s=common.spread_s,
        evidence=proof,
        likelihood=found.at_delay,
        lost_likelihood=found.lost,
        untrended=whole,
    )


def delays_between_rows(
    model: Model, runs: Sequence[Run], clock: LinkClock, late_s: float | None = None
) -> LinkDelays:
    """Estimate when each change of the command in bench `runs` acted, if given since the row before.

    The `model` predicts them, without the link that it has itself. All act `late_s` [s] after they were given
    or, if that is None, by the likeliest time.
    """
    changes = changes_of(runs, clock.latch_s, between_rows=True)
    seen = SeenChanges(_within_ticks(model, clock), runs, changes)
    none_lost = np.zeros(len(changes), bool)
    same = between_rows.repeated(runs, changes)
    given = np.array([change.given_s for change in changes])
    delays = np.array([0.5 * change.within_s for change in changes]) + (late_s or 0.0)
    for _ in range(_ROUNDS):
        found = seen.likelihoods(delays, none_lost)
        late = late_s or 0.0
        if late_s is None and changes:
            total = between_rows.blurred(found.at_delay, changes).sum(axis=0)
            late = float(GRID_S[int(np.argmax(total))])
        together = found.at_delay.copy()
        for rows in same:
            together[rows] = found.at_delay[rows].sum(axis=0)
        weights = between_rows.weights(late, together, changes)
        delays = weights @ GRID_S
        for rows in same:
            delays[rows] = np.median(given[rows] + delays[rows]) - given[rows]
    repeats = (noise_from_repeats(runs) or {}).get(SPEED)
    noise_rpm = min(found.noise_rpm, repeats.std) if repeats and repeats.std > 0.0 else found.noise_rpm
    rounded = convolve1d(weights, _ROUNDED, axis=1, mode="nearest")
    # Repeats have the same times, and their mean errs by as much as each.
    alike = np.ones(len(runs))
    for rows in same:
        for i in rows:
            alike[changes[i].run] = max(alike[changes[i].run], len(rows))
    untrended = without_trend(found.at_delay, changes)
    both = (between_rows.evidence(table, changes) for table in (found.at_delay, untrended))
    return LinkDelays(
        changes=changes,
        delay_s=delays,
        lost=none_lost,
        unsure=tuple(count * one for count, one in zip(alike, seen.unsure(rounded, noise_rpm), strict=True)),
        mean_s=late,
        spread_s=0.0,
        evidence=min(both),
        likelihood=found.at_delay,
        lost_likelihood=found.lost,
        untrended=untrended,
    )


def _within_ticks(model: Model, clock: LinkClock) -> Model:
    """Return the model without delay as `SeenChanges` takes it, whose commands are means over ticks."""
    # Such means are no whole numbers.
    exact = replace(model, wheel=replace(model.wheel, command_quantum_rpm=0.0))
    return on_time(exact, clock.tick_s)
