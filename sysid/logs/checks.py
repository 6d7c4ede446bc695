"""Checks of a log that lead to findings, so that nobody fits odd data unawares.

The thresholds are where a person who looks at a plot would begin to wonder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Final

import numpy as np
import numpy.typing as npt

from mecanum_env.kinematics import WHEEL_SPEEDS
from mecanum_env.model import Wheel
from mecanum_env.units import RAD_S_PER_RPM, FloatArray, unit_of_stamps
from sysid.logs.findings import Finding
from sysid.logs.runs import REST, TIME, BodyCommand, Run

_UNEVEN: Final = 0.05
"""Spread (5th to 95th percentile) of the sample intervals over their median above which stamps are uneven."""
_GAP_INTERVALS: Final = 5.0
"""A gap is longer than this many median sample intervals ..."""
_GAP_S: Final = 0.05
"""... and longer than this [s]."""
_HELD_SHARE: Final = 0.2
"""Share of repeated samples during motion above which a channel is held; chance repeats stay far below."""
_HELD_SIGMAS: Final = 2.0
"""Standard deviations by which samples must repeat the last one more often than the last but one."""
COMMAND_PERIOD_S: Final = Wheel.command_period_s
"""Time between two commands that the robot accepts [s]."""
LIMIT_RPM: Final = Wheel.saturation_rpm
"""Largest wheel speed of the paper's robot [rpm]."""
SETTLED_S: Final = 0.5
"""Time after which a held command has settled [s]; the published robot needs 0.25 s."""
_LATE_PART: Final = 0.6
"""Share of the longest time that a command is held, after which it has settled as far as logs show that hold
none for longer. Assumed: where a wheel has not, the command explains too little of its speed."""
_EARLY: Final = 0.1
"""Share of a change of the command by which no wheel has moved when the command is sent."""
_USUAL_STEPS: Final = 10.0
"""A change is looked at if that share is more than so many times the usual step between two samples."""
_LEAST_CHANGES: Final = 4
"""Least number of such changes that show how a log was written."""

_LARGEST_GAIN: Final = 8.0
"""Settled speed over command that no drive has, above or below one, whose command is a speed of the wheel."""
_LEVELS: Final = 4
"""Least number of different commands that show a unit; by chance all are whole once in 10^5 logs."""
_WHOLE_RPM: Final = 0.02
"""Commands of a file with few decimals differ from whole ones by less [rpm]."""


def run_findings(run: Run) -> list[Finding]:
    """Return what was noticed in one run, in the order of `findings.KINDS`."""
    checks = (_stamps, _held, _missing, _stuck, _same_channels, _units, _commands, _limit, _start)
    return [finding for check in checks for finding in check(run)]


def dataset_findings(runs: Sequence[Run]) -> list[Finding]:
    """Return what only all runs together show: another unit, the wrong sign, or commands that stand late.

    The gain is the least-squares slope of speed over command where the command has settled; a single run may
    deviate for other reasons, such as a limit on the body's speed.
    """
    findings = []
    names = ("speed_rpm",) if runs[0].level == "bench" else WHEEL_SPEEDS
    settled_s = _settled_s(runs)
    early = [finding for index, name in enumerate(names) for finding in _early(runs, name, index)]
    for index, name in enumerate(names):
        pairs = [_settled_pairs(run, name, index, settled_s) for run in runs if name in run.channels]
        command, speed = (np.concatenate([pair[i] for pair in pairs] or [np.empty(0)]) for i in range(2))
        power = float(command @ command)
        if command.size < 5 or power == 0.0 or not speed.any():
            continue
        gain = float(command @ speed) / power
        if np.mean((speed - gain * command) ** 2) > 0.25 * np.mean(speed**2):
            continue  # the command explains too little of the speed for a gain to mean anything
        findings += list(_wrong_gain(gain, name))
    return [*(findings or list(_whole_in_rpm(runs))), *early[:1]]


def _early(runs: Sequence[Run], name: str, index: int) -> Iterator[Finding]:
    """Check whether a wheel has moved in the rows that first show its command, which no cause does.

    A program that sends a command, waits and then reads the wheel logs such rows.
    """
    moved = []
    for run in (run for run in runs if name in run.channels):
        # Only ratios count, and differences of the largest numbers stay finite.
        speed, command = 0.25 * run.channel(name), 0.25 * run.command.wheels_rpm[:, index]
        rows = run.command_rows()[1:]
        held_s = np.diff(run.time_s[run.command_rows()])
        rows = rows[(held_s >= SETTLED_S) & np.isfinite(speed[rows] - speed[rows - 1])]
        steps, change = np.diff(speed), command[rows] - command[rows - 1]
        usual = _USUAL_STEPS * float(np.nanmedian(np.abs(steps))) if np.any(np.isfinite(steps)) else np.inf
        seen = np.abs(change) * _EARLY > usual
        moved.append((np.sign(change) * steps[rows - 1] > _EARLY * np.abs(change))[seen])
    early = np.concatenate(moved) if moved else np.zeros(0, bool)
    if early.size >= _LEAST_CHANGES and np.mean(early) > 0.5:
        details: dict[str, float | str] = {"count": int(early.sum()), "changes": early.size}
        yield Finding("", "late_rows", float(np.mean(early)), name, details=details)


def _wrong_gain(gain: float, name: str) -> Iterator[Finding]:
    for unit, scale in (("rad/s", RAD_S_PER_RPM), ("turns/s", 1.0 / 60.0)):
        for factor, suspect in ((scale, name), (1.0 / scale, "the command")):
            if abs(abs(gain) / factor - 1.0) < 0.15:
                details: dict[str, float | str] = {"suspect": suspect, "unit": unit, "scale": 1.0 / scale}
                yield Finding("", "units", gain, name, "gain", details)
                return
    if not 1.0 / _LARGEST_GAIN < abs(gain) < _LARGEST_GAIN:
        suspect, scale = ("the command", gain) if abs(gain) > 1.0 else (name, 1.0 / gain)
        yield Finding("", "units", gain, name, "no speed", {"suspect": suspect, "scale": scale})
    elif gain < 0.0:
        yield Finding("", "units", gain, name, "sign")


def _whole_in_rpm(runs: Sequence[Run]) -> Iterator[Finding]:
    """Check whether commands are whole numbers of rpm, as robots take them, but written in rad/s."""
    used = [run.command for run in runs if not isinstance(run.command, BodyCommand)]
    if not used:
        return
    levels = np.unique(np.abs(np.concatenate([command.wheels_rpm.ravel() for command in used])))
    levels = levels[levels > RAD_S_PER_RPM / 2.0]
    if levels.size < _LEVELS or np.median(np.abs(levels - np.rint(levels))) < _WHOLE_RPM:
        return
    if np.all(np.abs(levels / RAD_S_PER_RPM - np.rint(levels / RAD_S_PER_RPM)) < _WHOLE_RPM):
        name = next(iter(used[0].columns()))
        details: dict[str, float | str] = {"scale": 1.0 / RAD_S_PER_RPM}
        yield Finding("", "units", float(levels.max()), name, "whole in rpm", details)


def _settled_s(runs: Sequence[Run]) -> float:
    """Return the time after which a held command has settled [s]: less where none is held for longer."""
    holds = [np.diff([*run.command_changes()[0], run.time_s[-1]]) for run in runs]
    if sum(hold.size - 1 for hold in holds) < _LEAST_CHANGES:
        return SETTLED_S
    longest = float(np.max(np.concatenate(holds)))
    return SETTLED_S if longest > SETTLED_S else _LATE_PART * longest


def _settled_pairs(run: Run, name: str, index: int, settled_s: float) -> tuple[FloatArray, FloatArray]:
    """Return wheel commands and speeds [rpm] where the command has been held for a time [s]."""
    times = run.command_changes()[0]
    since = run.time_s - times[np.searchsorted(times, run.time_s, side="right") - 1]
    use = (since >= settled_s) & run.finite(name)
    return run.command.wheels_rpm[use, index], run.channel(name)[use]


def _stamps(run: Run) -> Iterator[Finding]:
    """Check the stamps of each channel's samples; channels that agree are reported once."""
    reported: set[str] = set()
    for name, values in run.channels.items():
        interval = np.diff(run.time_s[np.isfinite(values)])
        if interval.size < 3:
            continue
        median = float(np.median(interval))
        low, high = (float(x) for x in np.percentile(interval, (5.0, 95.0)))
        gaps = interval[interval > max(_GAP_INTERVALS * median, _GAP_S)]
        found = []
        if high - low > _UNEVEN * median:
            details = {"low_ms": 1000.0 * low, "high_ms": 1000.0 * high, "median_ms": 1000.0 * median}
            found.append(Finding(run.file, "uneven_stamps", (high - low) / median, name, details=details))
        if gaps.size:
            details = {"count": gaps.size, "median_s": median}
            found.append(Finding(run.file, "gap", float(gaps.max()), name, details=details))
        for finding in found:
            sentence = replace(finding, channel="").message
            if sentence not in reported:
                reported.add(sentence)
                yield finding


def _held(run: Run) -> Iterator[Finding]:
    for name, values in run.channels.items():
        if name == "battery_v":  # often logged slower than the rest, and of any size
            continue
        x = values[np.isfinite(values)]
        moving = _moving(x)
        if moving.sum() < 10:
            continue
        share = float(np.mean(x[1:][moving] == x[:-1][moving]))
        if share > _HELD_SHARE and _repeats_the_last(0.25 * x):
            yield Finding(run.file, "held_samples", share, name)


def _repeats_the_last(x: FloatArray) -> bool:
    """Return whether a signal that moves before and after repeats the last value, not only one of the last.

    Noise beside coarse steps returns two samples later as often; beside a single jump nothing moves.
    """
    moving = _moving(x)
    pairs = np.flatnonzero(moving[1:-2]) + 2
    moved = np.minimum(np.abs(x[pairs - 1] - x[pairs - 3]), np.abs(x[pairs + 2] - x[pairs]))
    pairs = pairs[(moved > 2.0 * _step(x)) & (pairs > 2)]
    last, last_but_one = (int(np.sum(x[pairs] == x[pairs - lag])) for lag in (1, 2))
    return last - last_but_one > _HELD_SIGMAS * math.sqrt(last + last_but_one)


def _moving(x: FloatArray) -> npt.NDArray[np.bool_]:
    """Return where (for samples 1..) the signal moves by far more than its resolution, shape (n - 1,).

    Rounding also makes neighbours equal, but not where five samples span many times the smallest step.
    """
    x = 0.25 * x  # only ratios count, and differences of the largest numbers stay finite
    resolution = _step(x)
    if x.size < 6 or resolution == 0.0:
        return np.zeros(max(0, x.size - 1), bool)
    window = np.lib.stride_tricks.sliding_window_view(np.pad(x, 2, mode="edge"), 5)
    spans = window.max(axis=1) - window.min(axis=1)
    moving: npt.NDArray[np.bool_] = spans[1:] > 8.0 * resolution
    return moving


def _step(x: FloatArray) -> float:
    """Return the usual smallest step between samples, 0 if there is none."""
    steps = np.abs(np.diff(x))
    # The tenth percentile, not the smallest step, which rounding to two decimals may make tiny.
    return float(np.percentile(steps[steps > 0.0], 10.0)) if np.any(steps > 0.0) else 0.0


def _missing(run: Run) -> Iterator[Finding]:
    for name, values in run.channels.items():
        share = float(np.mean(~np.isfinite(values)))
        if share > 0.0:
            yield Finding(run.file, "missing", share, name)


def _stuck(run: Run) -> Iterator[Finding]:
    commands_move = float(np.max(np.ptp(run.command.wheels_rpm, axis=0))) > 0.0
    changes = run.command_changes()[0][1:]
    for name, values in run.channels.items():
        finite = np.isfinite(values)
        x, t = values[finite], run.time_s[finite]
        if name not in REST or x.size < 2:
            continue
        if np.ptp(x) == 0.0:
            if commands_move or x[0] != 0.0:
                yield Finding(run.file, "stuck", float(x[0]), name)
            continue
        bounds = np.concatenate([[0], np.flatnonzero(np.diff(x)) + 1, [x.size]])
        for first, last in zip(bounds[:-1], bounds[1:] - 1, strict=True):
            # Zero may be a dead zone, and a slow sensor repeats; half a second after a command is neither.
            inside = changes[(changes > t[first]) & (changes < t[last] - SETTLED_S)]
            if x[first] != 0.0 and last - first >= 4 and inside.size:
                details = {"level": float(x[first]), "from_s": float(t[first]), "to_s": float(t[last])}
                held_s = float(t[last] - t[first])
                yield Finding(run.file, "stuck", held_s, name, "stuck for a while", details)
                break


def _same_channels(run: Run) -> Iterator[Finding]:
    names = list(run.channels)
    for index, name in enumerate(names):
        for earlier in names[:index]:
            one, other = run.channels[earlier], run.channels[name]
            if np.nanmax(np.abs(one), initial=0.0) > 0.0 and np.array_equal(one, other, equal_nan=True):
                yield Finding(run.file, "same_channel", 1.0, name, details={"other": earlier})
                break


def _units(run: Run) -> Iterator[Finding]:
    interval = np.diff(run.time_s)
    if np.median(interval) >= 1.0 and interval.size >= 20 and np.all(interval == np.rint(interval)):
        usual = float(np.median(interval))
        unit, scale = unit_of_stamps(usual)
        yield Finding(run.file, "units", usual, TIME, "stamps", {"unit": unit, "scale": scale})
    if isinstance(run.command, BodyCommand):
        theta = np.abs(run.command.theta_deg)
        if 0.0 < theta.max() <= 2.0 * np.pi + 0.01 and np.any(theta != np.rint(theta)):
            yield Finding(run.file, "units", float(theta.max()), "command_theta_deg", "radians")
    if "yaw_rate_rad_s" in run.channels:
        fastest = float(np.nanmax(np.abs(run.channels["yaw_rate_rad_s"]), initial=0.0))
        if fastest > 20.0:
            yield Finding(run.file, "units", fastest, "yaw_rate_rad_s", "degrees")


def _commands(run: Run) -> Iterator[Finding]:
    intervals = np.diff(run.command_changes()[0][1:])
    # A change is stamped with the sample that first shows it, so two may look one sample closer.
    fast = int(np.sum(intervals < COMMAND_PERIOD_S - run.median_interval_s - 1e-9))
    if fast:
        details = {"changes": intervals.size + 1, "period_s": COMMAND_PERIOD_S}
        yield Finding(run.file, "fast_commands", float(fast), details=details)


def _limit(run: Run) -> Iterator[Finding]:
    speeds = [v for n, v in run.channels.items() if n == "speed_rpm" or n in WHEEL_SPEEDS]
    # Noise on a wheel at its limit does not exceed the limit.
    checked = (("command", [run.command.wheels_rpm], 1.0), ("measured speed", speeds, 1.02))
    for quantity, values, tolerance in checked:
        fastest = max((float(np.nanmax(np.abs(v), initial=0.0)) for v in values), default=0.0)
        if fastest > tolerance * LIMIT_RPM:
            details: dict[str, float | str] = {"quantity": quantity, "limit_rpm": LIMIT_RPM}
            yield Finding(run.file, "beyond_limit", fastest, details=details)


def _start(run: Run) -> Iterator[Finding]:
    for name, rest in REST.items():
        x = run.channels[name][run.finite(name)] if name in run.channels else np.empty(0)
        if x.size < 3:
            continue
        # The mean of three samples, since one may be noise; the first command has hardly acted by then.
        first = float(np.mean(x[:3])) if np.ptp(x[:3]) < 3.0 * rest else float(x[0])
        if abs(first) > rest:
            yield Finding(run.file, "not_at_rest", first, name)
