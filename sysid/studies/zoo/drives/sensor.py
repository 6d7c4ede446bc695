"""From the motion of a wheel to the rows of a log: what the sensor sees, and when it says so."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from sysid.studies.zoo.drives.arrays import FloatArray
from sysid.studies.zoo.drives.drive import Sensor

_RPM = 60.0 / (2.0 * math.pi)


@dataclass(frozen=True, eq=False)
class Motion:
    """How a wheel moved: arrays of shape (n,) at even times, from a little before the start of the run."""

    time_s: FloatArray
    wheel_rad: FloatArray
    wheel_rad_s: FloatArray
    motor_rad: FloatArray
    """Angle of the motor's side of the play, at the wheel's shaft."""
    motor_rad_s: FloatArray
    supply_v: FloatArray


@dataclass(frozen=True, eq=False)
class Samples:
    """Rows of a log, each array (m,)."""

    time_s: FloatArray
    """Stamps, strictly rising from 0."""
    taken_s: FloatArray
    """True times of the samples."""
    speed_rpm: FloatArray


def sample(
    sensor: Sensor,
    motion: Motion,
    duration_s: float,
    rng: np.random.Generator,
    clock: np.random.Generator | None = None,
) -> Samples:
    """Return what is logged of a run: a row every `sensor.sample_s` from 0 to `duration_s`.

    The random draws depend on the number of rows alone, so sensors of other values see the same luck. `clock`
    draws the stamps in place of `rng`: sensors of one logger have it in the same state.
    """
    rows = math.floor(duration_s / sensor.sample_s + 1e-9) + 1
    jitter, noise, phase = (clock or rng).standard_normal(rows), rng.standard_normal(rows), rng.random()
    wild, wild_rpm, held = rng.random(rows), rng.uniform(-1.0, 1.0, rows), rng.random(rows)
    lost = rng.random(rows) < sensor.blank_share
    clock_s: FloatArray = sensor.sample_s * np.arange(rows, dtype=np.float64)
    taken_s: FloatArray = clock_s
    stamps_s: FloatArray = clock_s
    if sensor.stamps == "uneven":
        # Less than half a period each way, so the order stays; the first row is the start of the run.
        moved = np.clip(sensor.jitter_s * jitter, -0.45 * sensor.sample_s, 0.45 * sensor.sample_s)
        taken_s = clock_s + np.where(clock_s > 0.0, moved, 0.0)
        stamps_s = taken_s
    elif sensor.stamps == "late":
        moved = np.minimum(sensor.jitter_s * np.abs(jitter), 0.9 * sensor.sample_s)
        stamps_s = clock_s + np.where(clock_s > 0.0, moved, 0.0)
    seen_s = taken_s - sensor.late_s
    speed = (
        _counted(sensor, motion, seen_s, phase) if sensor.counts > 0 else _measured(sensor, motion, seen_s)
    )
    speed = sensor.scale * speed + sensor.noise_rpm * noise
    top = max(float(np.max(np.abs(speed))), 1.0)
    wild_rpm += np.sign(wild_rpm)
    speed = np.where(wild < sensor.outlier_share, top * wild_rpm, speed)
    if sensor.held_share > 0.0:
        fresh = held >= sensor.held_share
        fresh[0] = True
        speed = speed[np.maximum.accumulate(np.where(fresh, np.arange(rows), 0))]
    blank_s = max(sensor.blank_s, sensor.sample_s)
    speed = np.where(lost[(clock_s / blank_s + 1e-9).astype(int)], 0.0, speed)
    if sensor.resolution_rpm > 0.0:
        speed = np.rint(speed / sensor.resolution_rpm) * sensor.resolution_rpm
    return Samples(stamps_s, taken_s, speed)


def _side(sensor: Sensor, motion: Motion) -> tuple[FloatArray, FloatArray]:
    """Return angle [rad] and speed [rad/s] of the sensor's side, as its eccentric disk shows them."""
    angle, speed = motion.wheel_rad, motion.wheel_rad_s
    if sensor.side == "motor":
        angle, speed = motion.motor_rad, motion.motor_rad_s
    if sensor.eccentricity == 0.0:
        return angle, speed
    per_turn = sensor.eccentricity_per_turn
    swing = per_turn * angle + math.radians(sensor.eccentricity_phase_deg)
    return (
        angle + sensor.eccentricity / per_turn * np.sin(swing),
        speed * (1.0 + sensor.eccentricity * np.cos(swing)),
    )


def _counted(sensor: Sensor, motion: Motion, seen_s: FloatArray, phase: float) -> FloatArray:
    """Return the speed [rpm] from the counts of an encoder over its window, filtered from row to row."""
    angle, _ = _side(sensor, motion)
    window_s = sensor.window_s or sensor.sample_s

    def counts(at_s: FloatArray) -> FloatArray:
        turns = np.interp(at_s, motion.time_s, angle) / (2.0 * math.pi)
        return np.floor(turns * sensor.counts + phase)

    speed: FloatArray = (counts(seen_s) - counts(seen_s - window_s)) * (60.0 / (sensor.counts * window_s))
    if sensor.filter_s > 0.0:
        left = math.exp(-sensor.sample_s / sensor.filter_s)
        speed = lfilter([1.0 - left], [1.0, -left], speed)
    return speed


def _measured(sensor: Sensor, motion: Motion, seen_s: FloatArray) -> FloatArray:
    """Return the speed [rpm] that a tachometer shows, averaged and filtered as it is measured."""
    angle, speed = _side(sensor, motion)
    if sensor.window_s > 0.0:
        before = np.interp(motion.time_s - sensor.window_s, motion.time_s, angle)
        speed = (angle - before) / sensor.window_s
    if sensor.filter_s > 0.0:
        left = math.exp(-(motion.time_s[1] - motion.time_s[0]) / sensor.filter_s)
        speed = lfilter([1.0 - left], [1.0, -left], speed)
    result: FloatArray = np.interp(seen_s, motion.time_s, speed) * _RPM
    return result
