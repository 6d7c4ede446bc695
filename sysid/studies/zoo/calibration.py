"""What the thresholds of a verdict would have to be on the quiet cases of a run, and what that would cost.

Two thresholds can be read off saved outcomes, because all studies state the numbers that are compared with
them: the mean squared error that is too large to be the model's own, and the probability below which a
difference is no chance. Both are also found with each family of drives left out in turn, and then tried on
it: how they do on a drive that no calibration has seen.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from mecanum_env.statistics import wilson_interval
from sysid.gap.search.thresholds import THRESHOLDS
from sysid.studies.zoo.outcome import Outcome
from sysid.studies.zoo.tables import Share, Table, is_found, is_visible, of_kind, share

QUIET_SHARE: Final = 0.95
"""Share of laws whose error in quiet logs should count as their own."""
MOST_FALSE_ALARMS: Final = 0.05
"""What the upper end of the 95 % Wilson interval of the share of false alarms should be at most."""
_CONFIDENCE: Final = 0.95
"""Probability that an interval holds the quantile."""
_LEAST_P: Final = 1e-6
"""No smaller threshold is proposed: so far out, no formula for the chance is to be believed."""


@dataclass(frozen=True)
class Quantile:
    """A quantile of some values with the 95 % interval that the order of the values gives."""

    value: float
    """NaN without values."""
    low: float
    """-inf, where too few values lie below."""
    high: float
    """inf, where too few values lie above."""
    count: int


@dataclass(frozen=True)
class Chance:
    """The largest threshold of the p-value that keeps false alarms rare enough."""

    value: float | None
    """None: no threshold does."""
    alarms: Share
    """False alarms with it; without one, those of the present threshold."""
    kept: Share
    """Clear and gross cases found today that are still found with it."""
    why: str
    """Why there is none, or that it is the present one; empty otherwise."""


@dataclass(frozen=True)
class LeftOut:
    """One family of drives, and how thresholds do on it that were calibrated on all others."""

    family: str
    above_noise: float
    """Calibrated on the others."""
    above: Share
    """Quiet cases of the family with a larger error than that."""
    p_value: float | None
    """Calibrated on the others; None: no threshold does."""
    alarms: Share
    """False alarms of the family with it; without one, with the present one."""


@dataclass(frozen=True)
class Calibration:
    """What the cases of a run say about the thresholds."""

    above_noise: Quantile
    p_value: Chance
    families: tuple[LeftOut, ...]


def calibrate(outcomes: Sequence[Outcome]) -> Calibration:
    """Return what outcomes say about the thresholds, over all families and with each left out in turn."""
    families = sorted({outcome.case.family for outcome in outcomes})
    left_out = []
    for family in families:
        others = [o for o in outcomes if o.case.family != family]
        own = [o for o in outcomes if o.case.family == family]
        limit, chance = above_noise(others).value, choose_p_value(others)
        threshold = THRESHOLDS.false_alarm if chance.value is None else chance.value
        left_out.append(
            LeftOut(
                family=family,
                above_noise=limit,
                above=share(ratio > limit for ratio in noise_ratios(own)),
                p_value=chance.value,
                alarms=share(is_alarm_at(threshold)(o) for o in of_kind(own, "quiet")),
            )
        )
    return Calibration(above_noise(outcomes), choose_p_value(outcomes), tuple(left_out))


def noise_ratios(outcomes: Sequence[Outcome]) -> list[float]:
    """Return the mean squared error in noise variances of each quiet case whose logs have repeats."""
    return [o.noise_ratio for o in of_kind(outcomes, "quiet") if math.isfinite(o.noise_ratio)]


def above_noise(outcomes: Sequence[Outcome]) -> Quantile:
    """Return the mean squared error, in noise variances, that laws leave in 95 % of quiet studies."""
    return quantile(noise_ratios(outcomes), QUIET_SHARE)


def quantile(values: Sequence[float], at: float) -> Quantile:
    """Return the quantile of `values` `at` a share, with a 95 % interval.

    The interval is exact for any distribution: the number of values below a quantile is binomial. See W. J.
    Conover, "Practical Nonparametric Statistics", chapter 3.2.
    """
    count = len(values)
    if not count:
        return Quantile(math.nan, math.nan, math.nan, 0)
    # Imported here, since it takes half a second.
    from scipy.stats import binom

    order = np.sort(np.asarray(values, float))
    tail = 0.5 * (1.0 - _CONFIDENCE)
    below, above = int(binom.ppf(tail, count, at)), int(binom.ppf(1.0 - tail, count, at)) + 1
    return Quantile(
        value=float(np.quantile(order, at)),
        low=float(order[below - 1]) if below >= 1 else -math.inf,
        high=float(order[above - 1]) if above <= count else math.inf,
        count=count,
    )


def is_alarm_at(threshold: float) -> Callable[[Outcome], bool]:
    """Return what tells whether a quiet outcome would be an alarm with a `threshold` below the present one.

    A verdict that was reached with a p-value above the present threshold does not depend on it.
    """

    def is_alarm(outcome: Outcome) -> bool:
        decided = outcome.p_value <= threshold or outcome.p_value > THRESHOLDS.false_alarm
        return outcome.verdict not in ("no_gap", "error") and decided

    return is_alarm


def choose_p_value(outcomes: Sequence[Outcome]) -> Chance:
    """Return the largest p-value, at most the present threshold, that makes false alarms rare enough.

    A larger one cannot be judged: the studies stopped where the present one ended them.
    """
    quiet = of_kind(outcomes, "quiet")
    present = share(map(is_alarm_at(THRESHOLDS.false_alarm), quiet))
    found = [o for o in outcomes if o.claims and is_visible(o) and is_found(o)]
    everything = share(True for _ in found)
    if not wilson_interval(0, len(quiet))[1] <= MOST_FALSE_ALARMS:
        return Chance(None, present, everything, f"{len(quiet)} quiet cases are too few to show it")
    alarmed = {o.p_value for o in quiet if is_alarm_at(THRESHOLDS.false_alarm)(o)}
    steps = sorted((p for p in alarmed if p <= THRESHOLDS.false_alarm), reverse=True)
    # Just below each p-value that is an alarm now; the last of these silences all that any threshold can.
    for threshold in (THRESHOLDS.false_alarm, *(math.nextafter(step, 0.0) for step in steps)):
        alarms = share(map(is_alarm_at(threshold), quiet))
        if alarms.high > MOST_FALSE_ALARMS:
            continue
        if threshold < _LEAST_P:
            why = f"p = {threshold:.1g} would do, which is smaller than any chance that can be computed"
            return Chance(None, present, everything, why)
        why = "the present one does" if threshold == THRESHOLDS.false_alarm else ""
        return Chance(threshold, alarms, share(o.p_value <= threshold for o in found), why)
    return Chance(None, present, everything, "the alarms that remain do not depend on the p-value")


def left_out_table(calibration: Calibration) -> Table:
    """Return how thresholds that were calibrated without a family do on its drives."""
    rows = tuple(
        (
            left.family,
            f"{left.above_noise:.3g}",
            left.above.text(),
            "none does" if left.p_value is None else f"{left.p_value:.2g}",
            left.alarms.text(),
        )
        for left in calibration.families
    )
    note = (
        "Thresholds calibrated on all other families, and what they do on quiet logs of the one that the "
        "calibration did not see. Where no p-value makes false alarms rare enough, the present one is tried."
    )
    head = ("family", "mean squared error allowed", "quiet cases above it", "p-value", "false alarms")
    return Table("Families left out in turn", note, head, rows)
