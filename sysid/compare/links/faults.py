"""What a link does to its commands, from the delays of single changes: delay, jitter, or loss.

`sysid.compare.links.delay_table` says how likely the delays are under a spread and a loss. The period after
which a lost command is repeated is estimated, too, since a log may not show how often a drive is sent its
command. A spread, and a loss, is claimed if it raises the likelihood of all changes far more than its price,
beside the spread and the loss of the logs of the model's fit, where these are known. How much of a loss those
may have had, too, is told by the `surplus`.

Under a model that errs, delays spread more than the link makes them, and a spread may explain lost commands
better than a loss without one does. So a loss is also tried with any spread that leaves the repetitions
apart, against that spread alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from scipy.stats import chi2, norm

from mecanum_env.units import FloatArray
from sysid.compare.links.changes import GRID_S, LONGEST_S, STEP_S, Change
from sysid.compare.links.common_delay import EVIDENCE, FEWEST
from sysid.compare.links.delay_table import DelayTable
from sysid.compare.links.delays import LinkDelays
from sysid.compare.measured import COMMAND_STEP_RPM

Kind = Literal["jitter", "loss"]
_SPREADS_S: Final[tuple[float, ...]] = (0.0, *np.geomspace(0.001, 0.25, 36).tolist())
_SHARES: Final[tuple[float, ...]] = (0.0, *np.geomspace(0.0005, 0.5, 32).tolist())
_PERIODS_S: Final[tuple[float, ...]] = tuple(np.geomspace(0.01, 0.2, 22).tolist())
_FINER: Final[tuple[float, ...]] = tuple(np.linspace(0.88, 1.12, 13).tolist())
"""Multiples of the best period at which it is looked for again: several lost in a row show it to 2 %."""
_APART: Final = 0.25
"""Largest spread, in periods, with which delays by a whole number of periods stand apart: their clusters do
not overlap within two standard deviations."""
_RESAMPLES: Final = 500
_ROUNDING: Final = 1.0 / math.sqrt(12.0)
"""Spread of what is rounded up to the next sample, in sampling intervals."""


@dataclass(frozen=True)
class LinkState:
    """Spread and loss of a link."""

    spread_s: float = 0.0
    """Standard deviation of the delays [s], no less than what stamps are rounded by."""
    share: float = 0.0
    """Share of the commands that are lost."""
    least_spread_s: float = 0.0
    """Standard deviation of the delays [s] that the logs themselves show."""
    losses: tuple[tuple[float, float], ...] = ()
    """Shares that may be lost, each with the logarithm of its likelihood by the logs of the fit, 0 at most;
    empty without such logs."""


@dataclass(frozen=True)
class LinkFault:
    """A fault that the delays of the changes show."""

    kind: Kind
    evidence: float
    """Twice the logarithm of the likelihood ratio, less the price of a parameter."""
    delay_s: tuple[float, float, float]
    """Common delay [s] and the ends of its interval."""
    size: tuple[float, float, float]
    """Spread [s] of a jitter, share of a loss, and the ends of the interval."""
    period_s: float
    """Time after which a lost command is repeated [s]."""
    frequency: float
    """Share of resamples of the changes that show it, too."""
    spread_s: float = 0.0
    """Standard deviation of the delays beside a loss [s]."""
    surplus: float = math.inf
    """Twice the logarithm of the likelihood ratio of this loss to one that the logs of the fit share."""
    rival: Kind | None = None
    """The other fault, where the delays do not tell the two apart: commands that are sent as often as a log
    has rows come late by as many rows as are lost."""

    def delays(self, found: LinkDelays) -> LinkDelays:
        """Return the delays that were `found` as the fault makes them most likely, around its delay.

        A jitter gives each change the mean of its posterior; a loss so many periods as are most likely.
        """
        table, mean_s = DelayTable.of(found, found.likelihood, self.period_s), self.delay_s[0]
        if self.kind == "jitter":
            delay_s = table.posterior_s(self.size[0], mean_s)
            return replace(found, delay_s=delay_s, mean_s=mean_s, spread_s=self.size[0])
        share = self.size[0]
        at = table.smoothed(self.spread_s)
        late_s = np.arange(mean_s, LONGEST_S, self.period_s)
        cells = np.rint(late_s / STEP_S).astype(int)
        weight = (1.0 - share) * share ** np.arange(late_s.size) * at[:, cells]
        weight[np.arange(late_s.size) >= table.repeats[:, None]] = 0.0
        gone = share**table.repeats * table.never > weight.max(axis=1)
        delay_s = late_s[np.argmax(weight, axis=1)]
        return replace(found, delay_s=delay_s, lost=gone, mean_s=mean_s, spread_s=self.spread_s)


def known_state(before: LinkDelays | None, interval_s: float) -> LinkState:
    """Return the spread and the loss that a link has anyway.

    That is what the delays of the logs `before` make most likely, None if there are no such logs. Samples
    every `interval_s` [s] alone give a spread to the stamps of the changes, too.
    """
    least_s = _ROUNDING * interval_s
    if before is None or len(before.likelihood) < FEWEST:
        return LinkState(least_s, least_spread_s=least_s)
    table = DelayTable.of(before, before.likelihood, _PERIODS_S[0])
    spread = max(_SPREADS_S, key=lambda one: float(table.total(one, 0.0).max()))
    period = _likeliest_period([table], LinkState(spread))
    shares = replace(table, period_s=period)
    totals = {share: float(shares.total(spread, share).max()) for share in _SHARES}
    share, most = max(totals.items(), key=lambda one: one[1])
    losses = tuple((one, total - most) for one, total in totals.items())
    return LinkState(max(spread, least_s), share, spread, losses)


def link_fault(
    found: LinkDelays, known: LinkState, level: float, rng: np.random.Generator
) -> LinkFault | None:
    """Return the fault that the delays show beyond those that are `known`, None if there is none.

    Args:
        found: delays of the changes under the model.
        known: spread and loss that the link has anyway: of the logs of the fit, or of the stamps alone.
        level: probability that an interval holds the truth.
        rng: of the resamples.
    """
    if len(found.likelihood) < FEWEST:
        return None
    tables = [DelayTable.of(found, one, _PERIODS_S[0]) for one in (found.likelihood, found.untrended)]
    period = _likeliest_period(tables, known)
    tables = [replace(table, period_s=period) for table in tables]
    loss, jitter = (min(each(table, known) for table in tables) for each in (_of_loss, _of_jitter))
    kind: Kind = "loss" if loss >= jitter else "jitter"
    proof = max(loss, jitter)
    if proof < EVIDENCE:
        return None
    rival: Kind | None = "jitter" if kind == "loss" else "loss"
    if min(loss, jitter) < EVIDENCE or abs(loss - jitter) >= EVIDENCE:
        rival = None
    if kind == "jitter" and (beside := _loss_beside_spread(tables, known)) is not None:
        kind, rival, (period, spread_s) = "loss", None, beside
        known = replace(known, spread_s=max(known.spread_s, spread_s))
    table = replace(tables[0], period_s=period)
    if kind == "loss" and _only_small_starts(table, found.changes, known):
        return None
    if kind == "loss":
        spread_s = max(_spreads(known), key=lambda one: _most(table, [one], _shares(known)))
        places = [(spread_s, share) for share in _shares(known)]
    else:
        spread_s = known.spread_s
        places = [(spread, known.share) for spread in _larger(known.spread_s)]
    totals = np.array([table.total(*place).max() for place in places])
    sizes = np.array([place[0] if kind == "jitter" else place[1] for place in places])
    size = _interval(sizes, totals, level)
    if size[1] <= sizes[0]:
        return None
    best = places[int(np.argmax(totals))]
    ours, theirs = (table.each(*place)[:, _best(table, place)] for place in (best, places[0]))
    picks = rng.integers(0, ours.size, (_RESAMPLES, ours.size))
    frequency = float(np.mean(2.0 * (ours - theirs)[picks].sum(axis=1) > math.log(ours.size)))
    delay = _interval(GRID_S, table.total(*best), level)
    if kind == "jitter":
        own = table.posterior_s(best[0], delay[0])
        # The stamps may shift all delays alike by as much as they are rounded.
        half = float(norm.ppf(0.5 * (1.0 + level))) * math.hypot(
            size[0] / math.sqrt(own.size), known.spread_s
        )
        delay = float(own.mean()), max(0.0, float(own.mean()) - half), float(own.mean()) + half
    surplus = _surplus(table, known, spread_s) if kind == "loss" else math.inf
    return LinkFault(kind, proof, delay, size, period, frequency, spread_s, surplus, rival)


def _larger(spread_s: float) -> list[float]:
    return [spread_s, *(spread for spread in _SPREADS_S if spread > spread_s)]


def _spreads(known: LinkState) -> list[float]:
    """Return the spreads that the delays may have beside a loss: no more than is known of the link."""
    between = [one for one in _SPREADS_S if known.least_spread_s < one < known.spread_s]
    return [known.least_spread_s, *between, known.spread_s]


def _shares(known: LinkState) -> list[float]:
    return [known.share, *(share for share in _SHARES if share > known.share)]


def _most(table: DelayTable, spreads_s: Sequence[float], shares: Sequence[float]) -> float:
    """Return the largest logarithm of the likelihood of all changes with some spreads and shares."""
    return max(float(table.total(spread, share).max()) for spread in spreads_s for share in shares)


def _as_known(table: DelayTable, known: LinkState) -> float:
    return _most(table, _spreads(known), [known.share])


def _of_jitter(table: DelayTable, known: LinkState) -> float:
    """Return the evidence for a larger spread than the known one."""
    larger = _most(table, _larger(known.spread_s), [known.share])
    return 2.0 * (larger - _as_known(table, known)) - math.log(len(table.offset))


def _of_loss(table: DelayTable, known: LinkState) -> float:
    """Return the evidence for a larger loss than the known one."""
    known_share, *shares = _shares(known)
    # Every third of them is close enough to the best one.
    larger = _most(table, _spreads(known), [known_share, *shares[::3]])
    # The period of a loss is one more number that was estimated.
    return 2.0 * (larger - _as_known(table, known)) - 2.0 * math.log(len(table.offset))


def _loss_beside_spread(tables: Sequence[DelayTable], known: LinkState) -> tuple[float, float] | None:
    """Return the period of repetitions that stand apart and the spread around them [s], which explain most.

    None if these do not explain far more than whatever spread without a loss does. The spread is larger than
    that of the logs themselves.
    """
    shares = _SHARES[4::7]

    def worth(place: tuple[float, float]) -> float:
        moved = [replace(table, period_s=place[0]) for table in tables]
        return min(_most(one, [place[1]], shares) for one in moved)

    coarse = [
        (period_s, spread_s)
        for period_s in _PERIODS_S
        for spread_s in _SPREADS_S[::2]
        if known.least_spread_s < spread_s <= _APART * period_s
    ]
    if not coarse:
        return None
    period_s, spread_s = max(coarse, key=worth)
    period_s = max((multiple * period_s for multiple in _FINER), key=lambda one: worth((one, spread_s)))
    clusters = [replace(table, period_s=period_s) for table in tables]
    proof = min(_of_clusters(table, known, spread_s) for table in clusters)
    return (period_s, spread_s) if proof >= EVIDENCE else None


def _of_clusters(table: DelayTable, known: LinkState, spread_s: float) -> float:
    """Return the evidence for a loss beside a spread, against whatever spread without more than known."""
    known_share, *shares = _shares(known)
    lost = _most(table, [spread_s], [known_share, *shares[::3]])
    # Period and share are two more numbers.
    return 2.0 * (lost - _most(table, _larger(known.spread_s), [known_share]) - math.log(len(table.offset)))


def _surplus(table: DelayTable, known: LinkState, spread_s: float) -> float:
    """Return the `surplus` of a loss beside a spread: of two logs, either may have lost more by chance."""
    if not known.losses:
        return math.inf
    totals = [float(table.total(spread_s, share).max()) for share, _ in known.losses]
    common = max(total + fall for total, (_, fall) in zip(totals, known.losses, strict=True))
    return 2.0 * (max(totals) - common)


def _only_small_starts(table: DelayTable, changes: Sequence[Change], known: LinkState) -> bool:
    """Return whether only small commands to a wheel at rest are lost, as far as the likelihood tells.

    A wheel that sticks does not start for a small command, and a drive with a dead zone ignores it, now and
    then or every time. The size up to which they do so is one more number that was estimated.
    """
    shares = _shares(known)
    spread_s = max(_spreads(known), key=lambda one: _most(table, [one], shares))
    best = max(shares, key=lambda share: float(table.total(spread_s, share).max()))
    place = _best(table, (spread_s, best))
    each = np.array([table.each(spread_s, share)[:, place] for share in shares])
    gains = each - each[0]
    starts = [i for i, one in enumerate(changes) if abs(one.before_rpm) <= COMMAND_STEP_RPM]
    if not starts:
        return False
    size = np.array([abs(changes[i].after_rpm) for i in starts])
    order = np.argsort(size, kind="stable")
    # So many of the smallest may be lost; equal ones together.
    ends = np.append(np.flatnonzero(np.diff(size[order]) > 0.0) + 1, size.size)
    among = np.cumsum(gains[:, starts][:, order], axis=1)[:, ends - 1]
    return bool(2.0 * (among.max() - gains.sum(axis=1).max()) > math.log(len(changes)))


def _best(table: DelayTable, place: tuple[float, float]) -> int:
    return int(np.argmax(table.total(*place)))


def _likeliest_period(tables: Sequence[DelayTable], known: LinkState) -> float:
    """Return the time after which lost commands are repeated [s] that explains most beside what is known."""
    shares = _SHARES[4::7]

    def worth(period_s: float) -> float:
        moved = [replace(table, period_s=period_s) for table in tables]
        best = [max(float(one.total(known.spread_s, share).max()) for share in shares) for one in moved]
        return min(best)

    coarse = max(_PERIODS_S, key=worth)
    return max((coarse * multiple for multiple in _FINER), key=worth)


def _interval(values: FloatArray, totals: FloatArray, level: float) -> tuple[float, float, float]:
    """Return the most likely value and where the profile of the likelihood falls by what chance allows."""
    best = int(np.argmax(totals))
    inside = np.flatnonzero(2.0 * (totals[best] - totals) <= chi2.ppf(level, 1))
    low, high = max(0, int(inside[0]) - 1), min(values.size - 1, int(inside[-1]) + 1)
    return float(values[best]), float(values[low]), float(values[high])
