"""What is odd in a run without being an error: reported, so that nobody fits it unawares.

Thresholds are where a person looking at the plot would start to wonder; each is a named constant below.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.model import Wheel
from mecanum_env.units import RAD_S_PER_RPM, FloatArray
from sysid.logs.runs import REST, WHEEL_SPEEDS, BodyCommand, Finding, Run

KINDS: Final = {
    "uneven_stamps": "the time between samples varies",
    "gap": "samples are missing for a while",
    "held_samples": "a sensor slower than the log: samples repeat the one before while the wheel moves",
    "missing": "empty cells",
    "stuck": "a channel that does not move",
    "same_channel": "two channels hold the same numbers: one sensor, not two",
    "units": "a column that looks as if it had another unit or sign",
    "fast_commands": "commands that change sooner than the robot takes them",
    "beyond_limit": "speeds above the 135 rpm of the paper's robot",
    "not_at_rest": "a run that starts moving",
    "late_command": "no command in the first rows",
    "group": "a run unlike the others of its group",
    "split": "what is, or is not, held out",
    "unlisted": "a file that dataset.toml does not list",
}
"""Every kind of finding, and what it means."""

UNEVEN: Final = 0.05
"""Spread (5 to 95 percent) of the sample intervals, over their median, from which stamps are uneven."""
GAP_INTERVALS: Final = 5.0
GAP_S: Final = 0.05
"""A gap is longer than so many median sample intervals, and than this [s]."""
HELD_SHARE: Final = 0.2
"""Share of repeated samples while moving from which a channel is held; chance repeats stay far below."""
COMMAND_PERIOD_S: Final = Wheel.command_period_s
"""The robot takes a command this often."""
LIMIT_RPM: Final = Wheel.saturation_rpm
SETTLED_S: Final = 0.5
"""A command held this long has settled: the published robot needs 0.25 s."""


def run_findings(run: Run) -> list[Finding]:
    """Return what was noticed in one run, in the order of `KINDS`."""
    checks = (_stamps, _held, _missing, _stuck, _same_channels, _units, _commands, _limit, _start)
    return [Finding(run.file, kind, text, float(value)) for c in checks for kind, text, value in c(run)]


def dataset_findings(runs: Sequence[Run]) -> list[Finding]:
    """Return what only all runs together show: a wheel speed in another unit or turned round.

    The gain is the least-squares slope of speed over command where the command has settled; one run alone may
    be off for other reasons, such as a limit on the body's speed.
    """
    findings = []
    names = ("speed_rpm",) if runs[0].level == "bench" else WHEEL_SPEEDS
    for index, name in enumerate(names):
        pairs = [_settled_pairs(run, name, index) for run in runs if name in run.channels]
        command = np.concatenate([pair[0] for pair in pairs]) if pairs else np.empty(0)
        speed = np.concatenate([pair[1] for pair in pairs]) if pairs else np.empty(0)
        power = float(command @ command)
        if command.size < 5 or power == 0.0:
            continue
        gain = float(command @ speed) / power
        if np.mean((speed - gain * command) ** 2) > 0.25 * np.mean(speed**2):
            continue  # the command explains too little of the speed to speak of a gain
        said = _unit_of_gain(gain, name)
        if said:
            text = f"{name} is {gain:.3g} times the settled command: {said}"
            findings.append(Finding("", "units", text, gain))
    return findings


def _unit_of_gain(gain: float, name: str) -> str | None:
    for unit, scale in (("rad/s", RAD_S_PER_RPM), ("turns/s", 1.0 / 60.0)):
        for factor, which in ((scale, name), (1.0 / scale, "the command")):
            if abs(abs(gain) / factor - 1.0) < 0.15:
                return f"{which} in {unit}? (scale = {1.0 / scale:.9g})"
    return "the sign is turned round? (scale = -1)" if gain < 0.0 else None


def _settled_pairs(run: Run, name: str, index: int) -> tuple[FloatArray, FloatArray]:
    """Return wheel commands and speeds where the command has been held for `SETTLED_S`."""
    times, _ = run.command_changes()
    since = run.time_s - times[np.searchsorted(times, run.time_s, side="right") - 1]
    use = (since >= SETTLED_S) & run.finite(name)
    return run.command.wheels_rpm[use, index], run.channel(name)[use]


_Items = Iterator[tuple[str, str, float]]


def _stamps(run: Run) -> _Items:
    """Look at the stamps of each channel's samples; say it once where channels agree."""
    said: set[tuple[str, str]] = set()
    for name, values in run.channels.items():
        interval = np.diff(run.time_s[np.isfinite(values)])
        if interval.size < 3:
            continue
        median = float(np.median(interval))
        low, high = np.percentile(interval, (5.0, 95.0))
        gaps = interval[interval > max(GAP_INTERVALS * median, GAP_S)]
        items = []
        if high - low > UNEVEN * median:
            text = f"intervals of {_ms(low)} to {_ms(high)} ms (5 to 95 percent), median {_ms(median)} ms"
            items.append(("uneven_stamps", text, (high - low) / median))
        if gaps.size:
            text = (
                f"{gaps.size} gap(s), the longest {gaps.max():.3g} s; the median interval is {median:.3g} s"
            )
            items.append(("gap", text, float(gaps.max())))
        for kind, text, value in items:
            if (kind, text) not in said:
                yield kind, f"{name}: {text}", value
                said.add((kind, text))


def _ms(seconds: float) -> str:
    return f"{1000.0 * seconds:.3g}"


def _held(run: Run) -> _Items:
    for name, values in run.channels.items():
        if name == "battery_v":
            continue
        x = values[np.isfinite(values)]
        moving = _moving(x)
        if moving.sum() < 10:
            continue
        share = float(np.mean(x[1:][moving] == x[:-1][moving]))
        if share > HELD_SHARE:
            text = f"{name}: {100.0 * share:.0f} % of the samples repeat the one before while it changes"
            yield "held_samples", text, share


def _moving(x: FloatArray) -> npt.NDArray[np.bool_]:
    """Return where (for samples 1..) the signal moves by far more than its resolution, shape (n - 1,).

    Rounding also makes equal neighbours; it cannot where five samples span many times the smallest step.
    """
    if x.size < 6:
        return np.zeros(max(x.size - 1, 0), bool)
    steps = np.abs(np.diff(x))
    if not np.any(steps > 0.0):
        return np.zeros(x.size - 1, bool)
    # A tenth percentile rather than the smallest, which rounding of two decimals may make tiny.
    resolution = float(np.percentile(steps[steps > 0.0], 10.0))
    window = np.lib.stride_tricks.sliding_window_view(np.pad(x, 2, mode="edge"), 5)
    spans = window.max(axis=1) - window.min(axis=1)
    moving: npt.NDArray[np.bool_] = spans[1:] > 8.0 * resolution
    return moving


def _missing(run: Run) -> _Items:
    for name, values in run.channels.items():
        share = float(np.mean(~np.isfinite(values)))
        if share > 0.0:
            yield "missing", f"{name}: {100.0 * share:.3g} % of the samples are missing", share


def _stuck(run: Run) -> _Items:
    wheels = run.command.wheels_rpm
    moved = float(np.max(np.ptp(wheels, axis=0)))
    changes = run.command_changes()[0][1:]
    for name, values in run.channels.items():
        there = np.isfinite(values)
        x, t = values[there], run.time_s[there]
        if name not in REST or x.size < 2:
            continue
        if np.ptp(x) == 0.0:
            if moved > 0.0 or x[0] != 0.0:
                yield "stuck", f"{name}: {x[0]:g} in every sample", x[0]
            continue
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1, [x.size]])
        for first, last in zip(bounds[:-1], bounds[1:] - 1, strict=True):
            # Zero may be a dead zone, and a slow sensor repeats; half a second after a command is neither.
            inside = changes[(changes > t[first]) & (changes < t[last] - SETTLED_S)]
            if x[first] != 0.0 and last - first >= 4 and inside.size:
                text = f"{name}: {x[first]:g} from {t[first]:.3g} to {t[last]:.3g} s"
                yield "stuck", text, t[last] - t[first]
                break


def _same_channels(run: Run) -> _Items:
    names = list(run.channels)
    for index, name in enumerate(names):
        for earlier in names[:index]:
            one, other = run.channels[earlier], run.channels[name]
            if np.nanmax(np.abs(one), initial=0.0) > 0.0 and np.array_equal(one, other, equal_nan=True):
                yield "same_channel", f"{name} repeats {earlier}: one sensor, not two", 1.0
                break


def _units(run: Run) -> _Items:
    interval = np.diff(run.time_s)
    if np.median(interval) >= 1.0 and interval.size >= 20 and np.all(interval == np.rint(interval)):
        text = "time_s has whole numbers only; milliseconds? (scale = 0.001)"
        yield "units", text, float(np.median(interval))
    if isinstance(run.command, BodyCommand):
        theta = np.abs(run.command.theta_deg)
        if 0.0 < theta.max() <= 2.0 * np.pi + 0.01 and np.any(theta != np.rint(theta)):
            text = f"command_theta_deg is at most {theta.max():.4g}; radians? (scale = 57.29577951308232)"
            yield "units", text, float(theta.max())
    if "yaw_rate_rad_s" in run.channels:
        fastest = float(np.nanmax(np.abs(run.channels["yaw_rate_rad_s"]), initial=0.0))
        if fastest > 20.0:
            text = f"yaw_rate_rad_s reaches {fastest:.3g}; degrees per second? (scale = 0.017453292519943295)"
            yield "units", text, fastest


def _commands(run: Run) -> _Items:
    apart = np.diff(run.command_changes()[0][1:])
    # A change is stamped with the sample that first shows it, so two may look one sample closer.
    fast = int(np.sum(apart < COMMAND_PERIOD_S - run.median_interval_s - 1e-9))
    if fast:
        text = (
            f"{fast} of {apart.size + 1} command changes come within {COMMAND_PERIOD_S} s of the one before"
        )
        yield "fast_commands", text, float(fast)


def _limit(run: Run) -> _Items:
    speeds = [v for n, v in run.channels.items() if n == "speed_rpm" or n in WHEEL_SPEEDS]
    for what, values in (("command", [run.command.wheels_rpm]), ("measured speed", speeds)):
        fastest = max((float(np.nanmax(np.abs(v), initial=0.0)) for v in values), default=0.0)
        # Noise on a wheel at its limit is no excess.
        if fastest > LIMIT_RPM * (1.0 if what == "command" else 1.02):
            yield "beyond_limit", f"{what} up to {fastest:.4g} rpm, above {LIMIT_RPM:g}", fastest


def _start(run: Run) -> _Items:
    for name, rest in REST.items():
        values = run.channels.get(name)
        if values is None:
            continue
        x = values[np.isfinite(values)]
        if x.size < 3:
            continue
        # The mean of three samples, since one may be noise; the first command has hardly begun to act.
        first = float(np.mean(x[:3])) if np.ptp(x[:3]) < 3.0 * rest else float(x[0])
        if abs(first) > rest:
            yield "not_at_rest", f"{name} starts at {first:.3g}", first
