"""Pass or fail: each figure's worse end against its threshold."""

from __future__ import annotations

import math
from dataclasses import fields

from mecanum_env.errors import InputError
from training.certify.certificate import Check, PlantFigures, Thresholds, Timing, TrackFigures
from training.certify.warning import WarningCurve
from training.evaluate import Mean, Share


def require_valid(thresholds: Thresholds) -> None:
    """Refuse thresholds that no figure can be held against.

    Raises:
        InputError: one that is not a number from 0 on, or a share above 1.
    """
    for one in fields(thresholds):
        value = getattr(thresholds, one.name)
        most = 1.0 if one.name in ("success", "worst_success", "saturated_share") else math.inf
        if not 0.0 <= value <= most:
            end = " to 1" if most == 1.0 else " on"
            raise InputError(f"thresholds: {one.name} = {value}, must be a number from 0{end}")


def checks(
    nominal: PlantFigures,
    worst: PlantFigures,
    warning: WarningCurve,
    track: TrackFigures,
    thresholds: Thresholds,
) -> tuple[Check, ...]:
    """Return every check but that of the time for a command.

    Args:
        nominal: the nominal plant.
        worst: the one with the least success.
        warning: success against warning.
        track: the tracking task.
        thresholds: what it takes.
    """
    least, most = _at_least, _at_most
    t = thresholds
    followed = track.distance_error_m
    return (
        least("nominal success", share_text(nominal.success), nominal.success.low, t.success),
        least(
            "worst-plant success",
            f"{share_text(worst.success)} on {worst.name}",
            worst.success.low,
            t.worst_success,
        ),
        most(
            f"warning for {warning.target:.0%} success",
            warning_text(warning),
            warning.high_s if warning.needed_s is not None else None,
            t.warning_s,
            "s",
        ),
        most("tracking error", mean_text(followed, "m"), _high(followed), t.tracking_m, "m"),
        most("settling", mean_text(nominal.settling_s, "s"), _high(nominal.settling_s), t.settling_s, "s"),
        most("overshoot", mean_text(nominal.overshoot, ""), _high(nominal.overshoot), t.overshoot),
        most(
            "commands that saturate a wheel",
            mean_text(nominal.saturated_share, ""),
            nominal.saturated_share.high,
            t.saturated_share,
        ),
    )  # fmt: skip


def timing_check(timing: Timing, thresholds: Thresholds) -> Check:
    """Return the check of the time for a command.

    Args:
        timing: what was measured.
        thresholds: what it takes.
    """
    text = f"p50 {milliseconds(timing.p50_s)}, p99 {milliseconds(timing.p99_s)}"
    return _at_most("time for a command, p99", text, timing.p99_s, thresholds.command_s, "s")


def share_text(found: Share) -> str:
    """Return a share with its interval, such as "0.58 (0.51 .. 0.65)"."""
    return f"{found.value:.2f} ({found.low:.2f} .. {found.high:.2f})"


def mean_text(found: Mean | None, unit: str) -> str:
    """Return a mean found, with its interval, in a unit; "never" for None."""
    if found is None:
        return "never"
    return f"{found.value:.2f}{' ' * bool(unit)}{unit} ({found.low:.2f} .. {found.high:.2f})"


def warning_text(curve: WarningCurve) -> str:
    """Return the warning that is needed by a curve, with its interval."""
    longest = f"more than {curve.range_s[1]:g}"
    if curve.needed_s is None:
        best = max(range(len(curve.success)), key=lambda i: curve.success[i])
        return f"not reached; at best {curve.success[best]:.2f} at {curve.warning_s[best]:.2f} s"
    low, high = (longest if end is None else f"{end:.2f}" for end in (curve.low_s, curve.high_s))
    text = f"{curve.needed_s:.2f} s ({low} .. {high})"
    return text if curve.holds_to_s is None else f"{text}, up to {curve.holds_to_s:.2f} s"


def milliseconds(seconds: float) -> str:
    """Return seconds as text in ms."""
    return f"{1e3 * seconds:.3g} ms"


def _high(found: Mean | None) -> float | None:
    return None if found is None else found.high


def _at_least(name: str, text: str, value: float | None, limit: float) -> Check:
    return Check(name, text, value, "at least", limit, "", value is not None and value >= limit)


def _at_most(name: str, text: str, value: float | None, limit: float, unit: str = "") -> Check:
    return Check(name, text, value, "at most", limit, unit, value is not None and value <= limit)
