"""From the commands that a user sends to the set-points that the speed loop follows."""

from __future__ import annotations

import math

import numpy as np

from sysid.studies.zoo.drives.arrays import FloatArray, compiled
from sysid.studies.zoo.drives.drive import Battery, Controller, Drive, Link


def arrivals(link: Link, commands_rpm: FloatArray, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return when the drive receives a message [s], in rising order, and its command [rpm].

    One of `commands_rpm`, (m,), is sent every `link.period_s` from time 0 on. The delay changes only where
    the command does. The random draws depend on m alone, so links of other values see the same luck.
    """
    commands_rpm = np.asarray(commands_rpm, dtype=float)
    late = link.jitter_s * rng.standard_normal(len(commands_rpm))
    lost = rng.random(len(commands_rpm)) < link.loss
    changed = np.concatenate([[True], np.diff(commands_rpm) != 0.0])
    late = late[np.maximum.accumulate(np.where(changed, np.arange(len(late)), 0))]
    times = link.period_s * np.arange(len(late)) + np.maximum(link.delay_s + late, 0.0)
    # Messages keep their order: one that was delayed holds up those behind it.
    return np.maximum.accumulate(times)[~lost], commands_rpm[~lost]


def received(
    link: Link, commands_rpm: FloatArray, ticks_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the command [rpm] that the drive knows at each tick of its loop, 0 before the first.

    `commands_rpm`, (m,), are sent every `link.period_s`; `ticks_s` are times [s] since the first.
    """
    times, values = arrivals(link, commands_rpm, rng)
    known = np.concatenate([[0.0], values])
    result: FloatArray = known[np.searchsorted(times, ticks_s, side="right")]
    return result


def target_rpm(
    control: Controller, battery: Battery, command_rpm: FloatArray, ticks_s: FloatArray
) -> FloatArray:
    """Return what the firmware makes of the received command before ramps and filters [rpm].

    `command_rpm` and `ticks_s`, (n,), are the received command and the time of each tick of the loop.
    """
    value = np.array(command_rpm, dtype=float)
    size = np.abs(value)
    if control.dead_zone_rpm > 0.0:
        kept = size - control.dead_zone_rpm if control.dead_zone == "subtract" else size
        value = np.where(size > control.dead_zone_rpm, np.sign(value) * kept, 0.0)
    if control.quantum_rpm > 0.0:
        value = np.rint(value / control.quantum_rpm) * control.quantum_rpm
    if control.curve_rpm:
        value = _curve(control, value)
    time_s = np.maximum(ticks_s, 0.0)
    gain = control.gain * np.where(value < 0.0, control.reverse_gain, 1.0)
    gain *= 1.0 - control.gain_fall_per_s * time_s
    gain *= 1.0 - control.gain_per_volt * battery.fall_v_per_s * time_s
    gain *= 1.0 + control.gain_warming * np.expm1(-time_s / control.gain_warming_s)
    gain *= 1.0 + control.gain_swing * np.sin(2.0 * math.pi * control.gain_swing_hz * time_s)
    gain *= 1.0 - control.gain_hysteresis * _fell(value)
    value = np.maximum(gain, 0.0) * value + control.offset_rpm
    return _below_ceiling(control, value)


def _curve(control: Controller, value: FloatArray) -> FloatArray:
    """Map by the odd curve; straight through the origin, and on along its last piece."""
    x, y = np.array(((0.0, 0.0), *control.curve_rpm)).T
    size = np.abs(value)
    inside = np.interp(size, x, y)
    slope = (y[-1] - y[-2]) / (x[-1] - x[-2])
    result: FloatArray = np.sign(value) * np.where(size > x[-1], y[-1] + slope * (size - x[-1]), inside)
    return result


def _fell(value: FloatArray) -> FloatArray:
    """Return 1 where the last change of a held value made it smaller, else 0."""
    step = np.diff(np.abs(value), prepend=0.0)
    last = np.maximum.accumulate(np.where(step != 0.0, np.arange(len(value)), 0))
    result: FloatArray = (step[last] < 0.0).astype(float)
    return result


def _below_ceiling(control: Controller, value: FloatArray) -> FloatArray:
    """Limit to the ceiling; with a softness s, -s log(exp(-|v|/s) + exp(-ceiling/s)), a smooth minimum."""
    if not math.isfinite(control.ceiling_rpm):
        return value
    size = np.abs(value)
    soft = control.ceiling_softness_rpm
    if soft > 0.0:
        smooth = -soft * np.logaddexp(-size / soft, -control.ceiling_rpm / soft)
        # The smooth minimum of 0 is a little below 0.
        return np.sign(value) * np.maximum(smooth, 0.0)
    return np.sign(value) * np.minimum(size, control.ceiling_rpm)


@compiled
def _ramped(target: FloatArray, tick_s: float, up: float, down: float, jerk: float) -> FloatArray:
    """Follow a target with limited rates [rpm/s] and, where `jerk` is finite, limited jerk [rpm/s^2]."""
    out = np.empty_like(target)
    value = 0.0
    rate = 0.0
    for n in range(len(target)):
        away = target[n] - value
        limit = down if value * away < 0.0 else up
        if jerk < np.inf:
            # Largest rate from which the jerk, tick by tick, still stops at the target.
            unit = jerk * tick_s
            wanted = unit * (math.sqrt(0.25 + 2.0 * abs(away) / (unit * tick_s)) - 0.5)
            wanted = math.copysign(min(wanted, limit), away)
            rate += min(max(wanted - rate, -unit), unit)
            if abs(away) <= unit * tick_s and abs(rate) <= unit:
                rate = 0.0
                value = target[n]
            value += rate * tick_s
        else:
            step = min(abs(away), limit * tick_s)
            if value * target[n] < 0.0:
                # Through zero it brakes first and only then speeds up.
                step = min(step, abs(value))
            value += math.copysign(step, away)
        out[n] = value
    return out


@compiled
def _filtered(values: FloatArray, share: float) -> FloatArray:
    """First-order filter from rest; `share` of the way is made at each tick."""
    out = np.empty_like(values)
    state = 0.0
    for n in range(len(values)):
        state += share * (values[n] - state)
        out[n] = state
    return out


def set_points(
    drive: Drive, commands_rpm: FloatArray, ticks_s: FloatArray, rng: np.random.Generator
) -> FloatArray:
    """Return the set-point of the speed loop at each of its ticks [rad/s], (n,).

    `commands_rpm`, (m,), are sent every `drive.link.period_s` from time 0 on; `ticks_s` are the times of the
    loop's ticks, evenly spaced.
    """
    return followed(drive, received(drive.link, commands_rpm, ticks_s, rng), ticks_s)


def followed(drive: Drive, command_rpm: FloatArray, ticks_s: FloatArray) -> FloatArray:
    """Return the set-point of the speed loop [rad/s] for the command that the drive knows at each tick, (n,).

    In the order of `drive.Controller`: dead zone, quantum, curve, gains, ceiling, ramp and jerk, filters.
    """
    control = drive.controller
    tick_s = 1.0 / control.loop_hz
    value = target_rpm(control, drive.battery, command_rpm, ticks_s)
    if math.isfinite(control.ramp_rpm_s) or math.isfinite(control.jerk_rpm_s2) or control.brake_rpm_s > 0.0:
        down = control.brake_rpm_s or control.ramp_rpm_s
        value = _ramped(value, tick_s, control.ramp_rpm_s, down, control.jerk_rpm_s2)
    for lag_s in control.filters_s:
        value = _filtered(value, -math.expm1(-tick_s / lag_s))
    return value * (2.0 * math.pi / 60.0)
