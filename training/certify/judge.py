"""Pass or fail: the worse end of each metric's interval against its threshold."""

from __future__ import annotations

from training.certify.certificate import Check, Timing, TrackingResult, VariantResult
from training.certify.thresholds import Thresholds
from training.certify.warning import WarningCurve
from training.evaluate import Mean, Share


def checks(
    nominal: VariantResult,
    worst: VariantResult,
    warning: WarningCurve,
    track: TrackingResult,
    thresholds: Thresholds,
) -> tuple[Check, ...]:
    """Return all checks except that of the time per command, from the results on these plants and tasks."""
    least, most, t = _at_least, _at_most, thresholds
    distance, settling, overshoot = track.distance_error_m, nominal.settling_s, nominal.overshoot
    worst_text = f"{share_text(worst.success)} on {worst.name}"
    saturated = nominal.saturated_share
    needed = warning.high_s if warning.needed_s is not None else None
    return (
        least("nominal success", share_text(nominal.success), nominal.success.low, t.success),
        least("worst-plant success", worst_text, worst.success.low, t.worst_success),
        most(f"warning for {warning.target:.0%} success", warning_text(warning), needed, t.warning_s, "s"),
        most("tracking error", mean_text(distance, "m"), _high(distance), t.tracking_m, "m"),
        most("settling", mean_text(settling, "s"), _high(settling), t.settling_s, "s"),
        most("overshoot", mean_text(overshoot), _high(overshoot), t.overshoot),
        most("commands that saturate a wheel", mean_text(saturated), saturated.high, t.saturated_share),
    )


def timing_check(timing: Timing, thresholds: Thresholds) -> Check:
    """Return the check of the time per command."""
    text = f"p50 {milliseconds(timing.p50_s)}, p99 {milliseconds(timing.p99_s)}"
    return _at_most("time for a command, p99", text, timing.p99_s, thresholds.command_s, "s")


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


def _high(found: Mean | None) -> float | None:
    return None if found is None else found.high


def _at_least(name: str, text: str, value: float | None, limit: float) -> Check:
    return Check(name, text, value, "at least", limit, "", value is not None and value >= limit)


def _at_most(name: str, text: str, value: float | None, limit: float, unit: str = "") -> Check:
    return Check(name, text, value, "at most", limit, unit, value is not None and value <= limit)
