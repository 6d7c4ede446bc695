"""The checks of a certificate: each metric against its threshold, passed, missed or undecided."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

from mecanum_env.statistics import wilson_interval
from training.certify.plants import APART, HELD_OUT
from training.certify.results import Timing, TrackingResult, VariantResult, worst_of
from training.certify.thresholds import Thresholds
from training.certify.warning import WarningCurve
from training.evaluate import Mean, Share

MOST_EPISODES: Final = 100_000
"""Beyond this number of more episodes none is named: the metric is as good as the threshold."""
_GROWTH: Final = 1.05
"""Factor between two numbers of episodes that are tried."""


@dataclass(frozen=True)
class Check:
    """The comparison of one metric with its threshold."""

    name: str
    text: str
    """The metric with its interval."""
    value: float | None
    """The worse end of the interval; None: not defined, which does not pass."""
    sense: Literal["at least", "at most"]
    limit: float
    unit: str
    """Unit of value and limit; empty for shares."""
    passed: bool
    more_episodes: int | None = None
    """How many more episodes would decide it if the metric stays as found; None: it is decided, or no number
    of episodes that can be played would do."""
    undecided: bool = False
    """Whether the limit lies within the interval, so that neither holds."""

    @property
    def mark(self) -> str:
        """The verdict: "ok", "MISSED", or how many more episodes it needs."""
        if self.passed:
            return "ok"
        if not self.undecided:
            return "MISSED"
        if self.more_episodes is None:
            return f"undecided: more than {MOST_EPISODES} more episodes"
        return f"undecided: {self.more_episodes} more episodes"


def checks(
    plants: Sequence[VariantResult],
    warning: WarningCurve,
    track: TrackingResult,
    thresholds: Thresholds,
) -> tuple[Check, ...]:
    """Return all checks except that of the time per command, from the results on these plants and tasks.

    The first of the `plants` is the nominal one; those that are held out are judged apart, and the
    adversary is not.
    """
    t, nominal = thresholds, plants[0]
    worst = worst_of([plant for plant in plants if plant.group not in APART])
    held_out = [plant for plant in plants if plant.group == HELD_OUT]
    apart = []
    if held_out:
        hardest = worst_of(held_out)
        text = f"{share_text(hardest.success)} on {hardest.name}"
        apart = [_share_at_least("held-out success", text, hardest.success, t.held_out_success)]
    worst_text = f"{share_text(worst.success)} on {worst.name}"
    return (
        _share_at_least("nominal success", share_text(nominal.success), nominal.success, t.success),
        _share_at_least("worst-plant success", worst_text, worst.success, t.worst_success),
        *apart,
        _warning_at_most(warning, t.warning_s),
        _mean_at_most("tracking error", track.distance_error_m, t.tracking_m, "m"),
        _mean_at_most("settling", nominal.settling_s, t.settling_s, "s"),
        _mean_at_most("overshoot", nominal.overshoot, t.overshoot),
        _mean_at_most("commands that saturate a wheel", nominal.saturated_share, t.saturated_share),
    )


def timing_check(timing: Timing, thresholds: Thresholds) -> Check:
    """Return the check of the time per command."""
    text = f"p50 {milliseconds(timing.p50_s)}, p99 {milliseconds(timing.p99_s)}"
    ends = (timing.p99_s, timing.p99_s, timing.p99_s)
    return _at_most("time for a command, p99", text, ends, thresholds.command_s, "s")


def share_text(found: Share) -> str:
    """Return a share with its interval, such as "0.58 (0.51 .. 0.65)"."""
    return f"{found.value:.2f} ({found.low:.2f} .. {found.high:.2f})"


def warning_text(curve: WarningCurve) -> str:
    """Return the warning needed by a curve, with its interval."""
    longest = f"more than {curve.range_s[1]:g}"
    if curve.needed_s is None:
        best = max(range(len(curve.success)), key=lambda i: curve.success[i])
        return f"not reached; at best {curve.success[best]:.2f} at {curve.warning_s[best]:.2f} s"
    low, high = (longest if end is None else f"{end:.2f}" for end in (curve.low_s, curve.high_s))
    text = f"{curve.needed_s:.2f} s ({low} .. {high})"
    return text if curve.holds_to_s is None else f"{text}, up to {curve.holds_to_s:.2f} s"


def milliseconds(seconds: float) -> str:
    """Return a time in ms as text."""
    return f"{1e3 * seconds:.3g} ms"


def mean_text(found: Mean | None, unit: str = "") -> str:
    """Return a mean with its interval in a unit; "never" for None."""
    if found is None:
        return "never"
    return f"{found.value:.2f}{' ' * bool(unit)}{unit} ({found.low:.2f} .. {found.high:.2f})"


def decided_after(found: Share, limit: float) -> int | None:
    """Return how many more episodes decide on which side of a limit a share lies, if it stays as found.

    None if that takes more than `MOST_EPISODES`.
    """
    trials = found.trials
    while trials - found.trials <= MOST_EPISODES:
        trials = math.ceil(_GROWTH * trials)
        low, high = wilson_interval(round(found.value * trials), trials)
        if low >= limit or high < limit:
            return trials - found.trials
    return None


def _share_at_least(name: str, text: str, found: Share, limit: float) -> Check:
    undecided = found.low < limit <= found.high
    more = decided_after(found, limit) if undecided else None
    return Check(name, text, found.low, "at least", limit, "", found.low >= limit, more, undecided)


def _at_most(
    name: str,
    text: str,
    ends: tuple[float, float, float] | None,
    limit: float,
    unit: str = "",
    episodes: int = 0,
) -> Check:
    """Return a check of a metric with `ends` (low, value, high) from some episodes; None: undefined."""
    if ends is None:
        return Check(name, text, None, "at most", limit, unit, False)
    low, value, high = ends
    passed, undecided = high <= limit, low <= limit < high
    more = None
    if undecided:
        # The width of an interval falls with the root of the number of episodes.
        width = high - value if value <= limit else value - low
        needed = episodes * (width / max(abs(limit - value), 1e-12)) ** 2
        more = math.ceil(needed - episodes) if needed - episodes <= MOST_EPISODES else None
    return Check(name, text, high, "at most", limit, unit, passed, more, undecided)


def _mean_at_most(name: str, found: Mean | None, limit: float, unit: str = "") -> Check:
    ends = None if found is None else (found.low, found.value, found.high)
    return _at_most(name, mean_text(found, unit), ends, limit, unit, 0 if found is None else found.count)


def _warning_at_most(curve: WarningCurve, limit_s: float) -> Check:
    name, text = f"warning for {curve.target:.0%} success", warning_text(curve)
    if curve.needed_s is None or curve.low_s is None:
        return _at_most(name, text, None, limit_s, "s")
    longest_s = curve.range_s[1]
    if curve.high_s is None and curve.needed_s <= limit_s:
        # The upper end lies beyond what was played; how far nobody knows.
        return Check(name, text, None, "at most", limit_s, "s", False, curve.episodes, True)
    high_s = longest_s if curve.high_s is None else curve.high_s
    return _at_most(name, text, (curve.low_s, curve.needed_s, high_s), limit_s, "s", curve.episodes)
