"""The second bench simulator: a continuous motor, a controller of 1 kHz, a gear with play, a rubbing wheel.

    L di/dt = u - R i - Ke' W             (W the rotor's speed at the wheel's shaft, Ke' = N Ke)
    Jm dW/dt = Ke' i - Tc - cogging       Jl dw/dt = Tc - friction(w)
    Tc: a stiff spring with damping between rotor and wheel, which beyond the play pushes and never pulls

Friction is an impulse that may stop the wheel and never turns it, so a wheel sticks exactly. All runs of a
case step together: the last axis of every array is the run.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from .drive import Drive, Hidden

RPM = math.pi / 30.0
TICK_S = 1e-3
SUBSTEPS = 10
COMMAND_S = 0.1
SAMPLE_S = 1 / 120
"""The logger runs beside the controller, not in step with it."""
COUNTS = 20 * 2**15
"""Of rotor and wheel encoder, per turn of the wheel: sine encoders, interpolated."""
ROTOR_WINDOW, WINDOW_S = 2, 0.004
"""Over how many ticks the controller counts, and over which time the logger."""
CEILING_RPM = 135.0
SPRING_N_M, SPRING_N_M_S = 150.0, 0.4
NOISE_RPM = 0.5


def simulate(
    drive: Drive, hidden: Hidden, commands_rpm: np.ndarray, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Return sample times (n,) [s] and logged speeds (runs, n) [rpm] of commands (runs, m), one per 0.1 s."""
    drive = _detuned(drive, hidden.slower_loop)
    reference = _reference(drive, hidden, commands_rpm, rng)
    # Each run starts near a mark on the wheel; counts begin anywhere.
    start = rng.uniform(0.0, 0.05, len(commands_rpm))
    angle = _turn(drive, hidden, reference, start)
    return _logged(hidden, angle, rng)


def _detuned(drive: Drive, slower: float) -> Drive:
    if slower == 1.0:
        return drive
    return replace(
        drive,
        kp_v_s=drive.kp_v_s / slower,
        ki_v=(drive.ki_v or 10.0) * slower**2,
        filters_s=tuple(t * slower for t in drive.filters_s),
    )


def _reference(drive: Drive, hidden: Hidden, commands: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the controller's reference [rad/s] at each tick, shape (ticks, runs)."""
    runs, count = commands.shape
    ticks = round(count * COMMAND_S / TICK_S)
    t = np.arange(ticks) * TICK_S
    received = commands.copy()
    if hidden.lost_commands:
        lost = rng.random(received.shape) < hidden.lost_commands
        for k in range(1, count):
            received[:, k] = np.where(lost[:, k], received[:, k - 1], received[:, k])
    if hidden.coarse_rpm:
        received = np.rint(received / hidden.coarse_rpm) * hidden.coarse_rpm
    received = np.where(np.abs(received) < hidden.ignored_below_rpm, 0.0, received)
    if hidden.hysteresis:
        received = received * (1.0 - hidden.hysteresis * _after_a_larger_one(received))
    received = received + hidden.offset_rpm * (np.cumsum(np.abs(commands), axis=1) > 0)
    late = round(hidden.command_late_s / TICK_S)
    index = np.floor_divide(np.arange(ticks) - late, round(COMMAND_S / TICK_S))
    asked = np.where(index < 0, 0.0, received[:, np.maximum(index, 0)])
    asked = asked * hidden.wrong_ratio
    asked = np.where(asked < 0.0, asked * hidden.weak_reverse, asked)
    gain = 1.0 - hidden.supply_fall_per_s * t - hidden.warming * (1.0 - np.exp(-t / 0.4))
    gain = gain + hidden.swing * np.sin(2 * math.pi * 0.9 * t)
    gain = gain + hidden.rising_gain * (np.abs(asked) / 100.0 - 0.5)
    top = min(hidden.top_rpm, CEILING_RPM)
    asked = np.clip(asked * gain, -top, top)
    if math.isfinite(hidden.ramp_rpm_s):
        most, last = hidden.ramp_rpm_s * TICK_S, np.zeros(runs)
        for k in range(ticks):
            last = last + np.clip(asked[:, k] - last, -most, most)
            asked[:, k] = last
    for seconds in drive.filters_s:
        pole = math.exp(-TICK_S / seconds)
        asked = lfilter([1.0 - pole], [1.0, -pole], asked, axis=1)
    return np.ascontiguousarray(asked.T) * RPM


def _after_a_larger_one(commands: np.ndarray) -> np.ndarray:
    """Return where the last change of command was a fall in size, shape of the commands."""
    falling = np.zeros(commands.shape, bool)
    for k in range(1, commands.shape[1]):
        now, before = np.abs(commands[:, k]), np.abs(commands[:, k - 1])
        falling[:, k] = np.where(now == before, falling[:, k - 1], now < before)
    return falling


def _turn(drive: Drive, hidden: Hidden, reference: np.ndarray, start: np.ndarray) -> np.ndarray:
    """Return the wheel's angle [rad] at each tick, shape (ticks + 1, runs)."""
    ticks, runs = reference.shape
    step = TICK_S / SUBSTEPS
    ke, limit = drive.back_emf, drive.supply_v
    settle = -math.expm1(-drive.resistance_ohm / drive.inductance_h * step)
    half = math.radians(hidden.play_deg) / 2.0
    rubs = hidden.drag_n_m > 0.0 or hidden.sticking_n_m > 0.0
    sticking_rad_s = hidden.sticking_rpm * RPM
    oil = 1.0 / (1.0 + step * hidden.oil_n_m_s / drive.wheel_kg_m2)
    current, rotor_speed, wheel_speed = np.zeros(runs), np.zeros(runs), np.zeros(runs)
    rotor, wheel = start.copy(), start.copy()
    integral, error_before = np.zeros(runs), np.zeros(runs)
    angles = np.tile(start, (ticks + 1, 1))
    counts = np.tile(np.floor(start * (COUNTS / (2.0 * math.pi))), (ticks + 1 + ROTOR_WINDOW, 1))
    per_count = 2.0 * math.pi / (COUNTS * ROTOR_WINDOW * TICK_S)
    shaking = hidden.shaking_n_m * np.sin(2 * math.pi * 2.3 * np.arange(ticks) * TICK_S)
    for k in range(ticks):
        counts[k + ROTOR_WINDOW] = np.floor(rotor * (COUNTS / (2.0 * math.pi)))
        seen = (counts[k + ROTOR_WINDOW] - counts[k]) * per_count
        error = reference[k] - seen
        wanted = drive.kp_v_s * error + integral + drive.kd_v_s2 * (error - error_before) / TICK_S
        if drive.feed_forward:
            wanted = wanted + ke * reference[k]
        volts = np.clip(wanted, -limit, limit)
        # Anti-windup: the integral rests while the voltage is at its limit.
        integral = integral + np.where(volts == wanted, drive.ki_v * TICK_S * error, 0.0)
        error_before = error
        for _ in range(SUBSTEPS):
            current = current + settle * ((volts - ke * rotor_speed) / drive.resistance_ohm - current)
            apart = rotor - wheel
            if half > 0.0:
                pressed = apart - np.clip(apart, -half, half)
                push = SPRING_N_M * pressed + SPRING_N_M_S * (rotor_speed - wheel_speed) * (pressed != 0.0)
                push = np.where(push * pressed > 0.0, push, 0.0)
            else:
                push = SPRING_N_M * apart + SPRING_N_M_S * (rotor_speed - wheel_speed)
            torque = ke * current - push
            if hidden.cogging_n_m:
                torque = torque + hidden.cogging_n_m * np.sin(7.0 * rotor)
            rotor_speed = rotor_speed + step / drive.rotor_kg_m2 * torque
            free = (wheel_speed + step / drive.wheel_kg_m2 * (push + shaking[k])) * oil
            if rubs:
                speed_ratio = free / sticking_rad_s
                friction = hidden.drag_n_m + hidden.sticking_n_m * np.exp(-speed_ratio * speed_ratio)
                stopped = np.abs(free) - step / drive.wheel_kg_m2 * friction
                wheel_speed = np.copysign(np.maximum(stopped, 0.0), free)
            else:
                wheel_speed = free
            rotor = rotor + step * rotor_speed
            wheel = wheel + step * wheel_speed
        angles[k + 1] = wheel
    return angles


def _logged(hidden: Hidden, angle: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    ticks = np.arange(len(angle)) * TICK_S
    rows = np.arange(math.floor(ticks[-1] / SAMPLE_S + 1e-9) + 1) * SAMPLE_S
    # A slow sensor is read through a filter of 1 ms steps; a fast one is counted where the logger looks.
    counts = np.floor((angle + hidden.ripple * np.sin(angle)) * (COUNTS / (2.0 * math.pi)))
    if hidden.log_filter_s:
        pole = math.exp(-TICK_S / hidden.log_filter_s)
        # Exact for counts that rise evenly within a tick.
        mean = (1.0 - pole) * hidden.log_filter_s / TICK_S
        first = counts[0] * np.ones((1, 1))
        counts = lfilter([1.0 - mean, mean - pole], [1.0, -pole], counts - first, axis=0) + first
    now, before = (_at(counts, ticks, rows - hidden.log_late_s - past) for past in (0.0, WINDOW_S))
    logged = hidden.log_factor * (now - before).T * (60.0 / (COUNTS * WINDOW_S))
    logged = logged + NOISE_RPM * rng.standard_normal(logged.shape)
    if hidden.glitch_share:
        wild = rng.random(logged.shape) < hidden.glitch_share
        logged = np.where(wild, rng.uniform(-135.0, 135.0, logged.shape), logged)
    return rows, logged


def _at(values: np.ndarray, clock: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return columns (n, runs) on a clock at other times, linear between; the first before it."""
    index = np.clip(times / TICK_S, 0.0, len(clock) - 1.0)
    low = np.minimum(index.astype(int), len(clock) - 2)
    part = (index - low)[:, np.newaxis]
    return values[low] * (1.0 - part) + values[low + 1] * part
